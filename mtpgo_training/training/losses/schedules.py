# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The schedule of the losses (Algorithm 1 of the paper) and of the learning rate."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mtpgo_core.errors import ConfigurationError

LEARNING_RATE_SCHEDULES = ("cosine", "constant")

WARM_UP_SHARE = 0.25
"""Share of the epochs before the likelihood alone, W / total in Algorithm 1 of the paper."""


@dataclass(frozen=True)
class LossWeights:
    """The loss of one epoch: ``ewta * EWTA(winners) + nll * NLL``.

    Attributes:
        winners: K, number of components that the EWTA loss pulls towards the truth.
        ewta: weight of the EWTA loss: 1, then beta, then 0.
        nll: weight of the negative log-likelihood: 0, then 1 - beta, then 1.
        objective: name of the network's own objective, which takes the place of both.
    """

    winners: int
    ewta: float
    nll: float
    objective: str = ""

    @property
    def name(self) -> str:
        """Short text for the log."""
        if self.objective:
            return self.objective
        if self.nll == 0.0:
            return f"EWTA({self.winners})"
        if self.ewta == 0.0:
            return "NLL"
        return f"{self.ewta:.2f} EWTA(1) + {self.nll:.2f} NLL"


def loss_weights(
    epoch: int, total_epochs: int, modes: int, warm_up_share: float = WARM_UP_SHARE
) -> LossWeights:
    """Return the loss weights of epoch n (counted from 0) by Algorithm 1 of the paper.

    EWTA alone for n < V = W / 2 with K = ceil(M (V - n) / V) winners, then a blend with
    beta = (W - n) / (W - V) until W = ``warm_up_share`` * total, then NLL alone.

    Args:
        epoch: n.
        total_epochs: length of the training.
        modes: M.
        warm_up_share: W / total; 0 for NLL alone from the start.

    Raises:
        ConfigurationError: ``total_epochs`` or ``modes`` is below 1.
    """
    if total_epochs < 1 or modes < 1:
        raise ConfigurationError(
            f"the schedule is given {total_epochs} epochs and {modes} modes, expected at least 1"
        )
    warm_up_epochs = warm_up_share * total_epochs
    ewta_epochs = 0.5 * warm_up_epochs
    if epoch < ewta_epochs:
        winners = math.ceil(modes * (ewta_epochs - epoch) / ewta_epochs)
        return LossWeights(winners=winners, ewta=1.0, nll=0.0)
    if epoch < warm_up_epochs:
        beta = (warm_up_epochs - epoch) / (warm_up_epochs - ewta_epochs)
        return LossWeights(winners=1, ewta=beta, nll=1.0 - beta)
    return LossWeights(winners=1, ewta=0.0, nll=1.0)


def learning_rate(
    step: int,
    progress: float,
    *,
    peak: float,
    schedule: str = "cosine",
    warmup_steps: int = 0,
    floor: float = 0.02,
) -> float:
    """Return the learning rate of an optimisation step.

    Args:
        step: the step, counted from 0.
        progress: completed share of the whole training, 0 to 1.
        peak: the largest rate.
        schedule: ``cosine`` falls from ``peak`` to ``floor * peak``; ``constant`` stays at
            ``peak``.
        warmup_steps: steps of the linear rise to ``peak`` at the start.
        floor: share of ``peak`` at the end.

    Raises:
        ConfigurationError: an unknown schedule.
    """
    if schedule not in LEARNING_RATE_SCHEDULES:
        raise ConfigurationError(
            f"the learning-rate schedule is {schedule!r}, expected one of "
            + ", ".join(repr(s) for s in LEARNING_RATE_SCHEDULES)
        )
    if step < warmup_steps:
        return peak * (step + 1) / warmup_steps
    if schedule == "constant":
        return peak
    return peak * (floor + (1.0 - floor) * 0.5 * (1.0 + math.cos(math.pi * min(1.0, progress))))
