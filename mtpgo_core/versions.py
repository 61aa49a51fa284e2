# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The versions that a bug report should state: package, libraries, shipped models.

No library is imported, so this is fast and also works where a library is broken.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.resources import find_resource, source_tree

LIBRARIES = ("torch", "torch-geometric", "numpy", "rosbags", "mcap", "lightning-fabric")
"""Distributions whose versions matter most."""

ROS_LIBRARIES = ("ros-rclpy", "rclpy")
"""Distributions of rclpy: as a wheel, and as a part of an installed ROS 2."""

NOT_INSTALLED = "not installed"


def package_version() -> str:
    """Return the version of this package, of the source tree that runs if there is one."""
    try:
        version = ElementTree.parse(find_resource("package.xml")).getroot().findtext("version")
        return version or "unknown"
    except (ConfigurationError, OSError, ElementTree.ParseError):
        return library_version("mtpgo_ros")


def library_version(name: str) -> str:
    """Return the version of an installed distribution, without loading it."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return NOT_INSTALLED


def version_text(program: str) -> str:
    """Return the versions as text, a line for each thing.

    Args:
        program: name of the executable.
    """
    tree = source_tree()
    rows = {
        "installed in": str(tree or Path(__file__).resolve().parents[1]),
        "Python": f"{platform.python_version()} ({sys.executable})",
        "system": platform.platform(),
        **{name: library_version(name) for name in LIBRARIES},
        "rclpy": _ros(),
        "middleware": os.environ.get("RMW_IMPLEMENTATION") or "the default of ROS",
    }
    rows |= {f"model {path.stem}": f"sha256 {_sha256(path)}" for path in _models()}
    width = max(map(len, rows)) + 2
    lines = [f"{program} {package_version()} (mtpgo_ros)"]
    return "\n".join(lines + [f"  {name:<{width}}{value}" for name, value in rows.items()])


def add_version(parser: argparse.ArgumentParser) -> None:
    """Add ``--version`` to a command line."""
    parser.add_argument(
        "--version",
        action=_PrintVersions,
        nargs=0,
        help="print the versions that a report of a defect should state, and exit",
    )


class _PrintVersions(argparse.Action):
    """``--version``: print the versions and exit, as ``--help`` prints the help."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: Any, values: Any, option: Any = None
    ) -> None:
        """Print the versions of the parser's program and exit."""
        print(version_text(parser.prog))
        parser.exit()


def _ros() -> str:
    found = (library_version(name) for name in ROS_LIBRARIES)
    version = next((text for text in found if text != NOT_INSTALLED), NOT_INSTALLED)
    distribution = os.environ.get("ROS_DISTRO")
    return f"{version} (ROS 2 {distribution} is sourced)" if distribution else version


def _models() -> list[Path]:
    """Return the files of the shipped models."""
    try:
        return sorted(find_resource("weights").glob("*.pt"))
    except ConfigurationError:
        return []


def _sha256(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        return f"cannot be read: {error.strerror}"
