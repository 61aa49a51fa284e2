# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of any known layout, read into :class:`~mtpgo_training.recording.Recording`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mtpgo_core.errors import RecordingError
from mtpgo_training.readers.drone import DRONE_READERS
from mtpgo_training.readers.files import find_drone_files
from mtpgo_training.readers.ngsim import read_ngsim
from mtpgo_training.recording import Recording

DirectoryReader = Callable[[Path, Sequence[str] | None], Iterator[Recording]]


def _drone(layout: str) -> DirectoryReader:
    def read(directory: Path, names: Sequence[str] | None) -> Iterator[Recording]:
        for files in find_drone_files(directory, names):
            yield DRONE_READERS[layout](files)

    return read


def _bags(directory: Path, names: Sequence[str] | None) -> Iterator[Recording]:
    # Only bags need the message adapters and rosbags.
    from mtpgo_training.readers.bag import read_bags

    return read_bags(directory, names)


LAYOUTS: dict[str, DirectoryReader] = {
    **{layout: _drone(layout) for layout in DRONE_READERS},
    "ngsim": read_ngsim,
    "bag": _bags,
}
"""Layout name -> reader of the recordings in a directory."""


def iter_recordings(
    directory: str | Path, layout: str, names: Sequence[str] | None = None
) -> Iterator[Recording]:
    """The recordings of a directory, one after the other.

    Args:
        directory: where the files lie.
        layout: a name in ``LAYOUTS``.
        names: the recordings wanted, all by default.

    Raises:
        RecordingError: an unknown layout, no recordings, or a defect of a file.
    """
    if layout not in LAYOUTS:
        raise RecordingError(
            f"the layout {layout!r} is unknown, expected one of {', '.join(LAYOUTS)}"
        )
    yield from LAYOUTS[layout](Path(directory), names)


def load_recordings(
    directory: str | Path, layout: str, names: Sequence[str] | None = None
) -> list[Recording]:
    """All recordings that :func:`iter_recordings` gives, as a list."""
    return list(iter_recordings(directory, layout, names))
