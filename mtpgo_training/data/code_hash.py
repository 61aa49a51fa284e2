# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Hash over what functions compute, for a cache that a changed formula must empty.

The hash is over syntax trees: from a function, every function, class and constant of this project
that it uses is followed, by the names in its source. What does not change a result is left out:
comments, docstrings, annotations, positions in a file and the names of modules. So moving a
function, renaming its file or editing its documentation keeps the hash, and another number or
formula changes it. Syntax trees differ between versions of Python, and so does the hash.
"""

from __future__ import annotations

import ast
import dataclasses
import enum
import functools
import hashlib
import importlib
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

PACKAGES = ("models", "msg_adapters", "mtpgo_core", "mtpgo_training")
"""What is followed; the versions of other packages are not part of the hash."""

_PLAIN = (bool, int, float, complex, str, bytes, type(...), np.generic, np.dtype, re.Pattern)
"""Constants whose text says their value."""


def code_sha256(*roots: Callable[..., Any]) -> str:
    """Return the hash over the code of some callables and of all that they use.

    Args:
        roots: functions, also lambdas, partial functions and methods. Functions and classes among
            the variables of their closures are followed; data is not.
    """
    parts: set[bytes] = set()
    for root in roots:
        # A lambda lives for one call only; what it uses is remembered, as modules stay.
        description = _Description(_unwrapped(root))
        parts.add(description.sha256)
        parts.update(_followed_sha256(used) for used in description.used)
    return hashlib.sha256(b"".join(sorted(parts))).hexdigest()


@functools.cache
def _followed_sha256(start: Any) -> bytes:
    """Return the hash over a function or class and all that it uses."""
    parts = sorted({_describe(item).sha256 for item in followed(start)})
    return hashlib.sha256(b"".join(parts)).digest()


def followed(start: Any) -> set[Any]:
    """Return a function or class and all functions and classes of this project that it uses."""
    seen, waiting = {start}, [start]
    while waiting:
        new = _describe(waiting.pop()).used - seen
        seen |= new
        waiting += new
    return seen


@functools.cache
def _describe(item: Any) -> _Description:
    return _Description(item)


class _Description:
    """The code of one function or class.

    Attributes:
        used: functions and classes of this project that it uses.
        sha256: hash over its own code and the constants that it uses.
    """

    def __init__(self, item: FunctionType | type) -> None:
        self.used: set[Any] = set()
        self._words: list[str] = []
        if isinstance(item, FunctionType):
            scope = item.__globals__
            for cell in item.__closure__ or ():
                self._follow(_unwrapped(cell.cell_contents))
        else:
            scope = vars(sys.modules[item.__module__])
        block = _source_of(item)
        if block is not None:
            source = _Source(block)
            self._words.append(source.text)
            self._follow_names(source, scope)
        elif isinstance(item, FunctionType):
            code = item.__code__
            self._words.append(f"{code.co_code.hex()} {code.co_names}")
            self._add_value(code.co_consts)
            lambda_ = _Source("pass")
            lambda_.names.update(code.co_names)
            self._follow_names(lambda_, scope)
        self.sha256 = hashlib.sha256("\n".join(self._words).encode()).digest()

    def _follow_names(self, source: _Source, scope: dict[str, Any]) -> None:
        modules = [vars(importlib.import_module(name)) for name in source.imports]
        for name in sorted(source.names & scope.keys()):
            value = _unwrapped(scope[name])
            if isinstance(value, ModuleType):
                modules += [vars(value)] if _is_ours(value.__name__) else []
            elif not self._follow(value):
                self._words.append(name)
                self._add_value(value)
        for module in modules:
            for name in sorted((source.names | source.attributes) & module.keys()):
                self._follow(_unwrapped(module[name]))

    def _follow(self, value: Any) -> bool:
        """Note a function or class of this project; return whether it is one or another's."""
        if not isinstance(value, type | FunctionType):
            return False
        if _is_ours(value.__module__):
            self.used.add(value)
        return True

    def _add_value(self, value: Any) -> None:
        """Add a constant; of what is neither a plain value nor code, only its type."""
        value = _unwrapped(value)
        if self._follow(value):
            self._words.append(value.__name__)
        elif isinstance(value, np.ndarray):
            self._words.append(f"{value.dtype}{value.shape}{value.tobytes().hex()}")
        elif isinstance(value, enum.Enum):
            self._words.append(value.name)
            self._follow(type(value))
        elif isinstance(value, tuple | list):
            self._words.append(f"sequence {len(value)}")
            for entry in value:
                self._add_value(entry)
        elif isinstance(value, set | frozenset):
            self._words.append(f"set {sorted(map(repr, value))}")
        elif isinstance(value, dict):
            self._words.append(f"dict {len(value)}")
            for key, entry in value.items():
                self._words.append(repr(key))
                self._add_value(entry)
        elif dataclasses.is_dataclass(value) and _is_ours(type(value).__module__):
            self._follow(type(value))
            for field in dataclasses.fields(value):
                self._add_value(getattr(value, field.name))
        elif value is None or isinstance(value, _PLAIN):
            self._words.append(repr(value))
        else:
            self._words.append(type(value).__name__)


