# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Finding a model file or its checkpoint and reading the task description, without torch.

A model file is a TorchScript archive, which is a zip file, with the task description as an extra
file. The checkpoint of a model ``X.pt`` is ``X.ckpt`` beside it. Every error is one sentence that
names the file.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

from mtpgo_core.errors import ConfigurationError, ModelFileError
from mtpgo_core.resources import find_resource
from mtpgo_core.task.task_description import TASK_FILE, TaskDescription

CHECKPOINT_SUFFIX = ".ckpt"
"""Suffix of the checkpoint of a model file, from which a training can start."""


def find_model(name_or_path: str | Path) -> Path:
    """Return the file of a model given by path or by the name of a shipped model.

    Args:
        name_or_path: anything with a separator or a suffix is a path; ``default`` is a name.

    Raises:
        ModelFileError: there is no such shipped model. A path is not checked before it is read.
    """
    path = Path(name_or_path)
    return path if path.is_file() else _path_or_shipped(path, ".pt", "model")


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
    if not path.exists():  # a run folder may have any name
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
    if not path.is_file() or not zipfile.is_zipfile(path):
        return False
    with zipfile.ZipFile(path) as archive:
        return any(name.partition("/")[2].startswith("code/") for name in archive.namelist())


def _path_or_shipped(path: Path, suffix: str, what: str) -> Path:
    """Return a path with a separator or a suffix as it is, else the shipped file of this name."""
    if path.suffix or len(path.parts) != 1:
        return path.expanduser()
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


def load_task(path: str | Path) -> TaskDescription:
    """Return the task description of a model file; nothing else is read.

    Raises:
        ModelFileError: the file is missing, unreadable, truncated, not TorchScript or without
            a usable task description.
    """
    path = Path(path)
    if path.is_dir():
        raise ModelFileError(f"model file {path} is a directory, expected a TorchScript file")
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            inside = {name.partition("/")[2]: name for name in names}
            if not any(name.startswith("code/") for name in inside):
                raise ModelFileError(
                    f"model file {path} is a zip archive without code, expected TorchScript"
                )
            if f"extra/{TASK_FILE}" not in inside:
                raise ModelFileError(
                    f"model file {path} is TorchScript without {TASK_FILE}, expected a file "
                    f"exported by 'mtpgo export'"
                )
            text = archive.read(inside[f"extra/{TASK_FILE}"]).decode()
    except FileNotFoundError as error:
        raise ModelFileError(f"model file {path} does not exist") from error
    except OSError as error:
        raise ModelFileError(f"model file {path} cannot be read: {error.strerror}") from error
    except (zipfile.BadZipFile, UnicodeDecodeError, NotImplementedError, EOFError) as error:
        raise ModelFileError(
            f"model file {path} is truncated or no TorchScript file: {error}"
        ) from error
    try:
        return TaskDescription.from_json(text)
    except (ConfigurationError, TypeError) as error:
        raise ModelFileError(f"model file {path} has an unusable {TASK_FILE}: {error}") from error
