# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A linear function of the features of paths, fitted to errors as they become known.

Recursive least squares with a ridge and exponential forgetting (Haykin, Adaptive Filter Theory,
chapter on the recursive least-squares algorithm), one for each kind of road user, direction
and step ahead. What remains of an error beside its proposal is limited (Huber, Robust estimation
of a location parameter, 1964, there of residuals from a mean), so that no single road user has
much influence. What was proposed earlier says how much of it is believed now, over all that is
remembered and over the last moments, whichever is less: a tracker that is calibrated anew, or
other traffic, must not be corrected by what was right before.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.path_features import FEATURES, PARTS, part_steps
from mtpgo_core.schema import AgentClass, BoolArray, ClassArray, Float64Array, IndexArray
from mtpgo_core.task.calibration import CLASS_GROUPS, MOTIONS, GroupArray

KINDS = (*CLASS_GROUPS, "motorcycle")
"""Road users that are learned of together: the class groups, and motorcycles by themselves, which
move unlike the bicycles that are most of the two-wheelers."""

ANY = KINDS.index("any")
"""The kind that learns from the road users of all classes."""

_MOTORCYCLE = KINDS.index("motorcycle")

COEFFICIENT_LIMITS = (-1e3, 1e3)
"""Smallest and largest coefficient (m); chosen: no proposal for features of 1 is that far."""

_DOUBTED_MPS = 0.05
"""How fast a proposal drifts away from the model's path that is not believed without evidence
(m/s); chosen: 25 cm after 5 s, too little to matter."""

_LARGEST_RESIDUAL = 2.0
"""What remains of an error counts as at most so many times the mean absolute residual of its kind,
direction and step; chosen on left-out sites (docs/design.md, "Path correction")."""

_LEAST_LIMIT = 0.5
"""And as at least so many standard deviations of the model, or a limit that has become tiny in
traffic that is easy to foresee would hide for minutes that the traffic is another one; chosen."""

_LARGEST_SQUARE = 4.0
"""Squared length of the features beyond which an error counts less, in inverse proportion, as in a
generalised M-estimator with Mallows' weights; chosen there, too."""

_LEVERAGE_COUNTS = 3.0
"""How much the leverage of new features counts; chosen there, too: with 3, motorcycles among many
bicycles are predicted as well as without a correction, and not 4 % worse."""

_RECENT_S = 15.0
"""Memory of the second belief (s); chosen: after velocities that were a tenth too large had become
right, paths were worse than the model's for two minutes with 60 s, for one with 30 s and for half
a minute with this, which costs 0.3 % of ADE at one of the left-out sites (Lankershim)."""

_RECENT_DOUBT_S = 5.0
"""Seconds of proposals without effect from which it begins (s), at the first belief; chosen."""

_SCALE_AFTER_S = 5.0
"""Seconds of one road user after which that mean is known well enough; chosen."""

_FIT_EVERY_S = 1.0
"""Time between two solutions of the equations (s); chosen: what comes in a second changes
little."""


def kinds(agent_class: ClassArray, group: GroupArray) -> IndexArray:
    """Return [n] positions in :data:`KINDS`.

    Args:
        agent_class: [n] :class:`~mtpgo_core.schema.AgentClass` values.
        group: [n] positions in :data:`~mtpgo_core.task.calibration.GROUPS`.
    """
    own = group.astype(np.intp) // len(MOTIONS)
    return np.where(agent_class == AgentClass.MOTORCYCLE, _MOTORCYCLE, own)


@dataclass(frozen=True)
class PathErrors:
    """Errors of m steps of the model's paths.

    Attributes:
        kind: [m] positions in :data:`KINDS`.
        step: [m] steps ahead, from 0.
        weight: [m] how long each stands for (s).
        features: [m, 2, F], see :class:`~mtpgo_core.live_calibration.path_features.PathFeatures`.
        error: [m, 2] truth minus path, along and across (m).
        sigma: [m, 2] standard deviations of the path there (m).
        proposal: [m, 2] what was proposed for it when the path was served (m).
    """

    kind: IndexArray
    step: IndexArray
    weight: Float64Array
    features: Float64Array
    error: Float64Array
    sigma: Float64Array
    proposal: Float64Array


def joined(parts: Sequence[PathErrors]) -> PathErrors:
    """Return the errors of all parts, at least one."""
    return PathErrors(
        **{
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(PathErrors)
        }
    )


