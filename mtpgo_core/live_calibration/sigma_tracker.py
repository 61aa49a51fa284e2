# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Factors on standard deviations that follow how often ellipses missed the truth.

The rule is adaptive conformal inference (Gibbs and Candes, 2021) on the logarithm of the factor,
as a quantile tracker (Angelopoulos, Candes and Tibshirani, 2023): log f += rate (missed - alpha)
for each level. docs/design.md ("Live calibration") has the argument for its long-run coverage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.track_limits import TrackLimits
from mtpgo_core.quality.metrics import radius_squared
from mtpgo_core.schema import Float64Array, IndexArray
from mtpgo_core.task.calibration import GROUPS, MOTIONS

LEVELS = (0.5, 0.9)
"""Shares of the truth that the tracked ellipses shall hold."""

SOURCES = 2
"""Predictors with factors of their own: the model and constant velocity, numbered as
:class:`~mtpgo_core.schema.Source`."""

SIGMA_LIMITS = (0.2, 8.0)
"""Smallest and largest factor on a standard deviation; chosen: a larger correction would hide a
model that does not work."""

POOLS = len(GROUPS) - len(MOTIONS)
"""Position of the first of the groups ``any``, which learn from the road users of all classes."""

POOL_OF = POOLS + np.arange(len(GROUPS)) % len(MOTIONS)
"""[groups] position of the group ``any`` of the same motion."""

_RADIUS = np.array([radius_squared(level) for level in LEVELS])
_ALPHA = 1.0 - np.array(LEVELS)
_LOW, _HIGH = np.log(SIGMA_LIMITS)

_AGENTS_S = 20.0
"""Time over which road users of a group are counted (s); chosen: about a track's length."""

_IDLE_S = 10.0
"""Time without outcomes after which a group forgets (s); chosen: twice the horizon."""

_FEW_AGENTS = 10.0
"""Road users present below which each of them may change more; chosen."""


@dataclass(frozen=True)
class SquaredErrors:
    """Squared Mahalanobis errors of m steps of predictions.

    Attributes:
        track: [m] numbers of tracks.
        group: [m] positions in :data:`~mtpgo_core.task.calibration.GROUPS`.
        step: [m] horizon steps.
        cycle: [m] number that identifies the prediction of a row.
        span_s: [m] time from this prediction to the next one, for which it counts (s).
        squared: [m, SOURCES] squared Mahalanobis distance of the truth with the covariances of
            the shipped calibration, NaN where a source did not predict.
        shipped_50: [m, SOURCES] logarithms of the factors for the 50 % ellipses of the shipped
            calibration.
        own: [m, SOURCES, LEVELS] logarithms of the factors of the row's group when it was served.
        pool: [m, SOURCES, LEVELS] the same of its group ``any``.
    """

    track: NDArray[np.int64]
    group: IndexArray
    step: IndexArray
    cycle: IndexArray
    span_s: Float64Array
    squared: Float64Array
    shipped_50: Float64Array
    own: Float64Array
    pool: Float64Array


