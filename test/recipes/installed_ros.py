# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether packages of ROS that are not on pip are here, and this package where they find it."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path


def why_not(*packages: str) -> str:
    """Return why these packages of ROS cannot start the installed nodes, empty if they can."""
    for package in packages:
        if not importlib.util.find_spec(package):
            return f"{package} is not installed: it comes with ROS, not by pip"
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    marker = Path("share/ament_index/resource_index/packages/mtpgo_ros")
    if not any(prefix and (Path(prefix) / marker).is_file() for prefix in prefixes):
        return "mtpgo_ros is not in AMENT_PREFIX_PATH: build it and source the workspace"
    return ""
