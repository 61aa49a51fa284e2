# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A bounded ring of the last predictions, each kept until its horizon has passed."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.resampling import TOLERANCE_NS
from mtpgo_core.options import check_options, option
from mtpgo_core.schema import BoolArray, Float32Array, Float64Array, IndexArray

_NEVER_NS = np.iinfo(np.int64).max
_MORE_AGENTS = 16
"""Room for agents at first, and how much is added on demand; chosen."""

_BY_AGENT = (
    "step",
    "row",
    "number",
    "group",
    "source",
    "heaviest",
    "weight",
    "origin",
    "offset",
    "covariance",
    "cv_mean",
    "cv_covariance",
    "sigma_factor_50",
    "_known_steps",
    "_error_sum",
)
"""Arrays with an axis of agents, after that of cycles."""


@dataclass(frozen=True)
class MemoryLimits:
    """Bounds of the memory of predictions; 20 MB at the defaults with a horizon of 25 steps.

    Attributes:
        agents: most agents of a cycle, those that the model predicted first.
        cycles: most cycles. Chosen: 25 of 0.2 s fill a horizon of 5 s, three wait for tracks that
            are not observed for a moment, and four more let the times of cycles jitter. Of
            predictions that come faster, as many are left out as needed.
        modes: most modes of an agent, the heaviest.
    """

    agents: int = option(128, low=1)
    cycles: int = option(32, low=1)
    modes: int = option(8, low=1)

    def __post_init__(self) -> None:
        check_options(self, "memory.")

    def spacing_s(self, horizon_s: float, max_gap_s: float) -> float:
        """Return the smallest time between two predictions that are both kept (s).

        Args:
            horizon_s: how far they reach (s).
            max_gap_s: how long the truth of a step may come after it (s).
        """
        return (horizon_s + max_gap_s) / self.cycles


@dataclass(frozen=True)
class KeptPrediction:
    """The stored part of the prediction of one instant, for n agents.

    Attributes:
        stamp_ns: time of the observation that it starts from (ns).
        time_s: [H] seconds after ``stamp_ns``.
        row: [n] positions of the agents in the published prediction.
        number: [n] numbers of the tracks.
        group: [n] calibrated groups.
        source: [n] :class:`~mtpgo_core.schema.Source` values.
        weight: [n, M]. mean: [n, M, H, 2] (m). covariance: [n, M, H, 2, 2] (m^2).
        sigma_factor_50: [n, H] of the 50 % ellipses.
        cv_mean: [n, H, 2] constant velocity (m).
        cv_covariance: [n, H, 2, 2] its covariance (m^2).
    """

    stamp_ns: int
    time_s: Float64Array
    row: IndexArray
    number: NDArray[np.int64]
    group: NDArray[np.uint8]
    source: NDArray[np.uint8]
    weight: Float64Array
    mean: Float64Array
    covariance: Float64Array
    sigma_factor_50: Float64Array
    cv_mean: Float64Array
    cv_covariance: Float64Array


