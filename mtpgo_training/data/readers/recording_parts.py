# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parts of recordings by name: ``01@60-116s`` is recording ``01`` from 60 s to 116 s.

A training that is split by time lists its parts under such names, so that they can be read again,
for instance to evaluate the blocks kept for the test.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.recording import Recording

_NAME = re.compile(r"(?P<whole>.+)@(?P<start>\d+(?:\.\d+)?)-(?P<end>\d+(?:\.\d+)?)s")


_ROUNDING_S = 0.5
"""A part may end this much later than its recording without a warning (s); chosen: ends are often
rounded to whole seconds."""


@dataclass(frozen=True)
class RecordingPart:
    """A part of a recording by time.

    Attributes:
        name: name of the part.
        whole: name of the recording.
        start_s: begin, from the recording's first frame (s).
        end_s: end, from the recording's first frame (s).
    """

    name: str
    whole: str
    start_s: float
    end_s: float

    @classmethod
    def from_name(cls, name: str) -> RecordingPart | None:
        """Return the part that ``name`` denotes, None for the name of a whole recording."""
        found = _NAME.fullmatch(name)
        if found is None:
            return None
        return cls(name, found["whole"], float(found["start"]), float(found["end"]))

    def of(self, recording: Recording) -> Recording:
        """Return this part of ``recording``, under the part's name."""
        return dataclasses.replace(recording.between(self.start_s, self.end_s), name=self.name)

    def may_be_in(self, unit: str) -> bool:
        """Return whether the files of the unit with this name may hold the recording."""
        return self.whole == unit or self.whole.startswith(f"{unit}-")


def part_name(whole: str, start_s: float, end_s: float) -> str:
    """Return the name of a part of a recording."""
    return f"{whole}@{start_s:.10g}-{end_s:.10g}s"


def span_of(name: str) -> tuple[float, float]:
    """Return begin and end of a part of a part of a recording, from the first frame of all (s).

    Args:
        name: of a part, of a part of one, or of a whole recording, which has no end.
    """
    part = RecordingPart.from_name(name)
    if part is None:
        return 0.0, math.inf
    start_s, end_s = span_of(part.whole)
    return start_s + part.start_s, min(start_s + part.end_s, end_s)


def share_time(name: str, other: str) -> bool:
    """Return whether two parts of one recording, by name, have some time in common."""
    (start_s, end_s), (other_start_s, other_end_s) = span_of(name), span_of(other)
    return start_s < other_end_s and other_start_s < end_s


def parts_in(names: Sequence[str]) -> list[RecordingPart]:
    """Return the parts among the names."""
    return [part for part in map(RecordingPart.from_name, names) if part is not None]


def cut_parts(
    recordings: Iterable[Recording], parts: Sequence[RecordingPart], where: Path
) -> Iterator[Recording]:
    """Yield the parts of the recordings, in the order of the recordings.

    Raises:
        RecordingError: a recording is missing, or a part has no road user.
    """
    missing = {part.name: part for part in parts}
    seen = []
    for recording in recordings:
        seen.append(recording.name)
        for part in parts:
            if part.whole != recording.name:
                continue
            missing.pop(part.name, None)
            cut = part.of(recording)
            if not len(cut):
                raise RecordingError(
                    f"{where}, recording {recording.name}: no road user from {part.start_s:g} "
                    f"to {part.end_s:g} s, it lasts {recording.duration_s:g} s"
                )
            if _ROUNDING_S < part.end_s - recording.duration_s < math.inf:
                remark(
                    f"{where}, recording {recording.name}: the part up to {part.end_s:g} s ends "
                    f"with the recording, at {recording.duration_s:g} s"
                )
            yield cut
    if missing:
        raise RecordingError(
            f"{where} has no recording {next(iter(missing.values())).whole!r}, it has "
            + (", ".join(seen) or "none of that name")
        )
