# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A schedule that fits into a time: epochs, and the share of the scenes in each.

The schedules of losses and learning rate follow the epochs, so a training that is cut off by a
time limit has not come to their end. Instead, the cost of an epoch is measured on a few steps, and
the number of epochs is chosen such that the whole schedule fits. Where fewer than ``LEAST_EPOCHS``
would fit, there are that many, each with a random share of the windows.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_training.atomic_files import read_json, write_text
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.training.training_config import TrainingConfig
from mtpgo_training.training.trial.epoch_cost import EpochCost

LEAST_EPOCHS = 12
"""Fewest epochs of a shortened schedule; chosen: three of them are the warm-up of Algorithm 1, and
one is the smallest step of its winners."""

VALIDATION_SHARE = 0.15
"""Share of the time that validation may take before it is done less often; chosen."""


@dataclass(frozen=True)
class Budget:
    """How long a training may take.

    Attributes:
        minutes: processor time of the training (min), without reading and scoring. On a GPU it is
            time as shown by a clock. None for any.
        epochs: number of epochs; None for the configuration's, or as many as fit.
        steps: optimisation steps, instead of minutes: the same on any machine. None for any.
    """

    minutes: float | None = None
    epochs: int | None = None
    steps: int | None = None


@dataclass(frozen=True)
class SchedulePlan:
    """The shortened schedule of a training.

    Attributes:
        epochs: length of the schedule.
        share: share of the windows in an epoch.
        validate_every_epochs: epochs between validations.
        limit_minutes: the training ends here in any case (min); None for never.
        of_epochs: length of the schedule that was shortened, as it was configured; None where
            that is kept elsewhere.
    """

    epochs: int
    share: float = 1.0
    validate_every_epochs: int = 1
    limit_minutes: float | None = None
    of_epochs: int | None = None

    def applied(
        self, config: TrainingConfig, recordings: Sequence[NamedRecording]
    ) -> TrainingConfig:
        """Return the configuration with this schedule."""
        data = config.data
        if self.share < 1.0:
            weights = dict.fromkeys((item.source for item in recordings), 1.0)
            weights = {k: self.share * w for k, w in (weights | data.source_weight).items()}
            data = dataclasses.replace(data, source_weight=weights)
        return dataclasses.replace(
            config,
            data=data,
            optimisation=dataclasses.replace(config.optimisation, epochs=self.epochs),
            trainer=dataclasses.replace(
                config.trainer, validate_every_epochs=self.validate_every_epochs
            ),
        )

    def to_json(self) -> str:
        """Return it as JSON text."""
        return json.dumps(dataclasses.asdict(self), indent=2) + "\n"

    def save(self, path: Path) -> None:
        """Write it to a JSON file."""
        write_text(path, self.to_json())

    @classmethod
    def load(cls, path: Path) -> SchedulePlan:
        """Read a file of :meth:`to_json`.

        Raises:
            ConfigurationError: it cannot be read or holds no schedule.
        """
        content = read_json(path, "the schedule of a training", ("epochs",))
        plan = from_dict(cls, content, str(path))
        if plan.epochs < 1 or plan.validate_every_epochs < 1 or not 0.0 <= plan.share <= 1.0:
            raise ConfigurationError(f"{path} is damaged, expected the schedule of a training")
        return plan


def fit_schedule(
    cost: EpochCost, total: float, config: TrainingConfig, budget: Budget
) -> SchedulePlan:
    """Return the schedule that costs ``total``.

    Args:
        cost: of a whole epoch.
        total: of the training, in the unit of ``cost``; validations are a part of it if they are
            measured.
        config: the configuration of the training.
        budget: its number of epochs is taken, if there is one.
    """
    options, every = config.optimisation, config.trainer.validate_every_epochs

    def validations(epochs: int) -> float:
        return math.ceil(epochs / every) * cost.validation

    if budget.epochs is not None:
        epochs = budget.epochs
    else:
        fitting = int(total / (cost.training + cost.validation / every))
        fewest = max(LEAST_EPOCHS, options.calibration_epochs + 1)
        epochs = max(min(options.epochs, fewest), min(options.epochs, fitting))
    while validations(epochs) > VALIDATION_SHARE * total and every < epochs:
        every += 1
    left = total
    if budget.steps is None:
        left = max(total - validations(epochs), 0.2 * total)
    # The shortest epochs that still have a few steps each.
    least = min(1.0, 4.0 * options.batch_scenes / max(cost.scenes, 1))
    share = min(1.0, max(least, left / (epochs * cost.training)))
    return SchedulePlan(epochs, round(share, 4), every)
