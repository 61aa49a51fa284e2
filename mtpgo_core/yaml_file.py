# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small YAML files that users write, read with a limit and with errors that name the line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.whole_file import read_regular

LARGEST_FILE = 1 << 18
"""Bytes of the largest file that is read; chosen, far above any list of classes or columns."""


def read_yaml(path: Path, expected: str, *, as_node: bool = False) -> Any:
    """Return what a YAML file holds.

    Args:
        path: the file.
        expected: what kind of file it should be, for the error of one that is too large.
        as_node: return the root node of YAML's syntax, whose values are as they are written, and
            not the values; None of an empty file.

    Raises:
        ConfigurationError: the file cannot be read, is too large or is no YAML, or PyYAML is not
            installed.
    """
    try:
        content = read_regular(path, LARGEST_FILE)
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be read: {error.strerror}") from error
    if len(content) > LARGEST_FILE:
        raise ConfigurationError(
            f"{path} is larger than {LARGEST_FILE} bytes, expected {expected}"
        )
    try:
        import yaml
    except ModuleNotFoundError:
        raise ConfigurationError(
            f"{path} needs the Python module 'yaml' (PyYAML), which is not installed"
        ) from None
    try:
        if as_node:
            return yaml.compose(content, yaml.SafeLoader)
        return yaml.safe_load(content)
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f", line {mark.line + 1}" if mark is not None else ""
        problem = getattr(error, "problem", None) or "it is not text in UTF-8"
        raise ConfigurationError(f"{path}{place} cannot be read as YAML: {problem}") from error
