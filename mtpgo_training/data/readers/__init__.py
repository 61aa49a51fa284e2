# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Readers of recordings, one for each file layout; :func:`iter_recordings` reads any of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_training.data.readers.reading_job import ReadingJob
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.recording_parts import RecordingPart, parts_in
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.recording_cache import RecordingCache

UnitFinder = Callable[[Path, Sequence[str] | None, ReadingOptions], list[Unit]]
"""Finds the files to be read together in a directory, all or those with some names."""


LAYOUTS = (
    *("highd", "ind", "round", "unid", "exid"),
    *("ngsim", "table", "interaction", "sind", "dut", "citr", "eth_ucy", "openacc"),
    *("nuscenes", "argoverse2", "waymo", "bag"),
)
"""Names of the layouts."""


def finder_of(layout: str) -> UnitFinder:
    """Return the finder of the files in a directory.

    Its module is imported here: tables need pandas, bags the message adapters and rosbags, and
    the completion of a command line needs the names alone.

    Args:
        layout: a name in ``LAYOUTS``.

    Raises:
        RecordingError: an unknown layout.
    """
    if layout not in LAYOUTS:
        raise RecordingError(
            f"the layout {layout!r} is unknown, expected one of {', '.join(LAYOUTS)}"
        )
    match layout:
        case "ngsim":
            from mtpgo_training.data.readers.ngsim.ngsim_recordings import ngsim_units

            return ngsim_units
        case "table":
            from mtpgo_training.data.readers.tables.table_recordings import table_units

            return table_units
        case "interaction":
            from mtpgo_training.data.readers.datasets.interaction_recordings import (
                interaction_units,
            )

            return interaction_units
        case "sind":
            from mtpgo_training.data.readers.datasets.interaction_recordings import sind_units

            return sind_units
        case "dut" | "citr":
            from mtpgo_training.data.readers.datasets.crowd_recordings import crowd_units

            return partial(crowd_units, layout)
        case "eth_ucy":
            from mtpgo_training.data.readers.datasets.eth_recordings import eth_units

            return eth_units
        case "openacc":
            from mtpgo_training.data.readers.datasets.openacc_recordings import openacc_units

            return openacc_units
        case "nuscenes":
            from mtpgo_training.data.readers.fleets.nuscenes_recordings import nuscenes_units

            return nuscenes_units
        case "argoverse2":
            from mtpgo_training.data.readers.fleets.argoverse_recordings import argoverse_units

            return argoverse_units
        case "waymo":
            from mtpgo_training.data.readers.fleets.waymo_recordings import waymo_units

            return waymo_units
        case "bag":
            from mtpgo_training.data.readers.bags.bag_recordings import bag_units

            return bag_units
    return partial(_drone_units, layout)


def _drone_units(
    layout: str, directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    from mtpgo_training.data.readers.drone_files import DroneFiles, find_drone_files
    from mtpgo_training.data.readers.drone_recordings import DRONE_READERS

    def unit(files: DroneFiles) -> Unit:
        read = DRONE_READERS[layout]
        return Unit(files.name, layout, files.all, lambda: iter([read(files, options.classes)]))

    return [unit(files) for files in find_drone_files(directory, names)]


def iter_recordings(
    directory: str | Path,
    layout: str,
    names: Sequence[str] | None = None,
    options: ReadingOptions = AS_USUAL,
    *,
    cache: RecordingCache | None = None,
) -> Iterator[Recording]:
    """Yield the recordings of a directory, one after the other.

    Args:
        directory: the directory with the files.
        layout: a name in ``LAYOUTS``.
        names: the recordings wanted, all by default; ``01@60-116s`` is a part of ``01``.
        options: what else is said about the files.
        cache: cache of recordings that were read before.

    Raises:
        RecordingError: an unknown layout, no recordings, or a defect of a file.
    """
    for job in reading_jobs(directory, layout, names, options):
        yield from job.read(cache)


def reading_jobs(
    directory: str | Path,
    layout: str,
    names: Sequence[str] | None = None,
    options: ReadingOptions = AS_USUAL,
) -> list[ReadingJob]:
    """Return what of a directory can be read one independently of the other, without reading it.

    Arguments as for :func:`iter_recordings`.

    Raises:
        RecordingError: an unknown layout, or no recordings.
    """
    where = Path(directory)
    whole, parts = _find(where, layout, names, options)
    jobs = [ReadingJob((unit,), options, where) for unit in whole]
    if parts:
        units = finder_of(layout)(where, None, options)
        holders = [u for u in units if any(part.may_be_in(u.name) for part in parts)]
        jobs.append(ReadingJob(tuple(holders), options, where, tuple(parts)))
    return jobs


def load_recordings(
    directory: str | Path,
    layout: str,
    names: Sequence[str] | None = None,
    options: ReadingOptions = AS_USUAL,
    *,
    cache: RecordingCache | None = None,
) -> list[Recording]:
    """Return what :func:`iter_recordings` yields as a list."""
    return list(iter_recordings(directory, layout, names, options, cache=cache))


def _find(
    directory: Path, layout: str, names: Sequence[str] | None, options: ReadingOptions
) -> tuple[list[Unit], list[RecordingPart]]:
    """Return the files of the recordings wanted as a whole, and the parts wanted."""
    find = finder_of(layout)
    if layout != "bag" and options.bags.given:
        raise ConfigurationError(
            f"--{', --'.join(options.bags.given)} is given for the layout {layout!r}, expected"
            " 'bag'"
        )
    parts = parts_in(names or ())
    whole = [name for name in names or () if name not in {part.name for part in parts}]
    return (find(directory, whole, options) if whole or not parts else []), parts
