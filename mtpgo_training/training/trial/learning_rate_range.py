# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The learning-rate range test: a short training with a rising rate before the real one.

After Smith, *Cyclical Learning Rates for Training Neural Networks* (WACV 2017), section 3.3, which
the paper names for its own tuning, in the form of Lightning's learning-rate finder: the rate
rises exponentially, the loss is smoothed with bias correction, and the suggestion is the rate at
which it falls most steeply.
"""

from __future__ import annotations

import copy
import itertools
import math
from dataclasses import dataclass

import numpy as np
import torch

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.data_loading import Scenes, epoch_loader
from mtpgo_training.training.run_loss import BatchLoss
from mtpgo_training.training.run_state import TrainingRun

LOWEST, HIGHEST, STEPS = 1e-8, 1.0, 100
"""Range of the rates and number of steps: Lightning's defaults."""

SMOOTHING = 0.98
"""Decay of the moving average of the loss: Lightning's."""

DIVERGED = 4.0
"""The test ends when the smoothed loss is this many times its least value: Lightning's."""

FIRST, LAST = 10, 1
"""Points left out at the beginning, where the average is noise, and at the end: Lightning's."""


@dataclass(frozen=True)
class RangeTest:
    """Result of a range test.

    Attributes:
        rates: [n] learning rates.
        losses: [n] smoothed losses.
    """

    rates: tuple[float, ...]
    losses: tuple[float, ...]

    @property
    def suggestion(self) -> float:
        """The rate at which the smoothed loss falls most steeply over the logarithm of the rate.

        Raises:
            ConfigurationError: the loss never falls, or the test ended at once.
        """
        losses = np.array(self.losses[FIRST : len(self.losses) - LAST])
        slope = np.gradient(losses) if len(losses) > 1 else np.zeros(1)
        if not slope.min() < 0.0:
            raise ConfigurationError(
                f"the range test of {len(self.rates)} learning rates found none at which the loss "
                "falls, expected one; give optimisation.learning_rate instead of --find-lr"
            )
        return self.rates[FIRST + int(slope.argmin())]

    def to_csv(self) -> str:
        """Return the points as text, one line each."""
        lines = ["learning_rate,smoothed_loss"]
        points = zip(self.rates, self.losses, strict=True)
        return "\n".join(lines + [f"{rate:.6e},{loss:.6e}" for rate, loss in points]) + "\n"


def learning_rate_range_test(
    run: TrainingRun, scenes: Scenes, device: torch.device | None = None, steps: int = STEPS
) -> RangeTest:
    """Train a copy of the network with rising rates, on the loss of the first epoch.

    Args:
        run: at its start; its weights do not change.
        scenes: of the training.
        device: where to train, the CPU by default.
        steps: number of rates.
    """
    model = copy.deepcopy(run.model).to(device or torch.device("cpu"))
    trial = TrainingRun(model, run.config)
    options = run.config.optimisation
    loss_of = BatchLoss(trial).train()
    optimiser = torch.optim.AdamW(model.parameters(), lr=LOWEST, weight_decay=options.weight_decay)
    forced = trial.teacher_forcing_probability()
    loader, _ = epoch_loader(scenes.training, trial, 0, 1)
    batches = itertools.chain.from_iterable(itertools.repeat(loader))
    torch.manual_seed(run.config.seed)
    rates: list[float] = []
    losses: list[float] = []
    average, least = 0.0, math.inf
    for step, batch in zip(range(steps), batches, strict=False):
        rate = LOWEST * (HIGHEST / LOWEST) ** (step / max(1, steps - 1))
        for group in optimiser.param_groups:
            group["lr"] = rate
        teacher_forcing = bool(torch.rand(()) < forced)
        loss = loss_of(batch.to(device or torch.device("cpu")), teacher_forcing)
        value = float(loss.detach())
        if not math.isfinite(value):
            break
        average = SMOOTHING * average + (1.0 - SMOOTHING) * value
        smoothed = average / (1.0 - SMOOTHING ** (step + 1))
        rates.append(rate)
        losses.append(smoothed)
        if step > 1 and smoothed > DIVERGED * abs(least):
            break
        least = min(least, smoothed)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), options.clip_norm)
        optimiser.step()
    return RangeTest(tuple(rates), tuple(losses))
