# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a training run: its configuration, log and checkpoints.

:mod:`mtpgo_training.run_files` names its files. Checkpoints hold plain data only, so they
load with ``weights_only``.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import os
import pickletools
import platform
import shutil
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task.checked_archive import read_archive
from mtpgo_training.atomic_files import is_new, new_folder, read_json, replacing, write_text
from mtpgo_training.run_files import (
    BEST_FILE,
    CONFIG_FILE,
    FACTS_FILE,
    KEPT_FILES,
    LAST_FILE,
    LOG_FILE,
    SAMPLES_FILE,
)
from mtpgo_training.training.checkpoints.checkpoint_content import check_content
from mtpgo_training.training.training_config import TrainingConfig, dump_config, load_config

CHECKPOINT_FORMAT = 1

Checkpoint = dict[str, Any]

_PICKLED = {
    ("collections", "OrderedDict"),
    ("torch", "Size"),
    ("torch._utils", "_rebuild_parameter"),
    ("torch._utils", "_rebuild_tensor_v2"),
}
"""What a checkpoint may name besides storages of tensors."""


class RunFolder:
    """The files of a training run.

    Args:
        path: the folder.

    Attributes:
        path: as above.
        best, last, samples, config_file: some of its files, see
            :mod:`mtpgo_training.run_files`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.best = path / BEST_FILE
        self.last = path / LAST_FILE
        self.samples = path / SAMPLES_FILE
        self.config_file = path / CONFIG_FILE
        self._facts = path / FACTS_FILE
        self._log = path / LOG_FILE

    def require_new(self) -> None:
        """Check that the folder is new.

        Raises:
            ConfigurationError: the folder exists and is not empty.
        """
        if not is_new(self.path):
            raise ConfigurationError(
                f"the run folder {self.path} exists already, expected a new one or --resume"
            )

    def require_run(self) -> None:
        """Check that the folder holds a run.

        Raises:
            ConfigurationError: it does not.
        """
        missing = [file.name for file in (self.config_file, self._facts) if not file.is_file()]
        if missing:
            raise ConfigurationError(
                f"the run folder {self.path} holds no run to resume: it has no {missing[0]}"
            )

    def start(
        self,
        config: TrainingConfig,
        splits: list[dict[str, str]],
        initial_weights: str = "",
        more: Mapping[str, str] | None = None,
    ) -> None:
        """Create the folder and write the configuration and the origin of the run.

        Args:
            config: the configuration.
            splits: the recordings of each split, with their hashes.
            initial_weights: SHA-256 of the weights it starts from, if they are not random.
            more: texts of further files by name.

        Raises:
            ConfigurationError: the folder exists and is not empty, or cannot be written.
        """
        self.require_new()
        facts = {
            "network": config.network,
            "splits": splits,
            "seed": config.seed,
            "initial_weights_sha256": initial_weights or None,
            "versions": versions(),
        }
        # All at once: a run that is killed in between could be neither started nor resumed.
        with new_folder(self.path) as folder:
            write_text(folder / CONFIG_FILE, dump_config(config))
            write_text(folder / FACTS_FILE, json.dumps(facts, indent=2) + "\n")
            for name, text in (more or {}).items():
                write_text(folder / name, text)

    def check_same(
        self, config: TrainingConfig, splits: list[dict[str, str]], initial_weights: str = ""
    ) -> None:
        """Check that a resumed run has the configuration and data with which it was started.

        The sections ``trainer`` and ``crossval`` and the number of threads may differ.

        Args:
            config: the configuration.
            splits: the recordings of each split, with their hashes.
            initial_weights: SHA-256 of the weights it starts from without a checkpoint, if they
                are not random.

        Raises:
            ConfigurationError: the folder holds no run, or the configuration or the data differ.
        """
        try:
            stored = load_config(self.config_file)
            facts = read_json(self._facts, "what a run was started with")
        except ConfigurationError as error:
            raise ConfigurationError(
                f"the run folder {self.path} holds no run to resume ({error})"
            ) from error
        stored = dataclasses.replace(
            stored,
            trainer=config.trainer,
            crossval=config.crossval,
            num_threads=config.num_threads,
        )
        if stored != config:
            raise ConfigurationError(
                f"the configuration differs from {self.config_file} in "
                f"{first_difference(stored, config)}, expected the same to resume"
            )
        begun_with = facts.get("initial_weights_sha256") or ""
        if begun_with != initial_weights and not self.last.exists():
            # Without a checkpoint the run would begin with these.
            raise ConfigurationError(
                f"the run in {self.path} started from other weights and ended before its first "
                "checkpoint, expected it to be started again in a new folder with --init-from"
            )
        if facts.get("splits") != splits:
            raise ConfigurationError(
                f"the recordings differ from those in {self._facts}, expected the same to resume"
            )

    def save(
        self, checkpoint: Checkpoint, resumption: Checkpoint | None = None, *, best: bool
    ) -> None:
        """Write ``last.pt``, and ``best.pt`` if it is the best.

        Args:
            checkpoint: the averaged weights and everything else that an export needs.
            resumption: what only resuming needs, added to ``last.pt``.
            best: whether it is the best so far.
        """
        if best:
            self.save_best(checkpoint)
        write_checkpoint(self.last, {**checkpoint, **(resumption or {})})

    def save_best(self, checkpoint: Checkpoint) -> None:
        """Write ``best.pt`` alone."""
        write_checkpoint(self.best, checkpoint)

    def keep_best(self) -> None:
        """Keep ``best.pt`` and its samples for :meth:`restore_best`.

        Raises:
            ConfigurationError: they cannot be written.
        """
        for name, kept in KEPT_FILES.items():
            if (self.path / name).is_file():
                with replacing(self.path / kept) as temporary:
                    shutil.copyfile(self.path / name, temporary)

    def restore_best(self) -> None:
        """Put back what :meth:`keep_best` has kept, if there is anything.

        Raises:
            ConfigurationError: it cannot be put back.
        """
        for name, kept in KEPT_FILES.items():
            try:
                os.replace(self.path / kept, self.path / name)
            except FileNotFoundError:
                continue
            except OSError as error:
                raise ConfigurationError(
                    f"{self.path / name} cannot be written: {error.strerror}"
                ) from error

    def write_log(self, rows: list[dict[str, Any]]) -> None:
        """Write the whole log, one line per epoch."""
        text = io.StringIO()
        columns = list(dict.fromkeys(column for row in rows for column in row))
        writer = csv.DictWriter(text, fieldnames=columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_text(self._log, text.getvalue())


def write_checkpoint(path: Path, content: Checkpoint) -> None:
    """Write a checkpoint, atomically.

    Raises:
        ConfigurationError: it cannot be written.
    """
    buffer = io.BytesIO()  # torch tells of a full disk in errors of its own
    torch.save({"format": CHECKPOINT_FORMAT, **content}, buffer)
    with replacing(path) as temporary:
        temporary.write_bytes(buffer.getbuffer())


def load_checkpoint(path: Path) -> Checkpoint:
    """Load a checkpoint, or the best one of a run folder.

    Raises:
        ConfigurationError: it cannot be read, is not a checkpoint of this format, or has not the
            content of one.
    """
    if path.is_dir():
        path = path / BEST_FILE
    if not path.is_file():
        raise ConfigurationError(f"the checkpoint {path} does not exist")
    archive = read_archive(
        path,
        lambda reason: ConfigurationError(f"{path} is no readable checkpoint: it {reason}"),
        "checkpoint",
    )
    try:
        _check_pickle(archive.record("data.pkl"))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a TorchScript file
            checkpoint = torch.load(
                io.BytesIO(archive.data), map_location="cpu", weights_only=True
            )
    except Exception as error:  # torch raises exceptions of any type on damaged bytes
        reason = str(error).split("\n", 1)[0][:120]
        raise ConfigurationError(f"{path} is no readable checkpoint: {reason}") from error
    if not isinstance(checkpoint, dict) or checkpoint.get("format") != CHECKPOINT_FORMAT:
        raise ConfigurationError(
            f"{path} is no checkpoint of `mtpgo train`, expected format {CHECKPOINT_FORMAT}"
        )
    check_content(
        checkpoint,
        lambda reason: ConfigurationError(f"{path} is no usable checkpoint: it {reason}"),
    )
    return checkpoint


def _check_pickle(content: bytes) -> None:
    """Check that a pickle names nothing but what weights and plain data consist of.

    torch lets some more names through, among them ``bytearray``, of which a few bytes make
    gigabytes.

    Raises:
        ValueError: it names something else.
    """
    for operation, argument, _ in pickletools.genops(content):
        if operation.name in ("INST", "STACK_GLOBAL", "EXT1", "EXT2", "EXT4"):
            raise ValueError(f"it uses the pickle operation {operation.name}")
        if operation.name != "GLOBAL":
            continue
        module, _, name = str(argument).partition(" ")
        storage = module == "torch" and name.endswith("Storage")
        if (module, name) not in _PICKLED and not storage:
            raise ValueError(f"it contains {module}.{name}, expected tensors and plain data")


def first_difference(stored: TrainingConfig, given: TrainingConfig) -> str:
    """Return the first field in which two configurations differ, and both of its values."""
    before, now = dataclasses.asdict(stored), dataclasses.asdict(given)
    name = next(key for key in now if before[key] != now[key])
    if not isinstance(now[name], dict):
        return f"{name} ({before[name]!r} there, {now[name]!r} here)"
    keys = dict.fromkeys([*now[name], *before[name]])
    key = next(k for k in keys if before[name].get(k) != now[name].get(k))
    return f"{name}.{key} ({before[name].get(key)!r} there, {now[name].get(key)!r} here)"


def versions() -> dict[str, str]:
    """Return the versions of Python and of the numerical libraries."""
    import torch_geometric

    return {
        "python": platform.python_version(),
        "torch": torch.__version__,
        "torch_geometric": torch_geometric.__version__,
        "numpy": np.__version__,
    }
