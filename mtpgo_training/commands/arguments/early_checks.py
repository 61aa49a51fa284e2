# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a command checks before it begins to work: files, folders, layouts, installed libraries."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.task.model_file import find_model, read_model
from mtpgo_training.data.data_sources import DataSource, SourceJob, source_jobs
from mtpgo_training.run_files import FACTS_FILE, RUN_FILES

MODULES_OF_LAYOUT = {
    "argoverse2": ("pyarrow",),
    "waymo": ("google.protobuf", "google_crc32c"),
}
"""Layout -> modules that read its files and come with an extra."""

MODULES_OF_SUFFIX = {".parquet": "pyarrow", ".pq": "pyarrow", ".feather": "pyarrow"}
"""Suffix of a file of any layout -> module that reads it and comes with an extra."""


def require_modules(*names: str) -> None:
    """Check that libraries which come with an extra are installed, without loading them.

    Raises:
        ModuleNotFoundError: one is not; the command line names its extra.
    """
    for name in names:
        try:
            found = importlib.util.find_spec(name) is not None
        except (ModuleNotFoundError, ValueError):  # its parent is missing, or it was blocked
            found = False
        if not found:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def require_training_modules() -> None:
    """Check that the libraries of a training are installed, without loading them.

    Raises:
        ModuleNotFoundError: one is not; the command line names its extra.
    """
    require_modules("lightning_fabric", "tensorboard", "torch_geometric")


def require_models(given: Sequence[str]) -> list[Path]:
    """Return the files of models, all of them checked as far as that needs no torch.

    Args:
        given: files, or names of shipped models.

    Raises:
        ModelFileError: there is no such model, or a file is none.
    """
    paths = [find_model(one) for one in given]
    for path in dict.fromkeys(paths):
        if not path.is_file():
            read_model(path)  # its error; the others are not read before
    for path in dict.fromkeys(paths):
        read_model(path)
    return paths


def require_sources(sources: Sequence[DataSource]) -> list[SourceJob]:
    """Return what is to be read of directories, with its files found and its libraries there.

    Raises:
        RecordingError: a directory, layout or recording is not there.
        ConfigurationError: a description of columns is not there, or a recording is given twice.
        ModuleNotFoundError: a library that the files need is not installed.
    """
    for source in sources:
        columns = source.options.columns
        if columns is not None and not columns.is_file():
            raise ConfigurationError(
                f"--columns is {columns}, which is no file, expected one with the columns"
            )
    jobs = source_jobs(sources)
    for source in sources:
        require_modules(*MODULES_OF_LAYOUT.get(source.layout, ()))
    suffixes = {file.suffix.lower() for file in files_of_recordings(jobs)}
    for suffix in suffixes & MODULES_OF_SUFFIX.keys():
        require_modules(MODULES_OF_SUFFIX[suffix])
    return jobs


def require_bags(bags: Sequence[Path]) -> None:
    """Check that all bags are there.

    Raises:
        RecordingError: one is not.
    """
    for bag in bags:
        if not bag.exists():
            raise RecordingError(f"{bag} does not exist, expected a bag")


def require_makeable(path: Path) -> None:
    """Check that a file or folder can be made where there is none yet, without making anything.

    Raises:
        ConfigurationError: it cannot.
    """
    place = path
    while not place.exists() and place != place.parent:
        place = place.parent
    if place != path and not place.is_dir():
        raise ConfigurationError(f"{path} cannot be written: {place} is no directory")
    if not os.access(place, os.W_OK | (os.X_OK if place.is_dir() else 0)):
        raise ConfigurationError(f"{path} cannot be written: {place} is not writable")


def require_folder(path: Path) -> None:
    """Check that a folder is there or can be made, without making anything.

    Raises:
        ConfigurationError: it cannot, or there is a file of this name.
    """
    require_makeable(path)
    if path.exists() and not path.is_dir():
        raise ConfigurationError(f"{path} is a file, expected a folder")


def require_different(outputs: Sequence[tuple[str, Path | None]]) -> None:
    """Check that no two outputs are the same file.

    Args:
        outputs: option and path of each, None where none is wanted.

    Raises:
        ConfigurationError: two are.
    """
    seen: dict[str, str] = {}
    for option, path in outputs:
        if path is None:
            continue
        place = os.path.realpath(path)
        if place in seen:
            raise ConfigurationError(
                f"{seen[place]} and {option} are both {path}, expected different files"
            )
        seen[place] = option


def require_apart(
    outputs: Sequence[tuple[str, Path | None]], inputs: Iterable[str | Path]
) -> None:
    """Check that no output takes the place of a file that is read, which would be lost.

    Args:
        outputs: option and path of each, None where none is wanted.
        inputs: the files that are read.

    Raises:
        ConfigurationError: one does.
    """
    read = {os.path.realpath(path) for path in inputs}
    for option, path in outputs:
        if path is not None and path.exists() and os.path.realpath(path) in read:
            raise ConfigurationError(
                f"{option} is {path}, which is read and would be lost, expected another file"
            )


def files_of_recordings(jobs: Iterable[SourceJob]) -> list[Path]:
    """Return the files that recordings are read from."""
    return [Path(file) for one in jobs for unit in one.job.units for file in unit.files]


def files_of_bag(bag: Path) -> list[Path]:
    """Return a bag, and the files in it if it is a folder."""
    return [bag, *bag.iterdir()] if bag.is_dir() else [bag]


def files_of_run(checkpoint: Path) -> list[Path]:
    """Return the files of the run that a checkpoint belongs to, or the checkpoint alone.

    Args:
        checkpoint: run folder, or a file, in a run folder or not.
    """
    folder = checkpoint if checkpoint.is_dir() else checkpoint.parent
    if not (folder / FACTS_FILE).is_file():
        return [checkpoint]
    return [checkpoint, *(folder / name for name in RUN_FILES)]
