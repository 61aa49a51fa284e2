# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where the files that ship with the package are found, however it was installed.

Three layouts are served by the same code and without ROS's index: the source tree (a checkout, an
editable install, ``colcon build --symlink-install``), where the files lie in the tree; an
installed package (pip, plain colcon build), where they lie in ``<prefix>/share/mtpgo_ros`` of the
prefix that holds this very file; and, last, the prefixes that ``AMENT_PREFIX_PATH`` names.
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
"""Folders whose place in the source tree differs from their place under ``share/mtpgo_ros``."""


def find_resource(*parts: str) -> Path:
    """Path of a file or folder that ships with the package.

    Args:
        parts: the path below ``share/mtpgo_ros``, for instance ``"weights", "default.pt"``.

    Raises:
        ConfigurationError: it is in none of the places looked at; the sentence names them.
    """
    places = list(_places(*parts))
    for place in places:
        if place.exists():
            return place
    raise ConfigurationError(
        f"{'/'.join(parts)} is not among the files installed with {PACKAGE}, "
        f"looked for {', '.join(map(str, places))}"
    )


def source_tree() -> Path | None:
    """Root of the checkout this code runs from, or None where it runs from an installation."""
    root = Path(__file__).resolve().parents[1]
    return (
        root if (root / "setup.py").is_file() and (root / "resource" / PACKAGE).is_file() else None
    )


def _places(*parts: str) -> Iterator[Path]:
    """Where the file may be, the nearest to this code first, each place once."""
    seen: set[Path] = set()
    tree = source_tree()
    if tree is not None:
        yield tree.joinpath(_SOURCE_FOLDERS.get(parts[0], parts[0]), *parts[1:])
    for prefix in _prefixes():
        if prefix not in seen:
            seen.add(prefix)
            yield prefix.joinpath("share", PACKAGE, *parts)


def _prefixes() -> Iterator[Path]:
    """Install prefixes: of this file (``<prefix>/lib/python3.x/site-packages``), Python, ament."""
    parents = Path(__file__).resolve().parents
    yield from parents[2:6]
    yield Path(sys.prefix)
    yield from (Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p)
