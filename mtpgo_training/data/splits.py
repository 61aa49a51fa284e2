# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Splits of recordings into train, validation and test, by recording or by time, never by track.

With ``data.split: recording`` a recording has one use. With ``time`` each is divided into blocks
of ``data.block_s``, the blocks of all recordings are assigned by the fractions, and neighbours of
the same use are joined again. With ``end`` the recordings of each directory, one after the other,
begin with those to train on and end with those of validation and test. At a border between two
uses a whole window is left out, so no instant is part of windows of two uses, their pasts and
futures included. Each part is a separate recording, without a past before its first frame.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.readers.recording_parts import part_name
from mtpgo_training.data.recording import Recording


@dataclass(frozen=True)
class NamedRecording:
    """A recording and its directory.

    Attributes:
        source: last part of the directory's name.
        recording: the recording, or the part of one that a block of time holds.
        part_of: name of the whole recording, where this is a part.
    """

    source: str
    recording: Recording
    part_of: str = ""

    @property
    def name(self) -> str:
        """``source/name``, unique among the recordings of a training."""
        return f"{self.source}/{self.recording.name}"

    def is_named(self, names: Sequence[str]) -> bool:
        """Return whether one of the names is its own, with its source or without."""
        return self.name in names or self.recording.name in names

    @property
    def whole(self) -> str:
        """Name of the whole recording."""
        return self.part_of or self.recording.name


@dataclass(frozen=True)
class Splits:
    """The recordings by use."""

    train: tuple[NamedRecording, ...]
    validation: tuple[NamedRecording, ...]
    test: tuple[NamedRecording, ...]

    def describe(self) -> list[dict[str, str]]:
        """Return name, source, layout, hash of the files and use (``split``) of each recording."""
        return [
            {
                "name": item.recording.name,
                "source": item.source,
                "layout": item.recording.layout,
                "sha256": item.recording.sha256,
                "split": use,
            }
            for use in USES
            for item in getattr(self, use)
        ]


USES = ("train", "validation", "test")

SHORTEST_PART = 1.5
"""Shortest part of a recording divided by ``data.split: end`` (windows); chosen: a half is left
out at its border, and what remains has a whole window."""


def split(
    recordings: Sequence[NamedRecording], data: DataConfig, seed: int, guard_s: float = 8.0
) -> Splits:
    """Assign each recording, or each block of time, to its use.

    Args:
        recordings: all recordings.
        data: the section ``data`` of the configuration.
        seed: seed of the draw.
        guard_s: length of a whole window, past and future (s); left out at every border between
            two uses within a recording.

    Raises:
        ConfigurationError: a name without a recording, a recording with two uses, or nothing to
            train on or to validate with.
    """
    _check_weights(recordings, data)
    if data.split == "time":
        splits = _by_time(recordings, data, seed, guard_s)
    elif data.split == "end":
        splits = _by_end(recordings, data, guard_s)
    else:
        splits = _by_recording(recordings, data, seed)
    for use in ("train", "validation"):
        if not getattr(splits, use):
            what = "recording"
            if data.split == "time":
                what = f"block of {data.block_s:g} s (data.block_s)"
            elif data.split == "end":
                what = f"part of at least {SHORTEST_PART * guard_s:g} s (data.split is 'end')"
            raise ConfigurationError(
                f"no {what} is left for data.{use} out of {len(recordings)} recordings, "
                "expected at least 1"
            )
    return splits


def _by_recording(recordings: Sequence[NamedRecording], data: DataConfig, seed: int) -> Splits:
    chosen = {use: _find(recordings, getattr(data, use), f"data.{use}") for use in USES}
    for first, second in (("train", "validation"), ("train", "test"), ("validation", "test")):
        both = chosen[first] & chosen[second]
        if both:
            raise ConfigurationError(
                f"the recording {recordings[min(both)].name} is in data.{first} and in "
                f"data.{second}, expected one use"
            )
    rest = set(range(len(recordings))) - chosen["test"] - chosen["validation"]
    free = sorted(rest - chosen["train"])
    drawn = [free[i] for i in np.random.default_rng(seed).permutation(len(free))]
    wanted = {
        use: 0 if getattr(data, use) else _count(getattr(data, f"{use}_fraction"), len(free))
        for use in ("validation", "test")
    }
    to_train = 0 if chosen["train"] else 1  # of those that no list names, left to train on
    for use, count in wanted.items():
        count = max(0, min(count, len(drawn) - to_train))
        chosen[use] |= set(drawn[:count])
        drawn = drawn[count:]
        rest -= chosen[use]
    chosen["train"] = chosen["train"] or rest
    return Splits(**{use: tuple(recordings[i] for i in sorted(chosen[use])) for use in USES})


def _count(fraction: float, available: int) -> int:
    """Return how many recordings are drawn: at least one if the fraction is above 0."""
    return max(1, round(fraction * available)) if fraction > 0.0 else 0


def _by_time(
    recordings: Sequence[NamedRecording], data: DataConfig, seed: int, guard_s: float
) -> Splits:
    """Assign the blocks of all recordings so that the fractions hold for their total time."""
    blocks = [
        (r, begin, end)
        for r, item in enumerate(recordings)
        for begin, end in _blocks(item.recording.duration_s, data.block_s)
    ]
    left = {use: getattr(data, f"{use}_fraction") for use in ("validation", "test")}
    total = sum(end - begin for _, begin, end in blocks)
    left = {use: fraction * total for use, fraction in left.items()}
    use_of: dict[tuple[int, float], str] = {}
    for i in np.random.default_rng(seed).permutation(len(blocks)):
        r, begin, end = blocks[i]
        use = max(left, key=lambda name: left[name])
        # A block is assigned to a use that lacks more than half of it; the first one always is.
        fits = left[use] > 0.5 * (end - begin) or (left[use] > 0.0 and use not in use_of.values())
        use_of[r, begin] = use if fits else "train"
        if fits:
            left[use] -= end - begin
    parts: dict[str, list[NamedRecording]] = {use: [] for use in USES}
    for r, item in enumerate(recordings):
        mine = [(begin, end, use_of[k, begin]) for k, begin, end in blocks if k == r]
        for part, use in _parts(item, mine, guard_s):
            parts[use].append(part)
    return Splits(**{use: tuple(parts[use]) for use in USES})


