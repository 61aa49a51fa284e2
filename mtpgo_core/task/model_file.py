# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Finding a model file or its checkpoint, and the checks of a model file that need no torch.

A model file is a TorchScript archive, which is a zip file, with the task description as an extra
file. The checkpoint of a model ``X.pt`` is ``X.ckpt`` beside it. Every error is one sentence that
names the file.

A model file is a program, so it is checked in three steps, each of which makes the next one safe:
here its bytes and the text of its code, in :mod:`mtpgo_core.task.model_trial` a run in a process
that can be ended, and in :mod:`mtpgo_core.prediction.model_runner` the loaded graph and a run with
known input.
"""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError, ModelFileError
from mtpgo_core.resources import find_resource
from mtpgo_core.task.checked_archive import CheckedArchive, check_archive, read_archive
from mtpgo_core.task.model_operators import foreign_operators
from mtpgo_core.task.task_description import TASK_FILE, TaskDescription
from mtpgo_core.whole_file import user_path

CHECKPOINT_SUFFIX = ".ckpt"
"""Suffix of the checkpoint of a model file, from which a training can start."""

_LARGEST_TASK = 8 << 20
"""Largest task description (bytes); chosen: the shipped model's has 0.04 MB."""


def find_model(name_or_path: str | Path) -> Path:
    """Return the file of a model given by path or by the name of a shipped model.

    Args:
        name_or_path: anything with a separator or a suffix is a path; ``default`` is a name.

    Raises:
        ModelFileError: there is no such shipped model. A path is not checked before it is read.
    """
    path = Path(name_or_path)
    return path if os.path.isfile(path) else _path_or_shipped(path, ".pt", "model")


def find_checkpoint(name_or_path: str | Path) -> Path:
    """Return the checkpoint of a model given by path or by the name of a shipped model.

    Args:
        name_or_path: as for :func:`find_model`. A path is a run folder, a checkpoint, or a model
            file that has its checkpoint beside it.

    Raises:
        ModelFileError: there is no shipped model of this name with a checkpoint, or the model file
            has none beside it. A path is not checked before it is read.
    """
    path = Path(name_or_path)
    if not os.path.exists(path):  # a run folder may have any name
        path = _path_or_shipped(path, CHECKPOINT_SUFFIX, "checkpoint")
    if not is_model_file(path):
        return path
    beside = path.with_suffix(CHECKPOINT_SUFFIX)
    if not beside.is_file():
        raise ModelFileError(
            f"model file {path} has no checkpoint {beside.name} beside it, expected one to start "
            "from; 'mtpgo export' writes it with --checkpoint"
        )
    return beside


def shipped_models(suffix: str = ".pt") -> list[str]:
    """Return the names of the models that ship with the package.

    Args:
        suffix: of the file looked for, ``.pt`` or :data:`CHECKPOINT_SUFFIX`.
    """
    try:
        folder = find_resource("weights")
    except ConfigurationError:
        return []
    return sorted(path.stem for path in folder.glob(f"*{suffix}"))


def is_model_file(path: Path) -> bool:
    """Return whether a file is a TorchScript archive, as exported models are."""
    try:
        if not path.is_file() or not zipfile.is_zipfile(path):
            return False
        with zipfile.ZipFile(path) as archive:
            return any(name.partition("/")[2].startswith("code/") for name in archive.namelist())
    except Exception:  # zipfile raises whatever it likes on damaged bytes
        return False


def _path_or_shipped(path: Path, suffix: str, what: str) -> Path:
    """Return a path with a separator or a suffix as it is, else the shipped file of this name."""
    if path.suffix or len(path.parts) != 1:
        return user_path(path)
    try:
        return find_resource("weights", f"{path}{suffix}")
    except ConfigurationError as error:
        raise ModelFileError(
            f"{what} {str(path)!r} is neither a file nor a shipped {what}, expected a path "
            f"or one of {', '.join(shipped_models(suffix)) or 'none, for none are installed'}"
        ) from error


def model_card(path: Path) -> str | None:
    """Return the model card (Markdown) next to a model file, None if there is none."""
    card = path.with_suffix(".md")
    try:
        return card.read_text(encoding="utf-8") if card.is_file() else None
    except (OSError, UnicodeDecodeError):
        return None


def is_shipped(path: Path) -> bool:
    """Return whether a file is one of the package's own models.

    They are installed with the code and can be trusted as much as the code.
    """
    try:
        return path.resolve().parent == find_resource("weights").resolve()
    except (ConfigurationError, OSError):
        return False


