# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Excerpts of the code in a page, by the name of a function or class instead of line numbers.

A page asks for one with a comment on a line of its own, which displays that know nothing of it do
not show::

    <!-- code: models/ekf.py EkfCovariance.forward -->

A name that is not there is an error, so that a page cannot show code that has moved. pymdownx's
snippets were not used: they need markers in the code, or line numbers that do not stay right.
"""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

REQUEST = re.compile(r"^<!-- code: (?P<path>\S+\.py) (?P<name>[\w.]+) -->$", re.MULTILINE)
"""The comment that asks for an excerpt: file and name within it."""

Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


class ExcerptError(Exception):
    """A page asks for code that is not there."""


@dataclass(frozen=True)
class Excerpt:
    """A function or class of a file.

    Attributes:
        path: file, from the root of the repository.
        name: within the file, with dots.
        first_line: line of its ``def`` or ``class``, counted from 1.
        text: its source without decorators and docstrings, not indented.
    """

    path: str
    name: str
    first_line: int
    text: str


def requests_in(page: str) -> Iterator[tuple[str, str]]:
    """Yield path and name of every excerpt that a page asks for."""
    for match in REQUEST.finditer(page):
        yield match["path"], match["name"]


def excerpt(root: Path, path: str, name: str) -> Excerpt:
    """Return a function or class of a file.

    Args:
        root: of the repository.
        path: of the file, from the root.
        name: such as ``EkfCovariance.forward``; ``EkfCovariance`` for the whole class.

    Raises:
        ExcerptError: there is no such file, or no such name in it.
    """
    file = root / path
    if not file.is_file():
        raise ExcerptError(f"{path} is not a file, expected one to show {name} of")
    source = file.read_text(encoding="utf-8")
    found: ast.AST = ast.parse(source, path)
    for part in name.split("."):
        inside = ast.iter_child_nodes(found)
        parts = {node.name: node for node in inside if isinstance(node, Definition)}
        if part not in parts:
            raise ExcerptError(f"{path} has no {name}, expected one of {', '.join(parts)}")
        found = parts[part]
    assert isinstance(found, Definition)
    hidden = _docstring_lines(found)
    lines = source.splitlines()
    kept = [
        lines[number - 1]
        for number in range(found.lineno, (found.end_lineno or found.lineno) + 1)
        if number not in hidden
    ]
    return Excerpt(path, name, found.lineno, textwrap.dedent("\n".join(kept)).strip("\n"))


def _docstring_lines(top: Definition) -> set[int]:
    """Return the lines of the docstrings of a definition and of those in it."""
    hidden: set[int] = set()
    for node in ast.walk(top):
        if isinstance(node, Definition) and ast.get_docstring(node, clean=False) is not None:
            text = node.body[0]
            if len(node.body) > 1:  # a docstring alone is the body
                hidden |= set(range(text.lineno, (text.end_lineno or text.lineno) + 1))
    return hidden