@dataclass(frozen=True)
class PathFit:
    """What is applied.

    Attributes:
        coefficients: [kinds, 2, H, F] of the proposals.
        belief: [kinds, 2, H] share of the proposals that is applied, 0 to 1.
        information: [kinds, 2, parts, F, F] the equations' matrices at the end of each of
            :data:`~mtpgo_core.live_calibration.path_features.PARTS` of the horizon: what the
            coefficients were learned from, before and after a restart.
        curves: [kinds, 2, 3, H] that make corrections of single steps a cubic.
    """

    coefficients: Float64Array
    belief: Float64Array
    information: Float64Array
    curves: Float64Array

    @classmethod
    def begun(
        cls, coefficients: Float64Array, belief: Float64Array, information: Float64Array
    ) -> PathFit:
        """Return what is applied before anything more is learned."""
        return cls(coefficients, belief, information, _curves(belief > 0.0))

    @functools.cached_property
    def _inverse(self) -> Float64Array:
        """[kinds, 2, parts, F, F] inverses of the information."""
        return np.asarray(np.linalg.inv(self.information))

    def shares(self, kind: IndexArray, features: Float64Array) -> Float64Array:
        """Return [n, H, 2] shares of what was learned that hold for features x.

        They are the smaller, the less x is like what was learned from: 1 / (1 + 3 h) with the
        leverage h = x^T inverse x at the end of the part of the horizon.

        Args:
            kind: [n] positions in :data:`KINDS`.
            features: [n, 2, F].
        """
        steps = self.belief.shape[2]
        leverage = np.zeros((len(kind), len(PARTS), 2))
        for one, axis in itertools.product(np.unique(kind), range(2)):
            rows = kind == one
            x = features[rows, axis]  # [r, F]
            # A matrix of all parts, so small that one thread computes the product.
            wide = self._inverse[one, axis].transpose(1, 0, 2).reshape(FEATURES, -1)
            product = (x @ wide).reshape(len(x), len(PARTS), FEATURES)
            leverage[rows, :, axis] = (product * x[:, None]).sum(axis=2)
        part = np.searchsorted(part_steps(steps), np.arange(steps))
        return 1.0 / (1.0 + _LEVERAGE_COUNTS * leverage[:, part])

    def propose(
        self, kind: IndexArray, features: Float64Array, shares: Float64Array
    ) -> Float64Array:
        """Return [n, H, 2] proposals (m).

        Args:
            kind: [n] positions in :data:`KINDS`.
            features: [n, 2, F].
            shares: [n, H, 2], see :meth:`shares`.
        """
        return shares * np.einsum("nakf,naf->nka", self.coefficients[kind], features)

    def as_curves(self, kind: IndexArray, shift: Float64Array) -> Float64Array:
        """Return [n, M, H, 2] corrections as smooth curves.

        Args:
            kind: [n] positions in :data:`KINDS`.
            shift: [n, M, H, 2] of each step by itself (m).
        """
        ahead, basis = _cubic(shift.shape[2])
        relative = (shift / ahead[:, None]).transpose(0, 3, 2, 1)  # [n, 2, H, M]
        curve = (ahead[:, None] * basis) @ (self.curves[kind] @ relative)
        return np.asarray(curve.transpose(0, 3, 2, 1))