@dataclass(frozen=True)
class ModelFile:
    """A model file that passed every check that needs no torch.

    Attributes:
        archive: its records.
        task: its task description.
    """

    archive: CheckedArchive
    task: TaskDescription

    @property
    def path(self) -> Path:
        """Where it was read from."""
        return self.archive.path


def read_model(path: str | Path, sha256: str = "") -> ModelFile:
    """Read a model file and check it without running any of its code.

    Checked are the sizes before anything is unpacked, the checksums of all records, the task
    description, the operators that the code uses, and the hash of the content, where the file
    states one.

    Args:
        path: the file.
        sha256: SHA-256 that the file must have, as ``sha256sum`` prints it; empty for any.

    Raises:
        ModelFileError: one of the checks failed, or the file is missing or unreadable.
    """
    path = Path(path)
    return _checked(read_archive(path, _refusing(path), "TorchScript"), sha256)


def model_of(path: Path, data: bytes) -> ModelFile:
    """Check the content of a model file as :func:`read_model` does; ``path`` is for errors."""
    return _checked(check_archive(path, data, _refusing(path), "TorchScript"), "")


def _refusing(path: Path) -> Callable[[str], ModelFileError]:
    return lambda reason: ModelFileError(f"model file {path} {reason}")


def _checked(archive: CheckedArchive, sha256: str) -> ModelFile:
    refused = _refusing(archive.path)
    if sha256 and archive.sha256 != sha256.strip().lower():
        raise refused(f"has the SHA-256 {archive.sha256}, expected {sha256.strip().lower()}")
    if not any(name.startswith("code/") for name in archive.names):
        raise refused("is a zip archive without code, expected TorchScript")
    if f"extra/{TASK_FILE}" not in archive.names:
        raise refused(
            f"is TorchScript without {TASK_FILE}, expected a file exported by 'mtpgo export'"
        )
    records = archive.records()
    task = _task_of(records[f"extra/{TASK_FILE}"], refused)
    for name, content in records.items():
        if name.startswith("code/") and name.endswith(".py"):
            _check_code(content, refused)
    if "model.json" in records:
        raise refused("is of a torch before 1.4, expected a file exported by 'mtpgo export'")
    if task.content_sha256:
        found = content_sha256(records)
        if found != task.content_sha256:
            raise refused(
                f"is not what was exported: its content has the SHA-256 {found}, its task"
                f" description says {task.content_sha256}"
            )
    return ModelFile(archive, task)


def load_task(path: str | Path) -> TaskDescription:
    """Return the task description of a model file, which is checked as :func:`read_model` does.

    Raises:
        ModelFileError: see :func:`read_model`.
    """
    return read_model(path).task


def content_sha256(records: Mapping[str, bytes]) -> str:
    """Return the SHA-256 over what a model file contains: code, weights and task description.

    The task description enters without this hash itself. What only describes the source code's
    lines or the archive does not enter.

    Args:
        records: content of the records by name, see
            :meth:`mtpgo_core.task.checked_archive.CheckedArchive.records`.
    """
    digest = hashlib.sha256()
    for name in sorted(records):
        content = records[name]
        if name == f"extra/{TASK_FILE}":
            stated = {k: v for k, v in json.loads(content).items() if k != "content_sha256"}
            content = json.dumps(stated, sort_keys=True).encode()
        elif name.startswith(("extra/", ".data/")) or name.endswith(".debug_pkl"):
            continue
        digest.update(f"{len(name)} {name} {len(content)} ".encode())
        digest.update(content)
    return digest.hexdigest()


def _task_of(text: bytes, refused: Callable[[str], ModelFileError]) -> TaskDescription:
    if len(text) > _LARGEST_TASK:
        raise refused(f"has a {TASK_FILE} of {len(text)} bytes, expected at most {_LARGEST_TASK}")
    try:
        return TaskDescription.from_json(text.decode())
    except (ConfigurationError, TypeError, ValueError, RecursionError, OverflowError) as error:
        reason = " ".join(str(error).split())[:300]
        raise refused(f"has an unusable {TASK_FILE}: {reason}") from error


def _check_code(content: bytes, refused: Callable[[str], ModelFileError]) -> None:
    try:
        code = content.decode("ascii")
    except UnicodeDecodeError as error:
        raise refused(f"has code that is no plain text: {error}") from error
    for name in foreign_operators(code):
        raise refused(
            f"uses {name}, which no model needs, expected operators on tensors only"
            " (SECURITY.md lists them)"
        )
