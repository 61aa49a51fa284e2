# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The dependencies that setup.py declares, read without running it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]


def _value(name: str) -> object:
    tree = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    wanted = ("REQUIREMENTS", "TEST", "EXTRAS")
    tree.body = [
        node for node in tree.body if isinstance(node, ast.Assign) and node.targets[0].id in wanted
    ]
    values: dict[str, object] = {}
    exec(compile(tree, "setup.py", "exec"), values)
    return values[name]


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


def pins() -> dict[str, str]:
    """Return the tested version of each direct dependency, by its name in lower case."""
    found = {}
    for line in (ROOT / "requirements" / "development.txt").read_text().splitlines():
        pin = re.fullmatch(r"([\w.-]+)(?:\[\w+\])?==(\S+)", line)
        if pin:
            found[pin[1].lower()] = pin[2]
    return found
