# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The time that a training may take: a schedule that fits, and an end in time for a validation."""

from __future__ import annotations

import copy
import logging
import time
from collections.abc import Callable

from mtpgo_training.training.data_loading import Scenes
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.trial.epoch_cost import TRIAL_S, EpochCost, measure_epoch
from mtpgo_training.training.trial.schedule_plan import Budget, SchedulePlan, fit_schedule

PLANNED_SHARE = 0.9
"""Share of the time left that the schedule is made for. Chosen: only a few steps are measured, and
a training that is cut off has not come to the end of its schedule."""

TRIAL_SHARE = 0.04
"""Largest share of the time left for the measured steps of each loss; chosen."""

MEASURED_AT = 0.25
"""Share of the time after which a validation is timed, if there was none before; chosen."""

CHECKPOINT_S = 0.3
"""Reserved for writing the last checkpoint (s); chosen: the networks have a few MB."""

_log = logging.getLogger("mtpgo")


class TimeLimit:
    """Tells when a training has to end so that its last validation still fits.

    Args:
        minutes: limit (min), None for none.
        started_s: ``time.monotonic()`` from which it counts, by default now.
    """

    def __init__(self, minutes: float | None, started_s: float | None = None) -> None:
        self._limit_s = None if minutes is None else 60.0 * minutes
        self._started_s = time.monotonic() if started_s is None else started_s
        self._validation_s: float | None = None

    @property
    def is_set(self) -> bool:
        """Whether there is a limit."""
        return self._limit_s is not None

    @property
    def left_s(self) -> float:
        """Time left (s), negative after the end; infinite without a limit."""
        if self._limit_s is None:
            return float("inf")
        return self._started_s + self._limit_s - time.monotonic()

    def count_validation(self, seconds: float) -> None:
        """Note how long a validation took (s); the longest one counts."""
        self._validation_s = max(seconds, self._validation_s or 0.0)

    def is_up(self, measure: Callable[[], float]) -> bool:
        """Return whether the training has to end now.

        Args:
            measure: returns how long a validation takes (s); called at most once, and only if none
                was counted before a quarter of the time is over.
        """
        if self._limit_s is None:
            return False
        if self._validation_s is None:
            if self.left_s > 0.0 and self.left_s > (1.0 - MEASURED_AT) * self._limit_s:
                return False
            self._validation_s = measure() if self.left_s > 0.0 else 0.0
        return self.left_s < self._validation_s + CHECKPOINT_S


def plan_for_time(
    run: TrainingRun, scenes: Scenes, left_s: float, processes: int = 1
) -> SchedulePlan:
    """Return the schedule of a training that fits into the time left, validations included.

    Args:
        run: at its start; it does not change.
        scenes: of the training.
        left_s: time left (s).
        processes: number of processes that share each batch and each validation.
    """
    started_s = time.monotonic()
    trial = TrainingRun(copy.deepcopy(run.model), run.config)
    cost = measure_epoch(
        trial, scenes, time.monotonic, trial_s=min(TRIAL_S, max(0.0, TRIAL_SHARE * left_s))
    )
    shared = EpochCost(
        cost.ewta / processes,
        cost.likelihood / processes,
        cost.validation / processes,
        cost.scenes,
    )
    total_s = PLANNED_SHARE * max(0.0, left_s - (time.monotonic() - started_s))
    if shared.validation > total_s:
        _log.warning(
            "mtpgo: a validation takes about %.0f s, and --minutes leaves %.0f s: the training "
            "ends after a few steps and its validation later than the limit",
            shared.validation,
            total_s,
        )
    return fit_schedule(shared, total_s, run.config, Budget(minutes=total_s / 60.0))


def plan_text(plan: SchedulePlan, epochs: int, minutes: float) -> str:
    """Return a plan in words.

    Args:
        plan: the schedule.
        epochs: of the configuration.
        minutes: the time that it is made for (min).
    """
    share = "" if plan.share >= 1.0 else f", each with {plan.share:.0%} of the windows"
    every = plan.validate_every_epochs
    validated = "" if every == 1 else f", validated every {every}"
    number = f"{plan.epochs} of {epochs}" if plan.epochs != epochs else f"all {epochs}"
    return f"plan       {number} epochs{share}{validated}, for {minutes:g} min in all"
