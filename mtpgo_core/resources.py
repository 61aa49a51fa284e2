# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Locations of the files that ship with the package, for every kind of installation.

Three layouts are supported, without ROS's index: the source tree (a checkout, an editable install,
``colcon build --symlink-install``), where the files are in the tree; an installed package (pip,
plain colcon build), where they are in ``<prefix>/share/mtpgo_ros`` of the prefix that contains
this file; and, last, the prefixes in ``AMENT_PREFIX_PATH``.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from mtpgo_core.errors import ConfigurationError

PACKAGE = "mtpgo_ros"
"""Name of the ROS package and of its folder under ``share/``."""

_SOURCE_FOLDERS = {"weights": "resource/weights", "recordings": "resource/recordings"}
"""Folders whose path in the source tree differs from their path under ``share/mtpgo_ros``."""


def find_resource(*parts: str) -> Path:
    """Return the path of a file or folder that ships with the package.

    Args:
        parts: the path below ``share/mtpgo_ros``, for instance ``"weights", "default.pt"``.

    Raises:
        ConfigurationError: it is in none of the searched places, which the sentence lists.
    """
    places = list(_places(*parts))
    for place in places:
        if os.path.exists(place):  # false for a name that is too long
            return place
    raise ConfigurationError(
        f"{'/'.join(parts)} is not among the files installed with {PACKAGE}, "
        f"looked for {', '.join(map(str, places))}"
    )


def source_tree() -> Path | None:
    """Return the root of the checkout this code runs from, None if it is installed."""
    root = Path(__file__).resolve().parents[1]
    return (
        root if (root / "setup.py").is_file() and (root / "resource" / PACKAGE).is_file() else None
    )


def _places(*parts: str) -> Iterator[Path]:
    """Yield the possible paths of the file, the nearest to this code first, each once."""
    seen: set[Path] = set()
    tree = source_tree()
    if tree is not None:
        yield tree.joinpath(_SOURCE_FOLDERS.get(parts[0], parts[0]), *parts[1:])
    for prefix in _prefixes():
        if prefix not in seen:
            seen.add(prefix)
            yield prefix.joinpath("share", PACKAGE, *parts)


def _prefixes() -> Iterator[Path]:
    """Yield the prefixes of this file (in ``lib/python3.x/site-packages``), Python, ament."""
    parents = Path(__file__).resolve().parents
    yield from parents[2:6]
    yield Path(sys.prefix)
    yield from (Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p)
