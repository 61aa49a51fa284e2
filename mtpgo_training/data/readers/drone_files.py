# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The three files of a drone recording: finding them and recognising their layout."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import RecordingError

_HIDDEN = (".", "~$")
"""Begin of the names of hidden files and folders."""

_SUFFIXES = (".csv", ".csv.gz")
"""Endings of the files' names, which may be in capitals."""


@dataclass(frozen=True)
class DroneFiles:
    """The files of one recording of the highD or inD family.

    Attributes:
        name: the part of the file names before ``_tracks``, usually two digits.
        tracks: one row per frame and road user.
        tracks_meta: one row per road user.
        recording_meta: one row.
        lanes: lane lines of a simulated recording, None without.
    """

    name: str
    tracks: Path
    tracks_meta: Path
    recording_meta: Path
    lanes: Path | None = None

    @property
    def all(self) -> tuple[Path, ...]:
        """The files in the order in which they are hashed."""
        files = (self.tracks, self.tracks_meta, self.recording_meta)
        return files if self.lanes is None else (*files, self.lanes)


class NoRecordingsError(RecordingError):
    """A directory has no recordings of the layout."""


def existing_directory(directory: Path, expected: str = "a directory with recordings") -> Path:
    """Return ``directory`` if it is a directory.

    Args:
        directory: what is given.
        expected: what could be given, for the error.

    Raises:
        RecordingError: it is missing or a file.
    """
    if not directory.is_dir():
        state = "is a file" if directory.exists() else "does not exist"
        raise RecordingError(f"{directory} {state}, expected {expected}")
    return directory


def visible_files(paths: Iterable[Path], directory: Path) -> list[Path]:
    """Return the paths below a directory in order, without those that are hidden there.

    Archives from macOS have a ``._01_tracks.csv`` beside each file, editors keep copies in folders
    such as ``.ipynb_checkpoints``, and spreadsheets a ``~$a.csv`` beside an open file.
    """
    return sorted(
        path
        for path in paths
        if not any(part.startswith(_HIDDEN) for part in path.relative_to(directory).parts)
    )


def files_below(directory: Path) -> list[Path]:
    """Return the files in a directory and the folders below it, in order, without hidden ones.

    Folders behind symbolic links are looked into as well, each once.
    """
    found: list[Path] = []
    seen: set[Path] = set()
    for folder, folders, names in os.walk(directory, followlinks=True):
        place = Path(folder).resolve()
        if place in seen:
            folders.clear()
            continue
        seen.add(place)
        folders[:] = sorted(name for name in folders if not name.startswith(_HIDDEN))
        found += [Path(folder, name) for name in names if not name.startswith(_HIDDEN)]
    return sorted(path for path in found if path.is_file())


def select_names(available: Sequence[str], names: Sequence[str] | None, where: Path) -> list[str]:
    """Return the recordings asked for, all if none is named; ``1`` finds ``01``.

    Raises:
        RecordingError: there is no recording with one of the names.
    """
    if not names:
        return list(available)
    chosen: list[str] = []
    for name in names:
        same = _of_name(available, name)
        several = [one.strip() for one in name.split(",") if one.strip()]
        if not same and len(several) > 1 and all(_of_name(available, one) for one in several):
            raise RecordingError(
                f"{where} has no recording {name!r}, names are separated by blanks: "
                f"{' '.join(several)}"
            )
        if not same:
            raise RecordingError(
                f"{where} has no recording {name!r}, it has {', '.join(available)}"
            )
        chosen += [a for a in same if a not in chosen]
    return chosen


def _of_name(available: Sequence[str], name: str) -> list[str]:
    """Return the recordings with a name, or with the same number."""
    same = [a for a in available if a == name]
    if not same and name.isdigit():
        same = [a for a in available if a.isdigit() and int(a) == int(name)]
    return same


