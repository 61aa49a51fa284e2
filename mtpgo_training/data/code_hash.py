# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Hash over the code that functions run, for a cache that a changed formula must empty.

The hash is over the definitions (functions, classes and constants) of the modules in which the
functions are defined and of all modules of this project that these import, directly or not. What
does not change a result is left out: comments, docstrings, annotations, import lines, positions
and the names of modules. So moving a definition, renaming its file or editing its documentation
keeps the hash. A definition that no function calls counts as well if its module is imported: an
entry that is computed again costs time, one that is out of date would be wrong. Syntax trees
differ between versions of Python, and so does the hash.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

PACKAGES = ("models", "msg_adapters", "mtpgo_core", "mtpgo_training")
"""Packages that are followed; the versions of other packages are not part of the hash."""


def code_sha256(*functions: Callable[..., Any]) -> str:
    """Return the hash over the code of functions, lambdas or partial functions and of all it uses.

    Args:
        functions: where the computation starts; the data in a partial function does not count.
    """
    modules = imported_modules(_module_of(function) for function in functions)
    parts = set().union(*(_digests(module) for module in modules))
    return hashlib.sha256(b"".join(sorted(parts))).hexdigest()


def imported_modules(start: Iterable[str]) -> set[str]:
    """Return modules of this project and all modules of it that they import, directly or not."""
    seen: set[str] = set()
    waiting = list(start)
    while waiting:
        module = waiting.pop()
        if module not in seen and module.partition(".")[0] in PACKAGES and _tree(module):
            seen.add(module)
            waiting += _imports(module)
    return seen


def _module_of(function: Callable[..., Any]) -> str:
    while isinstance(function, functools.partial):
        function = function.func
    return function.__module__


@functools.cache
def _tree(module: str) -> ast.Module | None:
    """Return the syntax tree of a module, None where there is none of this name."""
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:  # a name that is imported from a module is not a module itself
        return None
    if spec is None or not spec.origin:
        return None
    return ast.parse(Path(spec.origin).read_text(encoding="utf-8"))


@functools.cache
def _imports(module: str) -> list[str]:
    """Return the names that a module imports, each as if it were a module."""
    found: list[str] = []
    for node in ast.walk(_tree(module) or ast.Module([], [])):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return found


@functools.cache
def _digests(module: str) -> frozenset[bytes]:
    """Return a hash for each definition of a module."""
    tree = _tree(module) or ast.Module([], [])
    texts = [ast.dump(_Bare().visit(statement)) for statement in _without_docstring(tree.body)]
    return frozenset(hashlib.sha256(text.encode()).digest() for text in texts)


def _without_docstring(body: list[ast.stmt]) -> list[ast.stmt]:
    """Return a body without bare strings: docstrings, and the texts below constants."""
    return [
        statement
        for statement in body
        if not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant))
    ]


class _Bare(ast.NodeTransformer):
    """Removes what does not change a result."""

    def visit(self, node: ast.AST) -> Any:
        if isinstance(node, ast.Import | ast.ImportFrom):
            return ast.Pass()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            node.body = _without_docstring(node.body) or [ast.Pass()]
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            node.returns = None
        elif isinstance(node, ast.arg):
            node.annotation = None
        elif isinstance(node, ast.AnnAssign):
            node.annotation = ast.Constant(None)
        return self.generic_visit(node)
