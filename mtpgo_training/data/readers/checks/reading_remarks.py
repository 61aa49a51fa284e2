# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Remarks: warnings of the readers that are stored in the cache and repeated from there.

A remark names what was left out or is odd, such as rows without a position. It is relevant for
every use of the recordings, whether the files are read now or come from the cache.
"""

from __future__ import annotations

import contextlib
import json
import logging
from collections.abc import Iterable, Iterator, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

R = TypeVar("R")

_log = logging.getLogger("mtpgo")

_kept: ContextVar[list[str] | None] = ContextVar("kept_remarks", default=None)
"""Remarks said so far on what is being read, None where they are not kept."""


def remark(sentence: str) -> None:
    """Say a sentence about files that are being read, once for all that is read together.

    Args:
        sentence: begins with the file, as it was named.
    """
    kept = _kept.get()
    if kept is not None:
        if sentence in kept:
            return
        kept.append(sentence)
    _log.warning("mtpgo: %s", sentence)


def keep(sentence: str) -> None:
    """Keep a sentence about files that are being read, which another part has said."""
    kept = _kept.get()
    if kept is not None and sentence not in kept:
        kept.append(sentence)


@contextlib.contextmanager
def keeping(said: list[str]) -> Iterator[None]:
    """Keep the remarks made within a block in a list, and in the list of a block around it."""
    token = _kept.set(said)
    try:
        yield
    finally:
        _kept.reset(token)
        around = _kept.get()
        if around is not None:
            around += [sentence for sentence in said if sentence not in around]


def keeping_all(items: Iterable[R], said: list[str]) -> Iterator[R]:
    """Yield items, and keep the remarks made while each of them is made in a list."""
    iterator = iter(items)
    while True:
        with keeping(said):
            try:
                item = next(iterator)
            except StopIteration:
                return
        yield item


def packed_remarks(said: Sequence[str], files: Sequence[Path]) -> NDArray[np.uint8]:
    """Return remarks as a column, for :func:`say_again`.

    Args:
        said: the sentences.
        files: the files that they are about: where these are may have changed until then.
    """
    rows: list[tuple[int | None, str]] = []
    for sentence in said:
        names = enumerate(_names(files))
        begins = [(len(name), i) for i, name in names if sentence.startswith(name)]
        length, which = max(begins, default=(0, -1))
        rows.append((which if begins else None, sentence[length:]))
    return np.frombuffer(json.dumps(rows).encode(), dtype=np.uint8)


def say_again(column: NDArray[np.uint8], files: Sequence[Path]) -> None:
    """Say the remarks in a column of :func:`packed_remarks`.

    Args:
        column: the column.
        files: the same files, wherever they are now.
    """
    names = _names(files)
    for which, rest in json.loads(column.tobytes()):
        remark(rest if which is None else names[which] + rest)


def _names(files: Sequence[Path]) -> list[str]:
    """Return the names with which a sentence may begin: the files, and the folder of a bag."""
    return [*map(str, files), *(str(path.parent) for path in files[:1])]
