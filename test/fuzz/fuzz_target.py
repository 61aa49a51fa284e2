# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is fuzzed: a function of bytes, with valid inputs to start from.

A file ``fuzz_*.py`` in this folder has a function ``targets() -> list[FuzzTarget]``. ``make fuzz``
and the short test in the suite find it by its name.
"""

from __future__ import annotations

import atexit
import functools
import importlib
import random
import re
import shutil
import tempfile
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

_WORDS = (
    b"",
    b"0",
    b"-1",
    b"1.5",
    b"nan",
    b"-inf",
    b"1e999",
    b"1e308",
    b"1e-320",
    b"0x10",
    b"007",
    b"1_000",
    b"2147483648",
    b"9223372036854775808",
    b"99999999999999999999",
    b"true",
    b"no",
    b"null",
    b"2024-05-01T12:00:00Z",
    b"car",
    b"[]",
    b"{}",
    b"9" * 400,
    b"0x" + b"f" * 4000,
    b"!!bool",
    b"!!float",
    b"!!timestamp",
    b"&a",
    b"*a",
    b"<<",
    b"\\ud800",
    b"[" * 200,
    b'""',
    "\u00e9\u2028".encode(),
)
"""Words that take the place of others in a text."""

_MARKS = b"\n\r\t ,;:=#'\"|-+.[]{}()&*!?%@<>/\\\x00"
"""Characters with a meaning in the texts that are read."""

_TOKEN = re.compile(rb"[\w.+-]+")

_CHANGES = (1, 1, 1, 2, 2, 3, 4, 8)
"""How many changes an input gets, each with the same chance: one is often enough to be refused
at the first check, and what lies behind it should be reached as well."""


@dataclass(frozen=True)
class FuzzTarget:
    """A function that must cope with any bytes.

    Attributes:
        name: letters, digits and ``_``.
        run: returns, or raises one of ``refused``; everything else is a finding.
        seeds: returns valid inputs, which ``run`` accepts without an exception.
        refused: the exceptions by which an input is refused.
        text: the inputs are texts: most mutations keep them so.
    """

    name: str
    run: Callable[[bytes], None]
    seeds: Callable[[], Sequence[bytes]]
    refused: tuple[type[Exception], ...] = (MtpgoError,)
    text: bool = False

    def check(self, data: bytes) -> bool:
        """Run one input; return whether it was accepted.

        Raises:
            Exception: a finding.
        """
        try:
            self.run(data)
        except self.refused as error:
            if "\n" in str(error) or not str(error).strip():
                raise AssertionError(f"not one sentence: {str(error)!r}") from error
            return False
        return True

    def mutated(self, data: bytes, draw: random.Random) -> bytes:
        """Return a valid input with some changes."""
        if self.text and draw.randrange(8):
            return mutated_text(data, draw)
        return mutated(data, draw)


@functools.cache
def place(name: str) -> Path:
    """Return a folder for the files of a target, removed at the end."""
    folder = Path(tempfile.mkdtemp(prefix=f"fuzz_{name}_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def processor_time(target: FuzzTarget, data: bytes) -> float:
    """Return the processor time that one input needs (s)."""
    start = time.process_time()
    target.check(data)
    return time.process_time() - start


def mutated(data: bytes, draw: random.Random) -> bytes:
    """Return the bytes with up to eight changes: bits, known bad values, cuts, copies.

    Half of the results have the length of the original: in many files everything behind a place
    that moves is lost.
    """
    out = bytearray(data)
    kinds = draw.choice((3, 6))
    for _ in range(draw.choice(_CHANGES)):
        at = draw.randrange(len(out) + 1)
        kind = draw.randrange(kinds)
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


def mutated_text(data: bytes, draw: random.Random) -> bytes:
    """Return a text with up to eight changes of words, marks and lines."""
    out = data
    for _ in range(draw.choice(_CHANGES)):
        kind = draw.randrange(8)
        if kind < 4:
            out = _with_other_word(out, draw)
        elif kind == 4:
            at = draw.randrange(len(out) + 1)
            mark = draw.choice(_MARKS).to_bytes()
            out = out[:at] + mark + out[at + draw.randrange(2) :]
        else:
            lines = out.splitlines(keepends=True) or [b""]
            first, second = draw.randrange(len(lines)), draw.randrange(len(lines))
            if kind == 5:
                del lines[first]
            elif kind == 6:
                lines.insert(first, lines[second])
            else:
                lines[first], lines[second] = lines[second], lines[first]
            out = b"".join(lines)
    return out[:LARGEST_INPUT]


def _with_other_word(data: bytes, draw: random.Random) -> bytes:
    """Return a text with one word replaced, by a known bad one or by another one of the text."""
    words = list(_TOKEN.finditer(data))
    if not words:
        return draw.choice(_WORDS)
    old = draw.choice(words)
    new = draw.choice(_WORDS) if draw.randrange(2) else draw.choice(words)[0]
    return data[: old.start()] + new + data[old.end() :]


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
