# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is fuzzed: a function of bytes, with valid inputs to start from.

A file ``fuzz_*.py`` in this folder has a function ``targets() -> list[FuzzTarget]``. ``make fuzz``
and the short test in the suite find it by its name.
"""

from __future__ import annotations

import importlib
import random
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import MtpgoError

HANG_S = 1.0
"""An input that needs more processor time than this counts as a hang (s)."""

LARGEST_INPUT = 1 << 16
"""Largest input that is tried (bytes)."""

_INTERESTING = (
    b"\x00",
    b"\xff",
    b"\x7f",
    b"\x80",
    b"\xff\xff\xff\xff",
    b"\x00\x00\x00\x80",
    b"\xff\xff\xff\x7f",
    b"\x00\x00\xc0\x7f",  # NaN in float32
    b"\x00\x00\x00\x00\x00\x00\xf8\x7f",  # NaN in float64
    b"\x00\x00\x00\x00\x00\x00\xf0\x7f",  # infinity in float64
    b"\xff\xff\xff\xff\xff\xff\xef\x7f",  # the largest float64
    b"-1",
    b"nan",
    b"1e999",
    b"99999999999999999999",
    b"\n",
    b",",
    b"{",
    b'"',
)


@dataclass(frozen=True)
class FuzzTarget:
    """A function that must cope with any bytes.

    Attributes:
        name: letters, digits and ``_``.
        run: returns, or raises one of ``refused``; everything else is a finding.
        seeds: returns valid inputs, which ``run`` accepts without an exception.
        refused: the exceptions by which an input is refused.
    """

    name: str
    run: Callable[[bytes], None]
    seeds: Callable[[], Sequence[bytes]]
    refused: tuple[type[Exception], ...] = (MtpgoError,)

    def check(self, data: bytes) -> None:
        """Run one input.

        Raises:
            Exception: a finding.
        """
        try:
            self.run(data)
        except self.refused as error:
            if "\n" in str(error) or not str(error).strip():
                raise AssertionError(f"not one sentence: {str(error)!r}") from error


def processor_time(target: FuzzTarget, data: bytes) -> float:
    """Return the processor time that one input needs (s)."""
    start = time.process_time()
    target.check(data)
    return time.process_time() - start


def mutated(data: bytes, draw: random.Random) -> bytes:
    """Return the bytes with up to eight changes: bits, known bad values, cuts, copies."""
    out = bytearray(data)
    for _ in range(draw.randint(1, 8)):
        at = draw.randrange(len(out) + 1)
        kind = draw.randrange(6)
        if kind == 0 and at < len(out):
            out[at] ^= 1 << draw.randrange(8)
        elif kind == 1 and at < len(out):
            out[at] = draw.randrange(256)
        elif kind == 2:
            value = draw.choice(_INTERESTING)
            out[at : at + len(value)] = value
        elif kind == 3:
            out[at:at] = draw.choice(_INTERESTING)
        elif kind == 4:
            del out[at : at + draw.choice((1, 2, 4, 8, 64, len(out)))]
        else:
            first = draw.randrange(len(out) + 1)
            out[at:at] = out[first : first + draw.choice((1, 4, 16, 256))]
    return bytes(out[:LARGEST_INPUT])


def all_targets() -> dict[str, FuzzTarget]:
    """Return the targets of all files ``fuzz_*.py`` in this folder, by name.

    Raises:
        ValueError: two targets have the same name.
    """
    found: dict[str, FuzzTarget] = {}
    for path in sorted(Path(__file__).parent.glob("fuzz_*.py")):
        if path.stem == Path(__file__).stem:
            continue
        for target in importlib.import_module(path.stem).targets():
            if target.name in found:
                raise ValueError(f"two fuzz targets have the name {target.name}")
            found[target.name] = target
    return found
