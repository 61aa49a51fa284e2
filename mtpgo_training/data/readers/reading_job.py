# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files of a directory that are read independently of the others, here or in another process."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtpgo_core.errors import RecordingError
from mtpgo_core.history.odd_input import described
from mtpgo_training.data.readers.checks.layout_clues import other_layout_of
from mtpgo_training.data.readers.checks.reading_remarks import (
    keeping,
    keeping_all,
    packed_remarks,
    remark,
    say_again,
)
from mtpgo_training.data.readers.checks.stream_clues import stream_clues
from mtpgo_training.data.readers.checks.unit_clues import impossible_velocities, unit_clue
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.recording_parts import RecordingPart, cut_parts
from mtpgo_training.data.recorded_lanes import with_lanes
from mtpgo_training.data.recording import Columns, Recording
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.recording_columns import pack, unpack


@dataclass(frozen=True)
class ReadingJob:
    """Files that are read independently of the others of a directory.

    Attributes:
        units: the files.
        options: what else is said about them.
        directory: where they are.
        parts: the parts by time that are wanted of them, none for all.
    """

    units: tuple[Unit, ...]
    options: ReadingOptions
    directory: Path
    parts: tuple[RecordingPart, ...] = ()

    @property
    def name(self) -> str:
        """Name of the file, or of the parts."""
        return ", ".join(p.name for p in self.parts) or ", ".join(u.name for u in self.units)

    @property
    def names(self) -> list[str]:
        """Names of the recordings, as far as they are known before the files are read."""
        return [one.name for one in self.parts or self.units]

    def read(self, cache: RecordingCache | None = None) -> Iterator[Recording]:
        """Yield the recordings, one after the other; say what was odd.

        Args:
            cache: cache of recordings that were read before.

        Raises:
            RecordingError: a defect of a file.
        """
        whole = (r for unit in self.units for r in _read_unit(unit, self.options, cache))
        yield from cut_parts(whole, self.parts, self.directory) if self.parts else whole

    def facts(self) -> list[dict[str, Any]]:
        """Return what determines the recordings besides the code, as JSON can write it.

        Raises:
            RecordingError: a file cannot be read.
        """
        more = [{"part": part.name} for part in self.parts]
        if self.options.lanes is not None:
            how = dataclasses.asdict(self.options.lane_options)
            more.append({"lanes": self.options.lanes.sha256, **how})
        return [_facts(unit, self.options) for unit in self.units] + more


def _read_unit(
    unit: Unit, options: ReadingOptions, cache: RecordingCache | None
) -> Iterator[Recording]:
    """Yield the recordings of a unit, from the cache if they are there; say what was odd."""
    counts: Counter[str] = Counter()
    clue = ""
    doubts: list[str] = []
    for sentence in unit.remarks:
        remark(sentence)
    for recording in _recordings_of(unit, options, cache):
        counts.update(recording.counts)
        counts["too_fast"] += int(impossible_velocities(recording).sum())
        if not clue:  # one of many is enough
            clue = unit_clue(recording)
            if clue:
                remark(f"{unit.layout} {unit.name}, recording {recording.name}: {clue}")
        if not doubts:
            doubts = stream_clues(recording)
            for doubt in doubts:
                remark(f"{unit.layout} {unit.name}, recording {recording.name}: {doubt}")
        yield recording if options.lanes is None else with_lanes(recording, options.lanes)
    if described(counts):
        remark(f"{unit.layout} {unit.name}: {described(counts)}")


def _recordings_of(
    unit: Unit, options: ReadingOptions, cache: RecordingCache | None
) -> Iterable[Recording]:
    said: list[str] = []
    if cache is None:
        return keeping_all(_read(unit), said)

    def made() -> Columns:
        columns = pack(keeping_all(_read(unit), said))
        return {**columns, "remarks": packed_remarks(said, unit.files)}

    facts = {"what": "recordings", **_facts(unit, options)}
    columns = cache.entry(facts, made, code=(unit.read, pack, packed_remarks))
    with keeping(said):
        say_again(columns["remarks"], unit.files)
    return unpack(columns)


def _read(unit: Unit) -> Iterator[Recording]:
    """Yield the recordings of a unit.

    Raises:
        RecordingError: a defect of a file; a file of another layout is called so.
    """
    try:
        yield from unit.read()
    except RecordingError as error:
        # A plain table may describe the columns of any layout, and the files of a bag be missing.
        tells_nothing = unit.layout == "table" or not unit.files
        other = "" if tells_nothing else other_layout_of(unit.files[0], unit.layout)
        if not other or repr(other) in str(error):
            raise
        raise RecordingError(f"{error}; it is of the layout {other!r}") from error


def _facts(unit: Unit, options: ReadingOptions) -> dict[str, Any]:
    return {
        "layout": unit.layout,
        "name": unit.name,
        "sha256": unit.sha256,
        "classes": options.classes.facts(),
        "settings": dict(unit.settings),
    }
