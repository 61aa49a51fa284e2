# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Algorithm 1 of the paper: which loss counts how much in which epoch; and the learning rate."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mtpgo_core.errors import ConfigurationError

LEARNING_RATE_SCHEDULES = ("cosine", "constant")


@dataclass(frozen=True)
class Objective:
    """The loss of one epoch: ``ewta_weight * EWTA(winners) + nll_weight * NLL``.

    Attributes:
        winners: K, components that are drawn to the truth.
        ewta_weight: 1, then beta, then 0.
        nll_weight: 0, then 1 - beta, then 1.
    """

    winners: int
    ewta_weight: float
    nll_weight: float

    @property
    def name(self) -> str:
        """Short text for the log."""
        if self.nll_weight == 0.0:
            return f"EWTA({self.winners})"
        if self.ewta_weight == 0.0:
            return "NLL"
        return f"{self.ewta_weight:.2f} EWTA(1) + {self.nll_weight:.2f} NLL"


def objective(epoch: int, total_epochs: int, modes: int) -> Objective:
    """The objective of epoch n (counted from 0) out of ``total_epochs`` with M ``modes``.

    EWTA alone for n < V = total / 8 with K = ceil(M (V - n) / V) winners, then a blend with
    beta = (W - n) / (W - V) until W = total / 4, then NLL alone (algorithm scheduling).

    Raises:
        ConfigurationError: ``total_epochs`` or ``modes`` below 1.
    """
    if total_epochs < 1 or modes < 1:
        raise ConfigurationError(
            f"the schedule is given {total_epochs} epochs and {modes} modes, expected at least 1"
        )
    winner_epochs, warm_epochs = total_epochs / 8.0, total_epochs / 4.0
    if epoch < winner_epochs:
        winners = math.ceil(modes * (winner_epochs - epoch) / winner_epochs)
        return Objective(winners=winners, ewta_weight=1.0, nll_weight=0.0)
    if epoch < warm_epochs:
        beta = (warm_epochs - epoch) / (warm_epochs - winner_epochs)
        return Objective(winners=1, ewta_weight=beta, nll_weight=1.0 - beta)
    return Objective(winners=1, ewta_weight=0.0, nll_weight=1.0)


def learning_rate(
    step: int,
    done: float,
    *,
    peak: float,
    schedule: str = "cosine",
    warmup_steps: int = 0,
    floor: float = 0.02,
) -> float:
    """Learning rate of an optimisation step (counted from 0).

    Args:
        step: the step.
        done: share of the whole training that lies behind, 0 to 1.
        peak: the largest rate.
        schedule: ``cosine`` falls from ``peak`` to ``floor * peak``; ``constant`` stays.
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
    return peak * (floor + (1.0 - floor) * 0.5 * (1.0 + math.cos(math.pi * min(1.0, done))))