def _by_end(recordings: Sequence[NamedRecording], data: DataConfig, guard_s: float) -> Splits:
    """Assign the beginning of each directory's recordings to training, the end to the others."""
    parts: dict[str, list[NamedRecording]] = {use: [] for use in USES}
    validation, test = data.validation_fraction, data.test_fraction
    for source in dict.fromkeys(item.source for item in recordings):
        own = [item for item in recordings if item.source == source]
        total_s = sum(item.recording.duration_s for item in own)
        begins = {
            "train": 0.0,
            "validation": max(0.0, 1.0 - validation - test) * total_s,
            "test": (1.0 - test) * total_s,
        }
        before_s = 0.0
        for item in own:
            duration_s = item.recording.duration_s
            blocks = _blocks_by_use(
                {use: begin - before_s for use, begin in begins.items()},
                duration_s,
                SHORTEST_PART * guard_s,
            )
            for part, use in _parts(item, blocks, guard_s):
                parts[use].append(part)
            before_s += duration_s
    return Splits(**{use: tuple(parts[use]) for use in USES})


def _blocks_by_use(
    begins: Mapping[str, float], duration_s: float, shortest_s: float
) -> list[tuple[float, float, str]]:
    """Return begin, end and use of the blocks of a recording, of which none is too short.

    Args:
        begins: where each use begins, in order and from the begin of the recording (s).
        duration_s: of the recording (s).
        shortest_s: shortest block; a recording of less than two has one use (s).
    """
    ends = [*list(begins.values())[1:], math.inf]
    bounds: list[tuple[float, float, str]] = []
    for (use, begin), end in zip(begins.items(), ends, strict=True):
        low, high = _moved(begin, duration_s, shortest_s), _moved(end, duration_s, shortest_s)
        if high > low or (duration_s == 0.0 and begin <= 0.0 < end):
            bounds.append((low, high, use))
    return bounds


def _moved(border_s: float, duration_s: float, shortest_s: float) -> float:
    """Return a border within a recording, moved so that no block beside it is too short (s)."""
    if border_s <= 0.0 or border_s >= duration_s:
        return min(max(border_s, 0.0), duration_s)
    if duration_s < 2.0 * shortest_s:
        return 0.0 if border_s < 0.5 * duration_s else duration_s
    return min(max(border_s, shortest_s), duration_s - shortest_s)


def _blocks(duration_s: float, block_s: float) -> list[tuple[float, float]]:
    """Return begin and end of the blocks of a recording (s); the last one includes the rest."""
    begins = [n * block_s for n in range(max(1, round(duration_s / block_s)))]
    return list(zip(begins, [*begins[1:], duration_s], strict=True))


def window_s(history: HistoryConfig, horizon_steps: int) -> float:
    """Return the length of a window, past and future (s)."""
    return (history.steps - 1 + horizon_steps) * history.dt_s


def _parts(
    item: NamedRecording, blocks: Sequence[tuple[float, float, str]], guard_s: float
) -> Iterator[tuple[NamedRecording, str]]:
    """Yield the parts of a recording, neighbours of the same use joined, without the guards."""
    duration_s = item.recording.duration_s
    joined: list[tuple[float, str]] = []
    for begin, _, use in blocks:
        if not joined or joined[-1][1] != use:
            joined.append((begin, use))
    if len(joined) == 1:
        yield item, joined[0][1]
        return
    for n, (begin, use) in enumerate(joined):
        last = n + 1 == len(joined)
        start_s = begin + 0.5 * guard_s if n else 0.0
        end_s = duration_s if last else joined[n + 1][0] - 0.5 * guard_s
        if end_s <= start_s:
            continue
        part = item.recording.between(start_s, end_s)
        name = part_name(item.recording.name, start_s, end_s)
        if len(part):
            part = dataclasses.replace(part, name=name)
            yield dataclasses.replace(item, recording=part, part_of=item.whole), use


def _check_weights(recordings: Sequence[NamedRecording], data: DataConfig) -> None:
    """Refuse a key of ``source_weight`` that names a recording its directory does not have.

    A directory that was not given is allowed: one configuration may serve several data sets.
    """
    known = {name for item in recordings for name in (item.name, f"{item.source}/{item.whole}")}
    sources = {item.source for item in recordings}
    for name in data.source_weight:
        source = name.split("/", 1)[0]
        if "/" in name and source in sources and name not in known:
            raise ConfigurationError(
                f"data.source_weight names {name!r}, expected one of "
                + ", ".join(sorted(other for other in known if other.startswith(f"{source}/")))
            )


def _find(recordings: Sequence[NamedRecording], names: Sequence[str], where: str) -> set[int]:
    found: set[int] = set()
    for name in names:
        matches = {i for i, item in enumerate(recordings) if item.is_named((name,))}
        if not matches:
            raise ConfigurationError(
                f"{where} names {name!r}, expected one of " + ", ".join(r.name for r in recordings)
            )
        found |= matches
    return found
