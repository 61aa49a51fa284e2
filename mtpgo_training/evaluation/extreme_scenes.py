# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The best and the worst predictions of an evaluation, found while it runs.

Best is where the most was gained over constant velocity (its ADE less the model's), so that nobody
is shown who just drove on; worst is the largest ADE. Only road users observed for the whole
horizon and predicted by the model itself are considered, each one once; for the best, only those
that had been observed for ``PAST_S``, so that there is a past to be seen.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mtpgo_core.schema import BoolArray, Float64Array, Prediction, Source
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.metrics import Array
from mtpgo_training.evaluation.moments import Moment, choose

PAST_S = 2.0
"""Time for which who is shown as best had been observed (s)."""

_KEPT = 12
"""Candidates of each kind that are kept: enough to choose different ones from."""

Candidates = dict[tuple[str, bytes], Moment]


@dataclass
class SceneKeeper:
    """The candidates so far."""

    _best: Candidates = field(default_factory=dict)
    _worst: Candidates = field(default_factory=dict)

    def offer(
        self,
        recording: Recording,
        prediction: Prediction,
        rows: BoolArray,
        mask: BoolArray,
        ade: Array,
        cv_ade: Float64Array,
        age_s: Float64Array,
    ) -> None:
        """Look at one prediction.

        Args:
            recording: what was predicted.
            prediction: every agent must be in the recording.
            rows: [n] which of its agents were scored.
            mask: [rows, H] observed.
            ade: [rows] (m).
            cv_ade: [rows] constant velocity's (m).
            age_s: [rows] time since the recording first shows the road user (s).
        """
        agents = np.flatnonzero(rows)
        usable = mask.all(axis=1) & (prediction.source[agents] == Source.MODEL)
        usable &= np.isfinite(ade) & np.isfinite(cv_ade)
        old = age_s >= PAST_S - 1e-6
        for held, value in ((self._best, np.where(old, cv_ade - ade, -1.0)), (self._worst, ade)):
            worth = np.where(usable, value, -np.inf)
            if not len(worth) or worth.max() <= 0.0:
                continue
            i = int(np.argmax(worth))
            agent = int(agents[i])
            key = (recording.name, prediction.key[agent].tobytes())
            if key in held and held[key].interest >= worth[i]:
                continue
            note = f"ADE {ade[i]:.2f} m, constant velocity {cv_ade[i]:.2f} m"
            held[key] = Moment(recording, prediction, agent, float(worth[i]), note)
            _thin(held)

    def merge(self, other: SceneKeeper) -> None:
        """Take the candidates of another keeper in."""
        for held, more in ((self._best, other._best), (self._worst, other._worst)):
            for key, moment in more.items():
                if key not in held or held[key].interest < moment.interest:
                    held[key] = moment
                    _thin(held)

    def best(self, count: int) -> list[Moment]:
        """Where the model gained the most over constant velocity, of different recordings."""
        return choose(list(self._best.values()), count)

    def worst(self, count: int) -> list[Moment]:
        """Where its ADE is the largest, of different recordings."""
        return choose(list(self._worst.values()), count)


def _thin(held: Candidates) -> None:
    """Drop the least of too many, rather of a recording that has several."""
    if len(held) <= _KEPT:
        return
    names = [name for name, _ in held]
    least = min(held, key=lambda key: (names.count(key[0]) <= 2, held[key].interest))
    del held[least]
