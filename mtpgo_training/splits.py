# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which recordings teach, choose and test: whole recordings, never parts or tracks of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.config import DataConfig
from mtpgo_training.readers import load_recordings
from mtpgo_training.recording import Recording


@dataclass(frozen=True)
class NamedRecording:
    """A recording and where it came from.

    Attributes:
        source: last part of the directory's name.
        recording: the recording.
    """

    source: str
    recording: Recording

    @property
    def name(self) -> str:
        """``source/name``, unique among the recordings of a training."""
        return f"{self.source}/{self.recording.name}"


@dataclass(frozen=True)
class Splits:
    """The recordings by use."""

    train: tuple[NamedRecording, ...]
    validation: tuple[NamedRecording, ...]
    test: tuple[NamedRecording, ...]

    def describe(self) -> list[dict[str, str]]:
        """Name, source, layout, SHA-256 of the source files and use (``split``) of each."""
        return [
            {
                "name": item.recording.name,
                "source": item.source,
                "layout": item.recording.layout,
                "sha256": item.recording.sha256,
                "split": use,
            }
            for use in ("train", "validation", "test")
            for item in getattr(self, use)
        ]


def read_all(sources: Sequence[tuple[Path, str]]) -> list[NamedRecording]:
    """The recordings of several directories, each with its layout.

    Raises:
        RecordingError: a directory, layout or file is not as it should be.
        ConfigurationError: two recordings have the same name.
    """
    named = [
        NamedRecording(directory.resolve().name, recording)
        for directory, layout in sources
        for recording in load_recordings(directory, layout)
    ]
    seen: set[str] = set()
    for recording in named:
        if recording.name in seen:
            raise ConfigurationError(
                f"the recording {recording.name} is given twice, expected directories whose last "
                "parts differ"
            )
        seen.add(recording.name)
    return named


def split(recordings: Sequence[NamedRecording], data: DataConfig, seed: int) -> Splits:
    """Each recording to its use.

    Raises:
        ConfigurationError: a name without a recording, a recording with two uses, or nothing to
            train on or to validate with.
    """
    chosen = {
        use: _find(recordings, getattr(data, use), f"data.{use}")
        for use in ("train", "validation", "test")
    }
    for first, second in (("train", "validation"), ("train", "test"), ("validation", "test")):
        both = chosen[first] & chosen[second]
        if both:
            raise ConfigurationError(
                f"the recording {recordings[min(both)].name} is in data.{first} and in "
                f"data.{second}, expected one use"
            )
    rest = set(range(len(recordings))) - chosen["test"] - chosen["validation"]
    if not data.validation and data.validation_fraction > 0.0:
        free = sorted(rest - chosen["train"])
        count = min(len(free) - 1, max(1, round(data.validation_fraction * len(free))))
        drawn = np.random.default_rng(seed).permutation(len(free))[: max(count, 0)]
        chosen["validation"] = {free[i] for i in drawn}
        rest -= chosen["validation"]
    chosen["train"] = chosen["train"] or rest
    for use in ("train", "validation"):
        if not chosen[use]:
            raise ConfigurationError(
                f"no recording is left for data.{use} out of {len(recordings)}, "
                "expected at least 1"
            )
    return Splits(**{use: tuple(recordings[i] for i in sorted(chosen[use])) for use in chosen})


def _find(recordings: Sequence[NamedRecording], names: Sequence[str], where: str) -> set[int]:
    found: set[int] = set()
    for name in names:
        matches = {i for i, r in enumerate(recordings) if name in (r.name, r.recording.name)}
        if not matches:
            raise ConfigurationError(
                f"{where} names {name!r}, expected one of " + ", ".join(r.name for r in recordings)
            )
        found |= matches
    return found
