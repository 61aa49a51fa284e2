# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of one or several directories, under names that differ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_training.data.readers import reading_jobs
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.readers.reading_job import ReadingJob
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions
from mtpgo_training.data.readers.recording_parts import span_of
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording


class DataSource(NamedTuple):
    """A directory of recordings.

    Attributes:
        directory: the directory.
        layout: a name in :data:`mtpgo_training.data.readers.reading_layouts.LAYOUTS`.
        names: the recordings wanted, None for all.
        options: what else is said about the files.
    """

    directory: Path
    layout: str
    names: tuple[str, ...] | None = None
    options: ReadingOptions = AS_USUAL

    @property
    def folder(self) -> str:
        """Last part of the directory's name."""
        return self.directory.resolve().name


def read_sources(
    sources: Sequence[DataSource], cache: RecordingCache | None = None
) -> Iterator[NamedRecording]:
    """Yield the recordings of several directories, one after the other.

    Args:
        sources: the directories.
        cache: cache of recordings that were read before.

    Raises:
        RecordingError: a directory, layout or file is not as it should be.
        ConfigurationError: two recordings have the same name, directory included. As far as the
            names of the files tell, this is found before anything is read.

    A copy of an earlier recording is left out with a remark: both could get different uses.
    """
    taken: set[str] = set()
    contents = KnownContents()
    for one in source_jobs(sources):
        for recording in one.job.read(cache):
            item = NamedRecording(one.source, recording)
            _take(taken, item.name)
            original = contents.original_of(item.name, recording.sha256)
            if original is None:
                yield item
            else:
                remark(f"{item.name} has the same content as {original}, so it is left out")


def read_all(
    sources: Sequence[DataSource], cache: RecordingCache | None = None
) -> list[NamedRecording]:
    """Return what :func:`read_sources` yields.

    Raises:
        RecordingError: see there, or no recording has a road user.
    """
    recordings = list(read_sources(sources, cache))
    if not any(len(item.recording) for item in recordings):
        where = ", ".join(str(source.directory) for source in sources)
        raise RecordingError(f"no recording of {where} has a road user")
    return recordings


class KnownContents:
    """The recordings of several files by their content, to find duplicates."""

    def __init__(self) -> None:
        self._names: dict[tuple[str, float, float], str] = {}

    def original_of(self, name: str, sha256: str) -> str | None:
        """Return the first recording with the same content, None if this is the first.

        Args:
            name: of the recording, or of a part: equal parts are copies, others are not.
            sha256: its :attr:`Recording.sha256`; one without a hash is never a copy.
        """
        if not sha256:
            return None
        first = self._names.setdefault((sha256, *span_of(name)), name)
        return None if first == name else first


@dataclass(frozen=True)
class SourceJob:
    """Files of one of several directories that are read independently of all others.

    Attributes:
        source: last part of the directory's name.
        job: the files.
        several: there are several directories, so that names begin with the directory's.
    """

    source: str
    job: ReadingJob
    several: bool = False

    @property
    def name(self) -> str:
        """Name of the files, after that of their directory where there are several."""
        return f"{self.source}/{self.job.name}" if self.several else self.job.name

    def read(self, cache: RecordingCache | None = None) -> Iterator[tuple[str, Recording]]:
        """Yield the names and recordings, without empty recordings.

        Arguments and errors are those of :meth:`ReadingJob.read`.
        """
        for recording in self.job.read(cache):
            if len(recording):
                name = recording.name
                yield (f"{self.source}/{name}" if self.several else name), recording


def source_jobs(sources: Sequence[DataSource]) -> list[SourceJob]:
    """Return the jobs of several directories, each of which can be read independently.

    Raises:
        RecordingError: a directory or layout is not as it should be.
        ConfigurationError: two recordings have the same name, directory included.
    """
    several = len(sources) > 1
    jobs = [
        SourceJob(source.folder, job, several)
        for source in sources
        for job in reading_jobs(*source)
    ]
    if several:
        taken: set[str] = set()
        for one in jobs:
            for name in one.job.names:
                _take(taken, f"{one.source}/{name}")
    return jobs


def named_recordings(
    sources: Sequence[DataSource], cache: RecordingCache | None = None
) -> Iterator[tuple[str, Recording]]:
    """Yield the names and recordings of several directories, without empty recordings.

    The name is the recording's, after that of its directory where there are several directories.
    Arguments and errors are those of :func:`read_sources`.
    """
    for item in read_sources(sources, cache):
        if len(item.recording):
            yield (item.name if len(sources) > 1 else item.recording.name), item.recording


def site_of(recording: Recording, name: str) -> str:
    """Return the site of a recording: its location, ``FOLDER/LOCATION`` among several folders.

    Data sets number their locations from 0 or 1, each for itself.

    Args:
        recording: the recording.
        name: by which it is known, ``FOLDER/NAME`` among several folders.
    """
    folder = name.removesuffix(f"/{recording.name}")
    within = "" if folder == name else folder
    return "/".join(filter(None, (within, recording.location)))


def _take(taken: set[str], name: str) -> None:
    if name in taken:
        raise ConfigurationError(
            f"the recording {name} is given twice, expected directories whose last parts differ"
        )
    taken.add(name)