class _Source:
    """The syntax tree of a function or class.

    Attributes:
        text: the tree without what does not change a result.
        names: all names in it, those in annotations included.
        attributes: names after a dot.
        imports: modules of this project that it imports itself.
    """

    def __init__(self, block: str) -> None:
        self.names: set[str] = set()
        self.attributes: set[str] = set()
        self.imports: list[str] = []
        (tree,) = ast.parse(block).body
        # A node's children are in the queue of ast.walk before it is changed here.
        for node in ast.walk(tree):
            if isinstance(node, ast.Name):
                self.names.add(node.id)
            elif isinstance(node, ast.Attribute):
                self.attributes.add(node.attr)
            elif isinstance(node, ast.ImportFrom) and _is_ours(node.module):
                self.imports.append(str(node.module))
                self.names.update(alias.name for alias in node.names)
                node.module = ""
            elif isinstance(node, ast.AnnAssign):
                node.annotation = ast.Constant(None)
            elif isinstance(node, ast.arg):
                node.annotation = None
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                if ast.get_docstring(node, clean=False) is not None:
                    del node.body[0]
                if not isinstance(node, ast.ClassDef):
                    node.returns = None
        self.text = ast.dump(tree)


@functools.cache
def _lines_of(file: str) -> list[str]:
    return Path(file).read_text(encoding="utf-8").splitlines(keepends=True)


def _block(lines: Sequence[str], start: int) -> str:
    """Return the function or class that begins in a line, its decorators first, not indented."""
    indent = len(lines[start]) - len(lines[start].lstrip())
    block, body = [], False
    for line in lines[start:]:
        text = line.strip()
        ends = text and len(line) - len(line.lstrip()) <= indent and text[0] not in ")]}#"
        if body and ends:
            break
        block.append(line[indent:] or "\n")
        body = body or text.startswith(("def ", "class ", "async def "))
    return "".join(block)


def _source_of(item: FunctionType | type) -> str | None:
    """Return the source text of a function or class; None for a lambda or generated code."""
    if isinstance(item, FunctionType):
        if item.__name__ == "<lambda>":
            return None
        return _block(_lines_of(item.__code__.co_filename), item.__code__.co_firstlineno - 1)
    lines = _lines_of(str(sys.modules[item.__module__].__file__))
    head = re.compile(rf"class {item.__name__}\b")
    for start, line in enumerate(lines):
        if head.match(line):
            while start and lines[start - 1].startswith("@"):
                start -= 1
            return _block(lines, start)
    return None


def _is_ours(module: str | None) -> bool:
    return module is not None and module.partition(".")[0] in PACKAGES


def _unwrapped(value: Any) -> Any:
    """Return the function in a partial function, a bound method or a decorated function."""
    while True:
        if isinstance(value, functools.partial):
            value = value.func
        elif hasattr(value, "__func__"):
            value = value.__func__
        elif hasattr(value, "__wrapped__"):
            value = value.__wrapped__
        else:
            return value
