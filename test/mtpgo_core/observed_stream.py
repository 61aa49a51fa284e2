# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A stream of observations and predictions, as the node's quality sees it."""

import dataclasses

import numpy as np

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.quality.outcome_matcher import OutcomeMatcher
from mtpgo_core.quality.prediction_memory import MemoryLimits
from mtpgo_core.schema import AgentClass, Source, tracked_states
from mtpgo_core.task.task_description import HistoryConfig

S_NS = 1_000_000_000
STEPS = 25
LIMITS = MemoryLimits()
PREDICTED = ("heaviest_mean", "cv_mean")
"""Taken from the memory at once, because later predictions replace them there."""


class Stream:
    """A history and a matcher that are fed as the node feeds them."""

    def __init__(self, limits=LIMITS, steps=STEPS):
        config = HistoryConfig()
        self.history = TrackHistory(config)
        self.matcher = OutcomeMatcher(config, limits)
        self.steps = steps
        self.found = []

    def observe(
        self, time_s, positions, *, frame="map", velocity=(10.0, 0.0), agent_class=AgentClass.CAR
    ):
        """Observe road users, by number; return the outcomes."""
        n = len(positions)
        states = tracked_states(
            round((100 + time_s) * S_NS),
            frame,
            keys_from_integers(list(positions)),
            np.array(list(positions.values()), dtype=float).reshape(n, 2),
            velocity=np.tile(velocity, (n, 1)),
            agent_class=np.full(n, agent_class, dtype=np.uint8),
        )
        report = self.history.update(states)
        outcomes = self.matcher.update(self.history, report)
        vars(outcomes).update({k: getattr(outcomes, k) for k in PREDICTED})
        self.found.append(outcomes)
        return outcomes

    def predict(self, offset_m=0.0, modes=2, source=Source.MODEL):
        """Publish constant velocity, ``offset_m`` to the left, from the newest observation."""
        window = self.history.window()
        window = window.select(window.valid[:, -1])
        cv = predict_constant_velocity(window, horizon_steps=self.steps, dt_s=0.2, modes=modes)
        mean = cv.mean.copy()
        mean[..., 1] += offset_m
        source = np.full(len(cv), source, dtype=np.uint8)
        self.matcher.add(dataclasses.replace(cv, mean=mean, source=source), window)

    def drive(self, times_s, *, predict_at=(), offset_m=0.0):
        """One car at 10 m/s along x, observed at each time."""
        for time_s in times_s:
            self.observe(time_s, {1: (10.0 * time_s, 0.0)})
            if any(abs(time_s - t) < 1e-9 for t in predict_at):
                self.predict(offset_m)

    def rows(self, name):
        return np.concatenate([getattr(o, name) for o in self.found])

    @property
    def unknown(self):
        return {cause: n for cause, n in self.matcher.unknown.items() if n}
