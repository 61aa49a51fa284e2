# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Message definitions as the stacks release them, for the tests of the recipes.

`python test/recipes/interface_files.py` fetches them with git into a folder outside the tree
(MTPGO_INTERFACES, else ~/.cache/mtpgo_ros/interfaces); `make interfaces` does the same. Where ROS
is sourced, the definitions of the installed packages serve. Without either the tests use the
definitions that msg_adapters/wire/definitions.py repeats.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

SOURCES = {
    "autoware_perception_msgs": ("https://github.com/autowarefoundation/autoware_msgs", "1.12.0"),
    "derived_object_msgs": ("https://github.com/astuff/astuff_sensor_msgs", "master"),
    "vision_msgs": ("https://github.com/ros-perception/vision_msgs", "4.1.1"),
}
"""Repository, and tag or branch, of each package: what Jazzy releases, or the same messages."""


def folder() -> Path:
    """Return where fetched definitions are."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(os.environ.get("MTPGO_INTERFACES") or cache / "mtpgo_ros" / "interfaces")


def released_definitions() -> dict[str, str]:
    """Return the text of every released message that was found, by type name."""
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    places = [folder(), *(Path(prefix) / "share" for prefix in prefixes if prefix)]
    found: dict[str, str] = {}
    for package in SOURCES:
        for place in places:
            files = sorted((place / package / "msg").glob("*.msg"))
            if files:
                names = {path: f"{package}/msg/{path.stem}" for path in files}
                found |= {names[path]: path.read_text(encoding="utf-8") for path in files}
                break
    return found


def typestore_of(definitions: dict[str, str]) -> Any:
    """Return the types of Jazzy with those of ``definitions``."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types: dict[str, Any] = {}
    for name, text in definitions.items():
        types |= get_types_from_msg(text, name)
    store.register({name: fields for name, fields in types.items() if name not in store.types})
    return store


def fetch(sources: dict[str, tuple[str, str]] = SOURCES) -> None:
    """Write the definitions of every package into :func:`folder`."""
    for package, (repository, version) in sources.items():
        with tempfile.TemporaryDirectory() as work:
            command = (
                "git",
                "-c",
                "advice.detachedHead=false",
                "clone",
                "--quiet",
                "--depth",
                "1",
            )
            subprocess.run([*command, "--branch", version, repository, work], check=True)
            (found,) = {
                path.parent for path in Path(work).rglob("msg/*.msg") if _is(path, package)
            }
            target = folder() / package / "msg"
            target.mkdir(parents=True, exist_ok=True)
            for path in found.glob("*.msg"):
                (target / path.name).write_bytes(path.read_bytes())
        print(f"{package} {version}: {target}")


def _is(path: Path, package: str) -> bool:
    """Return whether a file defines a message of ours, or one beside it."""
    manifest = path.parents[1] / "package.xml"
    return manifest.is_file() and f"<name>{package}</name>" in manifest.read_text()


def main() -> int:
    """Fetch the definitions."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--from", dest="root", help="URL that replaces https://github.com")
    root = parser.parse_args().root
    sources = SOURCES
    if root:
        sources = {
            package: (repository.replace("https://github.com", root), version)
            for package, (repository, version) in SOURCES.items()
        }
    try:
        fetch(sources)
    except subprocess.CalledProcessError as error:
        print(f"interfaces: {' '.join(error.cmd)} failed", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
