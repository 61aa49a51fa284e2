# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Items and functions for pools, in a module that other processes can import."""

import logging
import os
import time
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError, RecordingError


@dataclass(frozen=True)
class Number:
    """An item."""

    value: int

    @property
    def name(self) -> str:
        return f"n{self.value}"


def work(item):
    """Square a number; some fail, each in a way of its own."""
    if item.value == 3:
        raise RecordingError("n3.csv ends within line 7")
    if item.value == 5:
        raise ZeroDivisionError("no such thing")
    if item.value == 6 and os.environ.get("DASK_PARENT") != str(os.getpid()):
        os._exit(9)
    if item.value == 7:
        logging.getLogger("mtpgo").warning("seven is odd")
    return item.value**2


@dataclass(frozen=True)
class Noted(Number):
    """An item whose end is noted in a folder."""

    folder: Path


def first_last(item):
    """Return the number, and how many were done before it; the first waits for two others."""
    while True:
        done = len(list(item.folder.iterdir()))
        if item.value or done >= 2:
            (item.folder / item.name).touch()
            return item.value, done
        time.sleep(0.01)


def refuse(item):
    raise ConfigurationError("the class map is unknown")