class PredictionMemory:
    """Ring of up to ``limits.cycles`` predictions.

    Weights, means and covariances are kept in float32, the means relative to a place near them: at
    UTM coordinates float32 has a grid of 0.5 m. Constant velocity is kept in float64. A step of an
    agent is resolved once, in the order of time.

    Args:
        limits: bounds.
        max_gap_s: how long the truth of a step may come after it (s).

    Attributes:
        next_ns: earliest time of a step that is not due yet (ns).
        left_out: number of predictions of agents for which there was no room.

    The arrays have the axes C cycles, A agents, H steps, M modes; ``step`` [C, A] is the next step
    to resolve, H where there is none.
    """

    def __init__(self, limits: MemoryLimits, max_gap_s: float) -> None:
        self._limits, self._max_gap_s = limits, max_gap_s
        self.left_out = 0
        self._allocate(1, 1)

    def _allocate(self, modes: int, steps: int) -> None:
        cycles, agents = self._limits.cycles, min(_MORE_AGENTS, self._limits.agents)
        self._count = 0
        self._last_ns: int | None = None
        self.next_ns = _NEVER_NS
        self.stamp_ns = np.zeros(cycles, dtype=np.int64)
        self.time_s = np.zeros((cycles, steps))
        self._target_ns = np.full((cycles, steps + 1), _NEVER_NS, dtype=np.int64)
        self.step = np.full((cycles, agents), steps, dtype=np.intp)
        self.row = np.zeros((cycles, agents), dtype=np.intp)
        self.number = np.full((cycles, agents), -1, dtype=np.int64)
        self.group = np.zeros((cycles, agents), dtype=np.uint8)
        self.source = np.zeros((cycles, agents), dtype=np.uint8)
        self.heaviest = np.zeros((cycles, agents), dtype=np.intp)
        self.weight: Float32Array = np.zeros((cycles, agents, modes), dtype=np.float32)
        self.origin = np.zeros((cycles, agents, 2))
        self.offset: Float32Array = np.zeros((cycles, agents, modes, steps, 2), dtype=np.float32)
        self.covariance: Float32Array = np.zeros(
            (cycles, agents, modes, steps, 3), dtype=np.float32
        )
        self.sigma_factor_50: Float32Array = np.ones((cycles, agents, steps), dtype=np.float32)
        self.cv_mean = np.zeros((cycles, agents, steps, 2))
        self.cv_covariance: Float32Array = np.zeros((cycles, agents, steps, 3), dtype=np.float32)
        self._known_steps = np.zeros((cycles, agents), dtype=np.intp)
        self._error_sum = np.zeros((cycles, agents, 2))

    @property
    def bytes(self) -> int:
        """Size of all arrays (bytes)."""
        return sum(v.nbytes for v in vars(self).values() if isinstance(v, np.ndarray))

    @property
    def open_steps(self) -> int:
        """Number of steps of agents that are not resolved."""
        return int((self.time_s.shape[1] - self.step).sum())

    def clear(self) -> None:
        """Forget all predictions."""
        self.step[:] = self.time_s.shape[1]
        self.number[:] = -1
        self._last_ns = None
        self.next_ns = _NEVER_NS

    def add(self, new: KeptPrediction) -> bool:
        """Keep a prediction; return false if it is left out, too soon after the last one."""
        modes, steps = new.mean.shape[1:3]
        room, length = self.offset.shape[2:4]
        if steps != length and len(new.number):
            self._allocate(modes, steps)
        elif modes > room and len(new.number):
            self._make_room_for(modes)
        elif modes < room:
            new = _with_modes(new, room)
        if len(new.time_s) == 0:
            return True
        spacing_ns = 1e9 * self._limits.spacing_s(float(new.time_s[-1]), self._max_gap_s)
        if self._last_ns is not None and new.stamp_ns - self._last_ns < spacing_ns:
            return False
        self._last_ns = new.stamp_ns
        chosen = self._choose(new)
        n = len(chosen)
        rows = slice(None) if n == len(new.number) else chosen  # a slice is not copied
        if n == 0:
            return True
        if n > self.number.shape[1]:
            self._grow(min(-(-n // _MORE_AGENTS) * _MORE_AGENTS, self._limits.agents))
        c = self._count % self._limits.cycles
        self._count += 1
        self.stamp_ns[c] = new.stamp_ns
        self.time_s[c] = new.time_s
        # Rounded to microseconds: in messages the times are float32.
        self._target_ns[c, :-1] = new.stamp_ns + 1000 * np.rint(1e6 * new.time_s).astype(np.int64)
        self.step[c] = steps
        self.number[c] = -1
        self.step[c, :n] = 0
        self.row[c, :n] = new.row[rows]
        self.number[c, :n] = new.number[rows]
        self.group[c, :n], self.source[c, :n] = new.group[rows], new.source[rows]
        self.weight[c, :n] = new.weight[rows]
        self.heaviest[c, :n] = new.weight[rows].argmax(axis=1)
        self.origin[c, :n] = new.cv_mean[rows, 0]
        self.offset[c, :n] = new.mean[rows] - new.cv_mean[rows, 0][:, None, None]
        self.sigma_factor_50[c, :n] = new.sigma_factor_50[rows]
        self.cv_mean[c, :n] = new.cv_mean[rows]
        for i, element in enumerate(((0, 0), (0, 1), (1, 1))):
            self.covariance[c, :n, ..., i] = new.covariance[rows][..., *element]
            self.cv_covariance[c, :n, ..., i] = new.cv_covariance[rows][..., *element]
        self._known_steps[c] = 0
        self._error_sum[c] = 0.0
        self.next_ns = min(self.next_ns, int(self._target_ns[c, 0]))
        return True

    def _choose(self, new: KeptPrediction) -> IndexArray:
        """Return the rows that are kept: of known tracks, the model's first."""
        usable = (new.number >= 0) & np.isfinite(new.weight).all(axis=1)
        usable &= np.isfinite(new.mean).all(axis=(1, 2, 3)) & np.isfinite(new.cv_mean[:, 0, 0])
        rows = np.flatnonzero(usable)
        surplus = len(rows) - self._limits.agents
        if surplus > 0:
            self.left_out += surplus
            order = np.argsort(new.source[rows], kind="stable")
            rows = np.sort(rows[order[: self._limits.agents]])
        return rows

    def _grow(self, agents: int) -> None:
        """Make room for more agents in each cycle."""
        for name in _BY_AGENT:
            old = getattr(self, name)
            more = np.zeros((len(old), agents - old.shape[1], *old.shape[2:]), dtype=old.dtype)
            setattr(self, name, np.concatenate([old, more], axis=1))
        self.step[:, -more.shape[1] :] = self.time_s.shape[1]
        self.number[:, -more.shape[1] :] = -1

    def _make_room_for(self, modes: int) -> None:
        """Make room for more modes of each agent; those of earlier predictions have no weight."""
        extra = modes - self.weight.shape[2]
        self.weight = np.pad(self.weight, ((0, 0), (0, 0), (0, extra)))
        for name in ("offset", "covariance"):
            old = getattr(self, name)
            more = np.repeat(old[:, :, :1], extra, axis=2)
            setattr(self, name, np.concatenate([old, more], axis=2))

    def mean(
        self, cycle: IndexArray, agent: IndexArray, mode: IndexArray, step: IndexArray
    ) -> Float64Array:
        """Return [m, 2] predicted positions of m rows (m)."""
        return self.origin[cycle, agent] + self.offset[cycle, agent, mode, step]

    def means(self, cycle: IndexArray, agent: IndexArray, step: IndexArray) -> Float64Array:
        """Return [m, M, 2] predicted positions of all modes of m rows (m)."""
        return self.origin[cycle, agent][:, None] + self.offset[cycle, agent, :, step]

    def find_next(self, now_ns: int) -> None:
        """Set ``next_ns`` to the time of the next step after a time."""
        target = np.take_along_axis(self._target_ns, self.step, axis=1)
        later = target[target > now_ns + TOLERANCE_NS]
        self.next_ns = int(later.min(initial=_NEVER_NS))

    def due(
        self, now_ns: int, rows: tuple[IndexArray, IndexArray] | None = None
    ) -> tuple[IndexArray, IndexArray, NDArray[np.int64]]:
        """Return cycle, agent and time (ns) of the next steps that lie at or before a time.

        Args:
            now_ns: the time (ns).
            rows: cycle and agent of those looked at, all by default.
        """
        if rows is None:
            target = np.take_along_axis(self._target_ns, self.step, axis=1)
            cycle, agent = np.nonzero(target <= now_ns + TOLERANCE_NS)
            return cycle, agent, target[cycle, agent]
        cycle, agent = rows
        target = self._target_ns[cycle, self.step[cycle, agent]]
        due = target <= now_ns + TOLERANCE_NS
        return cycle[due], agent[due], target[due]

    def resolve(self, cycle: IndexArray, agent: IndexArray, truth: Float64Array) -> Float64Array:
        """Resolve the next step of m rows.

        Args:
            cycle: [m] and
            agent: [m] the rows.
            truth: [m, 2] observed positions (m), NaN where there is none.

        Returns:
            [m, 2] distances from the truth, averaged over the known steps so far, of the heaviest
            mode and of constant velocity (m); NaN where no step is known.
        """
        known: BoolArray = np.isfinite(truth[:, 0])
        step, heaviest = self.step[cycle, agent], self.heaviest[cycle, agent]
        mean = self.mean(cycle, agent, heaviest, step)
        apart = np.stack([mean, self.cv_mean[cycle, agent, step]], axis=1) - truth[:, None]
        error = np.where(known[:, None], np.hypot(apart[..., 0], apart[..., 1]), 0.0)
        self._error_sum[cycle, agent] += error
        self._known_steps[cycle, agent] += known
        self.step[cycle, agent] += 1
        count = self._known_steps[cycle, agent][:, None]
        return np.where(count, self._error_sum[cycle, agent] / np.maximum(count, 1), np.nan)


def _with_modes(new: KeptPrediction, modes: int) -> KeptPrediction:
    """Return a prediction of fewer modes with further ones that have no weight.

    With many road users fewer modes are published, so the number of modes may change from cycle to
    cycle; predictions in flight must not be lost by that.
    """
    extra = modes - new.mean.shape[1]
    return dataclasses.replace(
        new,
        weight=np.pad(new.weight, ((0, 0), (0, extra))),
        mean=np.concatenate([new.mean, np.repeat(new.mean[:, :1], extra, axis=1)], axis=1),
        covariance=np.concatenate(
            [new.covariance, np.repeat(new.covariance[:, :1], extra, axis=1)], axis=1
        ),
    )
