# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Readers of recordings, one for each file layout; :func:`iter_recordings` reads any of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_training.data.readers.checks.foreign_files import with_packed_named
from mtpgo_training.data.readers.checks.layout_clues import contents_in_words
from mtpgo_training.data.readers.drone_files import NoRecordingsError, select_names
from mtpgo_training.data.readers.reading_job import ReadingJob
from mtpgo_training.data.readers.reading_layouts import finder_of
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.recording_parts import RecordingPart, parts_in
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.recording_cache import RecordingCache


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
        layout: a name in ``reading_layouts.LAYOUTS``.
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
    """Return the jobs of a directory, each of which can be read independently; nothing is read.

    Arguments as for :func:`iter_recordings`.

    Raises:
        RecordingError: an unknown layout, or no recordings.
    """
    where = Path(directory)
    whole, parts = _find(where, layout, names, options)
    if not names:
        whole = with_packed_named(whole, where)
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
            f"{', '.join(options.bags.given)} is given for the layout {layout!r}, expected 'bag'"
        )
    parts = parts_in(names or ())
    whole = [name for name in names or () if name not in {part.name for part in parts}]
    try:
        if parts and not whole:
            return [], parts
        try:
            return find(directory, whole, options), parts
        except NoRecordingsError:
            raise
        except RecordingError:
            # Several recordings may be in one file, as a table's, or the cases of INTERACTION.
            there = [unit.name for unit in find(directory, None, options)]
            inner = [name for name in whole if not _has(there, name)]
            if not all(any(name.startswith(f"{unit}-") for unit in there) for name in inner):
                raise
            whole = [name for name in whole if name not in inner]
            parts = parts + [RecordingPart(name, name, 0.0, math.inf) for name in inner]
            return (find(directory, whole, options) if whole else []), parts
    except NoRecordingsError as error:
        there_is = contents_in_words(directory, layout)
        raise NoRecordingsError(f"{error}; {there_is}" if there_is else str(error)) from error


def _has(units: Sequence[str], name: str) -> bool:
    """Return whether the files of a directory include those with a name."""
    try:
        return bool(select_names(units, [name], Path()))
    except RecordingError:
        return False
