# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The recordings of a study and their one split, which all rows and seeds share."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import USES, NamedRecording, Splits, split, window_s
from mtpgo_training.study.study_rows import Study
from mtpgo_training.training.networks import horizon_steps
from mtpgo_training.training.training_config import TrainingConfig

SPLIT_SEED = 1
"""Seed of the split, whatever the seed of a training."""

TEST_FRACTION = 0.2
"""Share of the test where a configuration has none; chosen."""


@dataclass(frozen=True)
class StudyData:
    """What is trained, validated and tested on.

    Attributes:
        splits: whole recordings, or blocks of time that count as recordings.
    """

    splits: Splits

    @property
    def recordings(self) -> list[NamedRecording]:
        """All of them."""
        return [*self.splits.train, *self.splits.validation, *self.splits.test]

    def of(self, config: TrainingConfig) -> TrainingConfig:
        """Return a configuration that splits :attr:`recordings` like this."""
        train, validation, test = (
            tuple(item.name for item in part)
            for part in (self.splits.train, self.splits.validation, self.splits.test)
        )
        data = dataclasses.replace(
            config.data, split="recording", train=train, validation=validation, test=test
        )
        return dataclasses.replace(config, data=data)


def study_data(
    study: Study, config: TrainingConfig, recordings: Sequence[NamedRecording]
) -> StudyData:
    """Split the recordings once for a study, as its configuration says.

    Lists of recordings in the configuration that name others than these are not used: it is then
    one for other data, and the shares are.

    Args:
        study: which one.
        config: of its first row.
        recordings: all of them.

    Raises:
        ConfigurationError: too few recordings or blocks, or a class that the study needs is not
            in what is trained or tested on.
    """
    data = _usable(config.data, recordings)
    guard_s = window_s(config.history, horizon_steps(config.model))
    recordings = [item for item in recordings if len(item.recording)]
    if data.split == "recording" and len(recordings) < len(USES):
        raise ConfigurationError(
            f"{len(recordings)} recordings are given, expected at least {len(USES)}: to train, to "
            "validate and to test on (or data.split=time)"
        )
    splits = split(recordings, data, SPLIT_SEED, guard_s)
    if not splits.test:
        raise ConfigurationError(
            f"no recording or block is left for the test out of {len(recordings)} recordings, "
            "expected more of them, or shorter blocks (data.block_s)"
        )
    for use in ("train", "test"):
        present = _classes(getattr(splits, use))
        missing = [name for name in study.classes if name not in present]
        if missing:
            raise ConfigurationError(
                f"the study {study.name} needs {', '.join(study.classes)}, but the recordings for "
                f"data.{use} have no {' and no '.join(missing)} (they have "
                f"{', '.join(sorted(present)) or 'nothing'})"
            )
    return StudyData(splits)


def _usable(data: DataConfig, recordings: Sequence[NamedRecording]) -> DataConfig:
    """Return the section with the recordings' own lists, or none, and a share for the test."""
    known = {name for item in recordings for name in (item.name, item.recording.name)}
    if not {*data.train, *data.validation, *data.test} <= known:
        data = dataclasses.replace(data, train=(), validation=(), test=())
    if not data.test and data.test_fraction == 0.0:
        data = dataclasses.replace(data, test_fraction=TEST_FRACTION)
    return data


def _classes(recordings: Sequence[NamedRecording]) -> set[str]:
    """Return the names of the classes in recordings."""
    codes = {int(code) for item in recordings for code in set(item.recording.agent_class.tolist())}
    return {AgentClass(code).name.lower() for code in codes}
