# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Training configurations by name, from any directory and any kind of installation."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.resources import find_resource
from mtpgo_core.whole_file import user_path

PARTS = "parts"
"""Folder of the files that configurations are made of (``base``), which have no name."""


@dataclass(frozen=True)
class NamedConfig:
    """A configuration that ships with the package.

    Attributes:
        name: by which it is found.
        path: its file.
        summary: first sentence of the comment at the head of the file.
    """

    name: str
    path: Path
    summary: str


def named_configs() -> list[NamedConfig]:
    """Return the configurations that ship with the package, by name.

    Raises:
        ConfigurationError: the package was installed without them.
    """
    folder = find_resource("config", "training")
    found = []
    for path in sorted(folder.rglob("*.yaml"), key=lambda path: path.stem):
        if path.parent.name == PARTS:
            continue
        found.append(NamedConfig(path.stem, path, _summary(path)))
    return found


def _summary(path: Path) -> str:
    """Return the first sentence of the comment at the head of a file, which may span lines."""
    lines = path.read_text(encoding="utf-8").splitlines()
    comment = itertools.takewhile(lambda line: line.startswith("# "), lines)
    text = " ".join(line.removeprefix("#").strip() for line in comment)
    return text.partition(". ")[0].rstrip(".")


def config_names() -> list[str]:
    """Return the names of the configurations, for the completion of a command line."""
    return [config.name for config in named_configs()]


def find_config(given: str | Path) -> Path:
    """Return the file of a configuration.

    Args:
        given: a file, or the name of a configuration that ships with the package; also its path
            below the folder where they ship, with or without the suffix.

    Raises:
        ConfigurationError: it is neither.
    """
    path = user_path(given)
    if path.is_file():
        return path
    configs = named_configs()
    known = {config.name: config.path for config in configs}
    for config in configs:
        below = config.path.relative_to(find_resource("config", "training"))
        known |= dict.fromkeys((str(below), str(below.with_suffix("")), below.name), config.path)
    if str(given) in known:
        return known[str(given)]
    if path.suffix not in (".yaml", ".yml") and len(path.parts) == 1:
        raise ConfigurationError(
            f"the configuration is {str(given)!r}, expected a YAML file or one of "
            + ", ".join(config.name for config in configs)
        )
    return path
