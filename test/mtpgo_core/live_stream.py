# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Made-up errors of predictions, as a live calibration gets them."""

from __future__ import annotations

import numpy as np

from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.sigma_tracker import POOLS, SigmaTracker, SquaredErrors
from mtpgo_core.quality.metrics import radius_squared

STEPS, DT_S, GROUP = 2, 0.4, 1
OPTIONS = LiveOptions()


class ErrorStream:
    """Road users whose errors, in units of the shipped covariance, last for about two seconds.

    Args:
        shipped_50: factor on sigma for the 50 % ellipses that the model's file has.

    Attributes:
        tracker: learns from them at once, as if the horizon were short.
        inside: [cycles, 2] share of the truths in the 50 % and the 90 % ellipses.
    """

    def __init__(self, agents=30, seed=0, options=OPTIONS, group=GROUP, shipped_50=1.0):
        self.shipped_50 = np.array([shipped_50, 1.0])
        self.tracker = SigmaTracker(options, STEPS)
        self.rng = np.random.default_rng(seed)
        self.error = self.rng.normal(size=(agents, 2))
        self.tail = np.ones(agents)
        self.group = np.full(agents, group)
        self.number = 0
        self.inside = []
        self.log = []

    def run(self, seconds, scale=1.0, erratic=(), heavy=False, predicted=True):
        """Let time pass; ``scale`` multiplies the errors, ``erratic`` road users always miss."""
        keep = np.exp(-DT_S / 2.0)
        for _ in range(round(seconds / DT_S)):
            fresh = self.rng.normal(size=self.error.shape)
            self.error = keep * self.error + np.sqrt(1 - keep**2) * fresh
            if heavy and self.number % 25 == 0:
                self.tail = self.rng.chisquare(3, size=len(self.tail)) / 3
            squared = scale**2 * (self.error**2).sum(axis=1) / (self.tail if heavy else 1.0)
            squared[list(erratic)] = 1e4
            self._observe(squared, predicted)

    def _observe(self, squared, predicted):
        n = len(squared)
        track = np.repeat(np.arange(n), STEPS)
        step = np.tile(np.arange(STEPS), n)
        group = np.repeat(self.group, STEPS)
        table = self.tracker.log_sigma
        both = np.stack([np.repeat(squared, STEPS)] * 2, axis=1)
        if not predicted:
            both[:, 0] = np.nan
        own = table[:, :, group, step].transpose(2, 0, 1)
        radius = self.shipped_50**2 * [radius_squared(0.5), radius_squared(0.9)]
        inside = [
            (squared <= radius[i] * np.exp(2 * table[0, i, self.group, 0])).mean()
            for i in range(2)
        ]
        self.inside.append(inside)
        self.log.append(table[0, :, GROUP])
        self.tracker.pass_time(DT_S)
        self.tracker.update(
            SquaredErrors(
                track=track,
                group=group,
                step=step,
                cycle=np.full(n * STEPS, self.number),
                span_s=np.full(n * STEPS, DT_S),
                squared=both,
                shipped_50=np.tile(np.log([self.shipped_50[0], 1.0]), (n * STEPS, 1)),
                own=own,
                pool=table[:, :, POOLS + group % 2, step].transpose(2, 0, 1),
            )
        )
        self.number += 1

    def coverage(self, seconds):
        """Shares inside the 50 % and 90 % ellipses over the last seconds."""
        return np.mean(self.inside[-round(seconds / DT_S) :], axis=0)

    def sigma(self, source=0, level=1, group=GROUP):
        """[H] factors on sigma."""
        return np.exp(self.tracker.log_sigma[source, level, group])
