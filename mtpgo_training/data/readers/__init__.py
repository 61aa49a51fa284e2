# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of any known layout, read into :class:`~mtpgo_training.data.recording.Recording`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.drone_files import DroneFiles, find_drone_files
from mtpgo_training.data.readers.drone_recordings import DRONE_READERS
from mtpgo_training.data.readers.ngsim_recordings import ngsim_units
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.recording_parts import cut_parts, parts_in
from mtpgo_training.data.recording import Recording

if TYPE_CHECKING:
    from mtpgo_training.data.recording_cache import RecordingCache

DirectoryReader = Callable[[Path, Sequence[str] | None], list[Unit]]


def _drone(layout: str) -> DirectoryReader:
    def unit(files: DroneFiles) -> Unit:
        read = DRONE_READERS[layout]
        return Unit(files.name, layout, files.all, lambda: iter([read(files)]))

    def find(directory: Path, names: Sequence[str] | None) -> list[Unit]:
        return [unit(files) for files in find_drone_files(directory, names)]

    return find


def _bags(directory: Path, names: Sequence[str] | None) -> list[Unit]:
    # Only bags need the message adapters and rosbags.
    from mtpgo_training.data.readers.bag_recordings import bag_units

    return bag_units(directory, names)


LAYOUTS: dict[str, DirectoryReader] = {
    **{layout: _drone(layout) for layout in DRONE_READERS},
    "ngsim": ngsim_units,
    "bag": _bags,
}
"""Layout name -> finder of the units of files in a directory."""


def iter_recordings(
    directory: str | Path,
    layout: str,
    names: Sequence[str] | None = None,
    *,
    cache: RecordingCache | None = None,
) -> Iterator[Recording]:
    """The recordings of a directory, one after the other.

    Args:
        directory: where the files lie.
        layout: a name in ``LAYOUTS``.
        names: the recordings wanted, all by default; ``01@60-116s`` is a part of ``01``.
        cache: where recordings are kept that have been read before.

    Raises:
        RecordingError: an unknown layout, no recordings, or a defect of a file.
    """
    if layout not in LAYOUTS:
        raise RecordingError(
            f"the layout {layout!r} is unknown, expected one of {', '.join(LAYOUTS)}"
        )
    where, find = Path(directory), LAYOUTS[layout]

    def read(units: Iterable[Unit]) -> Iterator[Recording]:
        for unit in units:
            yield from unit.read() if cache is None else cache.recordings(unit)

    parts = parts_in(names or ())
    whole = [name for name in names or () if name not in {part.name for part in parts}]
    if whole or not parts:
        yield from read(find(where, whole))
    if parts:
        units = [u for u in find(where, None) if any(part.may_be_in(u.name) for part in parts)]
        yield from cut_parts(read(units), parts, where)


def load_recordings(
    directory: str | Path,
    layout: str,
    names: Sequence[str] | None = None,
    *,
    cache: RecordingCache | None = None,
) -> list[Recording]:
    """All recordings that :func:`iter_recordings` gives, as a list."""
    return list(iter_recordings(directory, layout, names, cache=cache))
