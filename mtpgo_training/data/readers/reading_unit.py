# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files that are read together: three of a drone recording, one of NGSIM, or one bag."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.recording import Recording


@dataclass(frozen=True)
class Unit:
    """Files that hold one recording, or several whose number is known after reading only.

    Attributes:
        name: name within the directory.
        layout: name of the layout.
        files: the files, in the order in which they are hashed.
        read: reads the recordings, one after the other.
        settings: what else determines the recordings, as JSON can write it.
        remarks: what is to be said whenever they are read, of files that are not among them.
    """

    name: str
    layout: str
    files: Sequence[Path]
    read: Callable[[], Iterator[Recording]]
    settings: Mapping[str, Any] = field(default_factory=dict)
    remarks: Sequence[str] = ()

    @cached_property
    def sha256(self) -> str:
        """SHA-256 over the contents of the files.

        Raises:
            RecordingError: a file cannot be read.
        """
        try:
            return sha256_of(self.files)
        except OSError as error:
            raise RecordingError(f"{error.filename} cannot be read: {error.strerror}") from error
