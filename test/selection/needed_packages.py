# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which tests need packages that a robot may lack; there they are left out with a sentence.

Where everything is installed, as by `make`, nothing is left out.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

_OFFLINE = (
    *("filelock", "jinja2", "lightning_fabric", "matplotlib", "pandas", "platformdirs"),
    *("psutil", "scipy", "tensorboard", "yaml", "torch_geometric", "pyarrow", "google.protobuf"),
    "google_crc32c",
)

NEEDED: dict[str, tuple[str, ...]] = {
    "fuzz": (*_OFFLINE, "hypothesis", "rclpy"),
    "interruption": (*_OFFLINE, "rclpy"),
    "models": ("torch_geometric",),
    "msg_adapters": ("mcap_ros2", "yaml"),
    "mtpgo_ros": ("mcap_ros2", "rclpy", "yaml"),
    "mtpgo_ros/node/test_predictor_node_quality.py": _OFFLINE,
    "mtpgo_ros/runtime/test_model_loading.py": ("psutil",),
    "mtpgo_training": (*_OFFLINE, "mcap_ros2", "rclpy"),
    "recipes": ("rclpy", "yaml"),
    "test_manifest.py": ("yaml",),
    "test_offline_half.py": _OFFLINE,
    "test_shipped_models.py": _OFFLINE,
}
"""Importable packages that a folder or file of test/ needs."""


def missing_for(name: str, installed: Callable[[str], bool]) -> list[str]:
    """Return the packages that a folder or file of test/ needs and that are not installed."""
    return [package for package in NEEDED.get(name, ()) if not installed(package)]


def left_out(installed: Callable[[str], bool]) -> list[str]:
    """Return a sentence for each part of test/ that is left out."""
    missing = {name: missing_for(name, installed) for name in NEEDED}
    return [
        f"test/{name} is left out: {', '.join(packages)} not installed"
        for name, packages in missing.items()
        if packages
    ]


def is_installed(package: str) -> bool:
    """Return whether a package can be imported, without importing it."""
    try:
        return importlib.util.find_spec(package) is not None
    except ModuleNotFoundError:  # the package that holds it
        return False
