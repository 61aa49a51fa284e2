# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The best and the worst predictions of an evaluation, collected while it runs.

Best is where the model gains the most over constant velocity (its ADE minus the model's), so that
agents that just drive on are not shown; worst is the largest ADE. Only agents observed for the
whole horizon and predicted by the model itself are considered, each one once; for the best, only
those that had been observed for ``PAST_S``, so that the picture shows a past.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mtpgo_core.schema import Float64Array, Prediction, Source
from mtpgo_training.evaluation.moments import Moment, choose
from mtpgo_training.evaluation.scorer import ScoredPrediction, Scorer

PAST_S = 2.0
"""Time for which an agent shown as best had been observed (s); chosen: its past can be seen."""

_KEPT = 12
"""Candidates of each kind that are kept; chosen: enough for pictures of different sites."""

Candidates = dict[tuple[str, int], Moment]
"""By recording and track."""


@dataclass
class ExtremeScenes:
    """The candidates so far."""

    _best: Candidates = field(default_factory=dict)
    _worst: Candidates = field(default_factory=dict)

    def update(
        self,
        scorer: Scorer,
        prediction: Prediction,
        scored: ScoredPrediction,
        cv_ade: Float64Array,
    ) -> None:
        """Consider the agents of one prediction.

        Args:
            scorer: of the recording.
            prediction: every scored agent must be in the recording.
            scored: its scores.
            cv_ade: [scored agents] ADE of constant velocity (m).
        """
        agents = np.flatnonzero(scored.rows)
        ade = scored.scores.values["ade"]
        usable = scored.truth.mask.all(axis=1)
        usable &= prediction.source[agents] == Source.MODEL
        usable &= np.isfinite(ade) & np.isfinite(cv_ade)
        track = scored.truth.agents.track
        age_s = scorer.age_s(track, prediction.stamp_ns)
        gain = np.where(age_s >= PAST_S - 1e-6, cv_ade - ade, -1.0)
        for held, value in ((self._best, gain), (self._worst, ade)):
            interest = np.where(usable, value, -np.inf)
            if not len(interest) or interest.max() <= 0.0:
                continue
            i = int(np.argmax(interest))
            agent = int(agents[i])
            key = (scorer.recording.name, int(track[i]))
            if key in held and held[key].interest >= interest[i]:
                continue
            note = f"ADE {ade[i]:.2f} m, constant velocity {cv_ade[i]:.2f} m"
            held[key] = Moment(
                scorer.recording, prediction, agent, float(interest[i]), note, scorer.site
            )
            _thin(held)

    def merge(self, other: ExtremeScenes) -> None:
        """Take in the candidates of another process."""
        for held, more in ((self._best, other._best), (self._worst, other._worst)):
            for key, moment in more.items():
                if key not in held or held[key].interest < moment.interest:
                    held[key] = moment
                    _thin(held)

    def best(self, count: int) -> list[Moment]:
        """Return where the model gains the most over constant velocity, at different sites."""
        return choose(list(self._best.values()), count)

    def worst(self, count: int) -> list[Moment]:
        """Return where its ADE is the largest, at different sites."""
        return choose(list(self._worst.values()), count)


def _thin(held: Candidates) -> None:
    """Drop the least interesting of too many, preferably of a recording that has several."""
    if len(held) <= _KEPT:
        return
    names = [name for name, _ in held]
    least = min(held, key=lambda key: (names.count(key[0]) <= 2, held[key].interest))
    del held[least]
