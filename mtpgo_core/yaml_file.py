# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""YAML files that users write: configurations, and small files that come with data.

The latter are read with limits and with errors that name the line.

A few hundred bytes of YAML can stand for more values than any memory holds, by aliases of aliases,
and such files are passed on like the data that they belong to. So there are no aliases here.
"""

from __future__ import annotations

import functools
import re
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.whole_file import read_regular

LARGEST_FILE = 1 << 16
"""Bytes of the largest file that is read; chosen, far above any list of classes or columns, and
read within a second."""

_DEEPEST = 20
"""Most levels of lists and mappings in each other; chosen, far above those of any such file."""

_LONGEST_PROBLEM = 200
"""Most characters that are told of PyYAML's reason, which may repeat the file; chosen."""

_LONGEST_NUMBER = 100
"""Most characters of a whole number; chosen, above those of 64 bits in any form."""

_POWER_OF_TEN = re.compile(r"[-+]?(\d[\d_]*(\.[\d_]*)?|\.\d[\d_]*)[eE][-+]?\d+$")
"""A number as YAML 1.2 and JSON have it; in YAML 1.1, and so in PyYAML, ``1e-3`` is a text."""


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
            return yaml.compose(content, _loaders()[1])
        return yaml.load(content, _loaders()[1])
    except Exception as error:  # A value that is not of its tag fails PyYAML in many ways.
        mark = getattr(error, "problem_mark", None)
        place = f", line {mark.line + 1}" if mark is not None else ""
        problem = getattr(error, "problem", None)
        if isinstance(error, yaml.reader.ReaderError | UnicodeDecodeError):
            problem = "it is not text in UTF-8"
        elif problem is None:
            problem = f"a value is not of its kind ({error})"
        problem = " ".join(str(problem).split())[:_LONGEST_PROBLEM]
        raise ConfigurationError(f"{path}{place} cannot be read as YAML: {problem}") from error


def parse_yaml(text: str) -> Any:
    """Return what a text of YAML holds: a configuration of the user's own, aliases included.

    Unlike in YAML 1.1, ``1e-3`` is a number, and a key that is given twice is an error: one of
    the two values would be lost without a message.

    Raises:
        Exception: it is no YAML; a value that is not of its tag fails PyYAML in many ways.
    """
    import yaml

    return yaml.load(text, _loaders()[0])


def dump_yaml(value: Any, *, one_line: bool = False) -> str:
    """Return plain values as YAML from which :func:`parse_yaml` reads the same.

    Args:
        value: the values.
        one_line: without line breaks, mappings by their keys; else in the order that they have.
    """
    import yaml

    if not one_line:
        return yaml.dump(value, Dumper=_dumper(), sort_keys=False)
    text = yaml.dump(value, Dumper=_dumper(), default_flow_style=True, width=10**6)
    return text.strip().removesuffix("...").strip()  # the mark of the document's end


@functools.cache
def _dumper() -> Any:
    """Return PyYAML's safe dumper, which quotes a text that would be read as a number."""
    import yaml

    class Dumper(yaml.SafeDumper):
        pass

    Dumper.add_implicit_resolver("tag:yaml.org,2002:float", _POWER_OF_TEN, list("-+.0123456789"))
    return Dumper


@functools.cache
def _loaders() -> tuple[Any, Any]:
    """Return two of PyYAML's safe loaders: of configurations, and of files that come with data.

    Both refuse a key that is given twice and deep nesting; the second aliases and endless numbers.
    """
    import yaml

    class Loader(yaml.SafeLoader):
        depth = 0

        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.depth > _DEEPEST:
                problem = f"more than {_DEEPEST} levels of lists and mappings"
                place = self.peek_event().start_mark
                raise yaml.composer.ComposerError(None, None, problem, place)
            self.depth += 1
            node = super().compose_node(parent, index)
            self.depth -= 1
            return node

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            seen: set[tuple[str, str]] = set()
            for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
                name = (key.tag, key.value) if isinstance(key, yaml.ScalarNode) else None
                if name in seen:
                    problem = f"the key {key.value!r} is given a second time"
                    raise yaml.constructor.ConstructorError(None, None, problem, key.start_mark)
                if name is not None:
                    seen.add(name)
            return super().construct_mapping(node, deep)

    Loader.add_implicit_resolver("tag:yaml.org,2002:float", _POWER_OF_TEN, list("-+.0123456789"))

    class PlainLoader(Loader):
        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                problem = "an alias (*name), expected its content in full"
                place = self.peek_event().start_mark
                raise yaml.composer.ComposerError(None, None, problem, place)
            return super().compose_node(parent, index)

        def construct_yaml_int(self, node: Any) -> int:
            if len(node.value) > _LONGEST_NUMBER:
                problem = f"a number of more than {_LONGEST_NUMBER} characters"
                raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)
            return int(super().construct_yaml_int(node))

    PlainLoader.add_constructor("tag:yaml.org,2002:int", PlainLoader.construct_yaml_int)
    return Loader, PlainLoader