def find_drone_files(directory: Path, names: Sequence[str] | None = None) -> list[DroneFiles]:
    """Return the recordings in a directory, sorted by name.

    The data sets' archives keep the files in a folder ``data``; it is found as well.

    Raises:
        RecordingError: the directory has no recordings, or one asked for lacks a file.
    """
    existing_directory(directory)
    for place in (directory, directory / "data"):
        paths = visible_files(place.iterdir(), place) if place.is_dir() else []
        tracks = _tracks(paths)
        if tracks:
            break
    else:
        raise NoRecordingsError(
            f"{directory} has no recordings, expected files such as 01_tracks.csv or "
            "01_tracks.csv.gz"
        )
    # Of two names that differ in their capitals only, the usual one comes last.
    by_name = {path.name.lower(): path for path in paths}
    return [
        DroneFiles(
            name=name,
            tracks=tracks[name],
            tracks_meta=_belonging_to(tracks[name], name, "_tracksMeta", by_name),
            recording_meta=_belonging_to(tracks[name], name, "_recordingMeta", by_name),
            lanes=by_name.get(f"{name}_lanes.geojson".lower()),
        )
        for name in select_names(sorted(tracks), names, directory)
    ]


def missing_tracks(tracks: Path) -> list[str]:
    """Return a sentence for each recording beside a tracks file that has no tracks itself."""
    folder = tracks.parent
    paths = visible_files(folder.iterdir(), folder)
    there = {name.lower() for name in _tracks(paths)}
    return [
        f"{folder / name}_tracks.csv is missing, it belongs to {path.name}: the recording is not"
        " read"
        for name, path in _tracks(paths, "_tracksMeta").items()
        if name.lower() not in there
    ]


def _tracks(paths: Sequence[Path], kind: str = "_tracks") -> dict[str, Path]:
    """Return the tracks files among the files of a folder by the names of their recordings.

    Args:
        paths: the files.
        kind: end of the names of such files.
    """
    found: dict[str, Path] = {}
    for suffix in _SUFFIXES:
        ending = f"{kind}{suffix}".lower()
        for path in paths:
            if path.name.lower().endswith(ending):
                found.setdefault(path.name[: -len(ending)], path)
    return found


def _belonging_to(tracks: Path, name: str, ending: str, by_name: Mapping[str, Path]) -> Path:
    """Return the file beside a tracks file that has another ending.

    Args:
        tracks: the tracks file.
        name: name of the recording.
        ending: the other ending, without suffix.
        by_name: the files of the folder by their names in lower case.

    Raises:
        RecordingError: there is none.
    """
    for suffix in _SUFFIXES:
        exact = tracks.with_name(name + ending + suffix)
        path = exact if exact.is_file() else by_name.get(exact.name.lower())
        if path is not None and path.is_file():
            return path
    missing = tracks.with_name(name + ending + _SUFFIXES[0])
    raise RecordingError(f"{missing} is missing, it belongs to {tracks.name}")


def detect_layout(path: Path) -> str | None:
    """Return the layout that the header of a tracks file shows, None if it shows none.

    ``ind`` includes the other layouts with the same columns.
    """
    # Only here: it loads pandas, and commands look for names of recordings before they need it.
    from mtpgo_training.data.readers.csv_table import read_header

    header = set(read_header(path))
    lower = {name.lower() for name in header}
    if "xCenter" in header:
        return "exid" if "laneletId" in header else "ind"
    if {"x", "y", "laneId", "xVelocity"} <= header:
        return "highd"
    if {"vehicle_id", "local_x", "local_y"} <= lower:
        return "ngsim"
    if {"track_id", "timestamp_ms", "agent_type"} <= header:
        return "sind" if "yaw_rad" in header else "interaction"
    return None


def check_layout(path: Path, layout: str, accepted: Collection[str]) -> None:
    """Check the layout of a tracks file.

    Raises:
        RecordingError: the header shows another layout; the message names it.
    """
    found = detect_layout(path)
    if found is not None and found not in accepted:
        raise RecordingError(f"{path} has the layout {found!r}, but {layout!r} was asked for")
