# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``--data DIR --layout LAYOUT --recordings NAME ...`` on a command line, as often as wanted.

``--layout`` and ``--recordings`` belong to the ``--data`` before them, or to the first one if they
stand before it. A directory without a layout takes that of the one before.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.readers import LAYOUTS, iter_recordings
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.recording_cache import RecordingCache, default_folder


@dataclass(frozen=True)
class DataSource:
    """A directory of recordings.

    Attributes:
        directory: where they lie.
        layout: a name in ``LAYOUTS``.
        names: those wanted, None for all.
    """

    directory: Path
    layout: str
    names: tuple[str, ...] | None = None


class _Note(argparse.Action):
    """Keeps the options with their order."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        noted = [*(getattr(namespace, "data_options", None) or []), (self.dest, values)]
        namespace.data_options = noted


def add_data_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the three options; their values end up in ``data_options``."""
    parser.set_defaults(data_options=[])
    add = parser.add_argument
    suppress = argparse.SUPPRESS
    add(
        "--data",
        action=_Note,
        type=Path,
        metavar="DIR",
        default=suppress,
        help="directory with recordings; may be given again, each with its layout",
    )
    add("--layout", action=_Note, default=suppress, help=", ".join(LAYOUTS))
    add(
        "--recordings",
        action=_Note,
        nargs="+",
        metavar="NAME",
        default=suppress,
        help="names of recordings of this directory, all by default",
    )


def data_sources(options: Sequence[tuple[str, Any]]) -> list[DataSource]:
    """The directories that a command line names.

    Raises:
        ConfigurationError: a layout is missing, or recordings are named without a directory.
    """
    entries: list[dict[str, Any]] = []
    early: dict[str, Any] = {}
    for name, value in options:
        if name == "data":
            entries.append({"data": value} | (early if not entries else {}))
        else:
            (entries[-1] if entries else early)[name] = value
    if early and not entries:
        raise ConfigurationError(f"--{next(iter(early))} is given without --data")
    sources: list[DataSource] = []
    for entry in entries:
        layout = entry.get("layout") or (sources[-1].layout if sources else None)
        if layout is None:
            raise ConfigurationError(
                f"the layout of {entry['data']} is not given, expected --layout with one of "
                f"{', '.join(LAYOUTS)}"
            )
        names = entry.get("recordings")
        sources.append(DataSource(entry["data"], layout, tuple(names) if names else None))
    return sources


def named_recordings(
    sources: Sequence[DataSource], cache: RecordingCache | None = None
) -> Iterator[tuple[str, Recording]]:
    """Recordings with names, one after the other, empty ones left out.

    The name is the recording's own, preceded by its directory's where there are several.

    Args:
        sources: where they are.
        cache: where recordings are kept that have been read before.

    Raises:
        RecordingError: a directory, layout or file is not as it should be.
        ConfigurationError: two directories have the same name.
    """
    folders = [source.directory.resolve().name for source in sources]
    doubled = next((name for name in folders if folders.count(name) > 1), None)
    if doubled is not None:
        raise ConfigurationError(
            f"two directories of recordings are called {doubled}, expected last parts that differ"
        )
    for folder, source in zip(folders, sources, strict=True):
        for recording in iter_recordings(
            source.directory, source.layout, source.names, cache=cache
        ):
            if len(recording):
                name = recording.name
                yield (f"{folder}/{name}" if len(sources) > 1 else name), recording


def add_cache_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--cache DIR`` and ``--no-cache`` to a command."""
    group = parser.add_mutually_exclusive_group()
    group.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="where recordings are kept as columns (default: $XDG_CACHE_HOME/mtpgo)",
    )
    group.add_argument(
        "--no-cache", action="store_true", help="read the recordings' own files every time"
    )


def cache_from(args: argparse.Namespace) -> RecordingCache | None:
    """The cache that the command line asks for, None with ``--no-cache``.

    Raises:
        ConfigurationError: the folder named with ``--cache`` cannot be made.
    """
    if args.no_cache:
        return None
    if args.cache is None:
        return RecordingCache(default_folder())
    try:
        args.cache.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(
            f"--cache is {args.cache}, which cannot be made: {error.strerror}"
        ) from error
    return RecordingCache(args.cache)
