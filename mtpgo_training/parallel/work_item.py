# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One item of many: what becomes of it where it is worked on."""

from __future__ import annotations

import logging
import pickle
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from mtpgo_core.errors import ConfigurationError, ModelFileError, MtpgoError

LOG = logging.getLogger("mtpgo")


class WorkItem(Protocol):
    """What a pool works on; it can be pickled."""

    @property
    def name(self) -> str:
        """Name of the item in what is reported of it."""


@dataclass(frozen=True)
class Failure:
    """An item that could not be worked on.

    Attributes:
        name: the item's.
        reason: one sentence.
    """

    name: str
    reason: str

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}"


@dataclass
class Outcome:
    """What became of an item in another process.

    Attributes:
        result: what the function returned, or a :class:`Failure`.
        remarks: the warnings that were logged meanwhile.
        took_s: how long it took (s).
    """

    result: Any
    remarks: list[str] = field(default_factory=list)
    took_s: float = 0.0


def attempt(function: Callable[[Any], Any], item: WorkItem) -> Any:
    """Return the function's result for an item, or why there is none.

    What is wrong for every item is raised: the configuration, a model, a library that is missing.
    """
    try:
        return function(item)
    except (ConfigurationError, ModelFileError, ImportError):
        raise
    except MtpgoError as error:
        return Failure(item.name, str(error))
    except Exception as error:
        # One odd file among thousands must not end hours of work, even where the fault is ours.
        return Failure(item.name, f"unexpected {type(error).__name__}: {error}")


def attempt_elsewhere(pickled: bytes) -> list[Outcome]:
    """Return the outcome of each item, with the warnings that would be lost in another process.

    Args:
        pickled: function and items. They are read here, where a module that is missing is an
            error of this call and not of the connection.
    """
    function, items = pickle.loads(pickled)
    return [_with_remarks(function, item) for item in items]


def _with_remarks(function: Callable[[Any], Any], item: WorkItem) -> Outcome:
    kept = _Remarks()
    LOG.addHandler(kept)
    propagate, LOG.propagate = LOG.propagate, False
    begin_s = time.monotonic()
    try:
        result = attempt(function, item)
        return Outcome(result, kept.lines, time.monotonic() - begin_s)
    finally:
        LOG.propagate = propagate
        LOG.removeHandler(kept)


class _Remarks(logging.Handler):
    """Keeps warnings."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())
