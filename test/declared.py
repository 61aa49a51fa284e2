# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What setup.py and the files of requirements declare, read without running anything."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]


def _value(name: str) -> Any:
    tree = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    wanted = ("PACKAGES", "EXECUTABLES", "REQUIREMENTS", "TEST", "EXTRAS")
    tree.body = [
        node for node in tree.body if isinstance(node, ast.Assign) and node.targets[0].id in wanted
    ]
    values: dict[str, Any] = {}
    exec(compile(tree, "setup.py", "exec"), values)
    return values[name]


def packages() -> list[str]:
    """Return the packages that are installed."""
    return list(_value("PACKAGES"))


def executables() -> dict[str, str]:
    """Return the modules that the executables call, by the name of the executable."""
    return {name: module for name, (module, _) in entry_points().items()}


def entry_points() -> dict[str, tuple[str, str]]:
    """Return module and function that the executables call, by the name of the executable."""
    calls = _value("EXECUTABLES").items()
    return {name: (call.partition(":")[0], call.partition(":")[2]) for name, call in calls}


def requirements() -> list[Requirement]:
    """Return what every installation needs."""
    return [Requirement(text) for text in _value("REQUIREMENTS")]


def extras() -> dict[str, list[Requirement]]:
    """Return what each extra adds."""
    return {
        name: [Requirement(text) for text in texts] for name, texts in _value("EXTRAS").items()
    }


def listed(path: Path) -> list[Requirement]:
    """Return the requirements in a requirements file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [Requirement(line) for line in lines if line and not line.startswith("#")]


def pins(name: str = "development.txt") -> dict[str, str]:
    """Return the versions that a file of requirements pins, by the package in lower case."""
    lines = (ROOT / "requirements" / name).read_text(encoding="utf-8").splitlines()
    found = [re.fullmatch(r"([\w.-]+)(?:\[\w+\])?==(\S+)", line) for line in lines]
    return {pin[1].lower(): pin[2] for pin in found if pin}