class PathEquations:
    """The sums of the equations, and their last solution.

    Args:
        options: may be replaced.
        dt_s: step of the horizon (s).
        steps: H.

    Attributes:
        options: as above.
        fit: the last solution; replaced, never changed, so that any thread may read it.
    """

    def __init__(self, options: LiveOptions, dt_s: float, steps: int) -> None:
        self.options = options
        shape = (len(KINDS), 2, steps)
        ridge = np.broadcast_to(
            options.path_ridge * np.eye(FEATURES), (*shape[:2], len(PARTS), FEATURES, FEATURES)
        )
        self.fit = PathFit.begun(np.zeros((*shape, FEATURES)), np.zeros(shape), ridge)
        self._begin = self.fit
        self._square = np.zeros((*shape, FEATURES, FEATURES))
        self._product = np.zeros((*shape, FEATURES))
        self._agreed, self._proposed = np.zeros(shape), np.zeros(shape)
        self._agreed_now, self._proposed_now = np.zeros(shape), np.zeros(shape)
        self._residual, self._weight = np.zeros(shape), np.zeros(shape)
        self._doubted_m2 = (_DOUBTED_MPS * dt_s * np.arange(1, steps + 1)) ** 2
        self._since_fit_s = 0.0

    def begin_with(self, fit: PathFit) -> None:
        """Begin with a solution of earlier sums, to which forgetting leads back."""
        self.fit = self._begin = fit

    def pass_time(self, seconds: float) -> None:
        """Let what was learned fade, and solve the equations again from time to time (s)."""
        kept = math.exp(-seconds / self.options.memory_s)
        for sums in (
            self._square,
            self._product,
            self._agreed,
            self._proposed,
            self._residual,
            self._weight,
        ):
            sums *= kept
        kept = math.exp(-seconds / min(_RECENT_S, self.options.memory_s))
        for sums in (self._agreed_now, self._proposed_now):
            sums *= kept
        self._since_fit_s += seconds
        if self._since_fit_s >= _FIT_EVERY_S:
            self._since_fit_s = 0.0
            self._solve()

    def _solve(self) -> None:
        ridge = self.options.path_ridge
        product = self._product + ridge * self._begin.coefficients
        square = self._square + ridge * np.eye(FEATURES)
        solution = np.linalg.solve(square, product[..., None])[..., 0]
        coefficients = np.clip(solution, *COEFFICIENT_LIMITS)
        information = self._square[:, :, part_steps(square.shape[2])] + self._begin.information
        begun, doubt_s = self._begin.belief, self.options.path_doubt
        belief = self._share(self._agreed, self._proposed, doubt_s, begun)
        recent = self._share(self._agreed_now, self._proposed_now, _RECENT_DOUBT_S, belief)
        belief = np.minimum(belief, recent)
        curves = _curves((self._weight > 0.0) | (self._begin.belief > 0.0))
        self.fit = PathFit(coefficients, belief, information, curves)

    def _share(
        self, agreed: Float64Array, proposed: Float64Array, doubt_s: float, before: Float64Array
    ) -> Float64Array:
        """Return [kinds, 2, H] times which the proposals had had the smallest squared errors.

        Args:
            agreed: [kinds, 2, H] sums of proposals times errors (m^2 s).
            proposed: [kinds, 2, H] sums of squared proposals (m^2 s).
            doubt_s: seconds of small proposals that count for ``before``.
            before: [kinds, 2, H] shares without evidence.
        """
        doubted = doubt_s * self._doubted_m2
        return np.clip((agreed + doubted * before) / (proposed + doubted), 0.0, 1.0)

    def add(self, errors: PathErrors) -> None:
        """Add errors to the equations of their own kind and of ``any``."""
        if not len(errors.kind):
            return
        steps = self._product.shape[2]
        known = errors.kind != ANY
        row = np.concatenate([np.flatnonzero(known), np.arange(len(known))])
        kind = np.concatenate([errors.kind[known], np.full(len(known), ANY)])
        cell = kind * steps + errors.step[row]
        order = np.argsort(cell, kind="stable")
        row, cell = row[order], cell[order]
        first = np.flatnonzero(np.diff(cell, prepend=-1))
        where = cell[first] // steps, cell[first] % steps
        residual = self._limited(errors)
        x, p = errors.features[row], errors.proposal[row]
        y, weight = p + residual[row], np.repeat(errors.weight[row, None], 2, axis=1)
        # A road user whose features are large must not decide alone what they mean.
        counted = weight * np.minimum(1.0, _LARGEST_SQUARE / np.maximum((x**2).sum(axis=2), 1e-9))
        # Proposals for cars say nothing of how right those for road users of no known class are.
        own = (kind[order] == errors.kind[row])[:, None]
        weighted = counted[..., None] * x  # [r, 2, F]
        for sums, values in (
            (self._square, weighted[..., None] * x[..., None, :]),
            (self._product, weighted * y[..., None]),
            (self._agreed, own * weight * y * p),
            (self._proposed, own * weight * p * p),
            (self._agreed_now, own * counted * errors.error[row] * p),
            (self._proposed_now, own * counted * p * p),
            (self._residual, weight * np.abs(residual[row])),
            (self._weight, weight),
        ):
            sums[where[0], :, where[1]] += np.add.reduceat(values, first, axis=0)

    def _limited(self, errors: PathErrors) -> Float64Array:
        """Return [m, 2] what remains of the errors beside the proposals, limited (m)."""
        residual = errors.error - errors.proposal
        cell = errors.kind, slice(None), errors.step
        known = self._weight[cell] > _SCALE_AFTER_S
        mean = self._residual[cell] / np.maximum(self._weight[cell], _SCALE_AFTER_S)
        most = np.maximum(_LARGEST_RESIDUAL * mean, _LEAST_LIMIT * errors.sigma)
        most = np.where(known, most, np.inf)
        return np.clip(residual, -most, most)


def _cubic(steps: int) -> tuple[Float64Array, Float64Array]:
    """Return [H] the times ahead and [H, 3] the basis of a cubic from 0 on, divided by them."""
    ahead = np.arange(1, steps + 1) / steps
    return ahead, np.stack([np.ones(steps), ahead, ahead**2], axis=1)


def _curves(known: BoolArray) -> Float64Array:
    """Return [..., 3, H] that make corrections, divided by the time ahead, the nearest cubic.

    Each step is learned by itself, and at first what is known ends at a step: without this paths
    have kinks there. Steps that get no truth because observations are rare do not count, unless
    they are farther ahead than all that is known. Relative to the time ahead, all steps count
    alike.

    Args:
        known: [..., H] steps that something is known of.
    """
    beyond = np.cumsum(known[..., ::-1], axis=-1)[..., ::-1] == 0
    counted = (known | beyond).astype(np.float64)[..., None]
    _, basis = _cubic(known.shape[-1])
    return np.asarray(np.linalg.pinv(counted * basis) * np.swapaxes(counted, -1, -2))