class SigmaTracker:
    """The factors by source, level, group and horizon step.

    Args:
        options: rates and limits; may be replaced.
        steps: H.

    Attributes:
        log_sigma: [SOURCES, LEVELS, groups, H] logarithms of the factors on the standard
            deviation: how far the ellipses of each level are from those of the shipped
            calibration.
        agents: [groups, H] road users per prediction whose outcomes come at present.
    """

    def __init__(self, options: LiveOptions, steps: int) -> None:
        self.options = options
        groups = len(GROUPS)
        self.log_sigma = np.zeros((SOURCES, len(LEVELS), groups, steps))
        self._limits = TrackLimits(2 * self.log_sigma[:, :, 0].size)
        self._agent_s = np.zeros((groups, steps))
        self._span_s = np.zeros(steps)
        self._idle_s = np.full((groups, steps), np.inf)

    @property
    def agents(self) -> Float64Array:
        """[groups, H], see the class."""
        return self._agent_s / np.maximum(self._span_s, 1e-9)

    def pass_time(self, seconds: float) -> None:
        """Let the factors of groups without outcomes decay to those of their parent group.

        Args:
            seconds: time since the last call (s).
        """
        self._limits.pass_time(seconds, self.options.track_memory_s)
        self._idle_s += seconds
        share = 1.0 - math.exp(-seconds / self.options.memory_s)
        dependence = 1.0 - self._independence()
        self.log_sigma = self.log_sigma + share * dependence * (self._parents() - self.log_sigma)

    def update(self, errors: SquaredErrors) -> None:
        """Move the factors by the outcomes of one observation."""
        if not len(errors.track):
            return
        self._count(errors)
        change = self._changes(errors)
        weight = self._independence()[:POOLS]
        change[:, :, :POOLS] = weight * change[:, :, :POOLS]
        change[:, :, :POOLS] += (1.0 - weight) * change[:, :, POOL_OF[:POOLS]]
        change[:, 1] += self.options.coupling * change[:, 0]
        self.log_sigma = np.clip(self.log_sigma + change, _LOW, _HIGH)

    def _changes(self, errors: SquaredErrors) -> Float64Array:
        """Return [SOURCES, LEVELS, groups, H] changes, each by the outcomes of its own group.

        The rule is log f += rate (missed - alpha), averaged over the road users of the group and
        limited for each track.
        """
        pool = POOL_OF[errors.group]
        m, steps = len(errors.track), self.log_sigma.shape[-1]
        # [2, m]: each row counts for its own group and for the group ``any``, and only once where
        # both are the same (class unknown).
        group = np.stack([errors.group, pool])
        counts = np.stack([errors.group < POOLS, np.ones(m, dtype=np.bool_)])
        agents = self.agents[group, errors.step]
        size = errors.span_s / np.maximum(agents, self.options.least_agents)
        limit = self._track_limits()[group, errors.step]
        # [2, m, SOURCES, LEVELS]
        served = np.stack([errors.own, errors.pool])
        # [m, SOURCES, LEVELS], in units of the shipped ellipse of each level
        squared = np.repeat(errors.squared[:, :, None], len(LEVELS), axis=2)
        squared[:, :, 0] *= np.exp(-2.0 * errors.shipped_50)
        with np.errstate(invalid="ignore"):
            missed = squared > _RADIUS * np.exp(2.0 * served)
        rate = np.array([self.options.rate_50, self.options.rate_90])
        wanted = rate * size[:, :, None, None] * (missed - _ALPHA)
        rows = np.broadcast_to(counts[:, :, None, None] & np.isfinite(squared), wanted.shape)
        kind, row, source, level = np.nonzero(rows)
        step = errors.step[row]
        place = ((kind * SOURCES + source) * len(LEVELS) + level) * steps + step
        tracks, of_track = np.unique(errors.track, return_inverse=True)
        granted = self._limits.limited(
            tracks, of_track[row], place, wanted[rows], limit[kind, row]
        )
        shape = self.log_sigma.shape
        cell = ((source * shape[1] + level) * shape[2] + group[kind, row]) * steps + step
        change = np.bincount(cell, granted, self.log_sigma.size).astype(np.float64)
        return change.reshape(shape)

    def _track_limits(self) -> Float64Array:
        """Return [groups, H] the largest change of a logarithm by a single track.

        It depends on the number of all moving road users, not on that of the group: among thirty
        road users, one of few pedestrians may change as much as one of many cars. For standing
        groups all road users count, since any of them may stand for a moment.
        """
        standing, moving = self.agents[POOLS:]
        present = np.maximum([standing + moving, moving], 1.0)
        limit = self.options.track_limit * np.maximum(1.0, _FEW_AGENTS / present)
        return np.asarray(limit[POOL_OF - POOLS])

    def _count(self, errors: SquaredErrors) -> None:
        """Count road users per prediction, by group and step."""
        groups, steps = self._agent_s.shape
        group = np.concatenate([errors.group, POOL_OF[errors.group]])
        both = np.concatenate([errors.group < POOLS, np.ones(len(errors.group), dtype=bool)])
        cell = (group * steps + np.tile(errors.step, 2))[both]
        came = np.bincount(cell, np.tile(errors.span_s, 2)[both], groups * steps)
        came = came.reshape(groups, steps)
        pairs = np.stack([errors.cycle, errors.step], axis=1)
        _, first = np.unique(pairs, axis=0, return_index=True)
        passed = np.bincount(errors.step[first], errors.span_s[first], steps)
        decay = np.exp(-passed / _AGENTS_S)
        self._agent_s = self._agent_s * decay + came
        self._span_s = self._span_s * decay + passed
        self._idle_s[came > 0.0] = 0.0

    def _independence(self) -> Float64Array:
        """Return [groups, H] weight of a group's own outcomes: 1 for enough, 0 for none."""
        enough = np.minimum(1.0, self.agents / self.options.least_agents)
        enough[POOLS:] = 1.0
        return np.where(self._idle_s > _IDLE_S, 0.0, enough)

    def _parents(self) -> Float64Array:
        """Return the factors that groups without outcomes fall back to (as ``log_sigma``)."""
        parents = np.zeros_like(self.log_sigma)
        parents[:, :, :POOLS] = self.log_sigma[:, :, POOL_OF[:POOLS]]
        return parents
