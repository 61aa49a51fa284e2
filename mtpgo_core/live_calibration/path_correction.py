# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predicted paths corrected by what became of earlier ones on the same road.

How strongly traffic answers to a gap that closes, and for how long it accelerates, differs from
road to road and is not known before. A linear function of a few numbers of each road user is
fitted to the errors of the model's paths as they become known, and applied to the next ones as far
as its own earlier proposals were right (docs/design.md, "Path correction").
"""

from __future__ import annotations

import dataclasses
import threading
from collections import deque
from dataclasses import dataclass

import numpy as np

from mtpgo_core.frames import rotate
from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.path_equations import PathEquations, PathErrors, joined, kinds
from mtpgo_core.live_calibration.path_features import MIXTURE, PathFeatures, path_features
from mtpgo_core.prediction.constant_velocity import motion_yaw
from mtpgo_core.prediction.output_assembly import replace_rows, select, time_grid
from mtpgo_core.prediction.paths.forward_motion import without_reversing
from mtpgo_core.quality.outcomes import Outcomes
from mtpgo_core.schema import (
    CalibrationStage,
    Float64Array,
    HistoryWindow,
    IndexArray,
    Prediction,
    Source,
)
from mtpgo_core.task.calibration import GroupArray, is_moving

_LARGEST_ERROR = 3.0
"""An error counts as at most so many standard deviations of the heaviest mode, as the model's file
states them; chosen: an identity that went over to another road user must not count like fifty."""

_LARGEST_SHIFT = 1.0
"""No path is moved by more standard deviations of its heaviest mode; chosen: the correction says
what is likely within what the model thought possible."""


@dataclass(frozen=True)
class ServedPaths:
    """Paths of the model as they came, and what was proposed for them, kept to learn from.

    Attributes:
        stamp_ns: of the prediction (ns).
        place: [p] position of each road user of the prediction in the arrays below, -1 where none.
        kind: [n] positions in :data:`~mtpgo_core.live_calibration.path_equations.KINDS`.
        mean: [n, H, 2] the model's path in the heaviest mode (m).
        features: of the paths.
        proposal: [n, H, 2] proposed corrections, along and across (m).
        weight_s: how long the prediction stands for (s).
    """

    stamp_ns: int
    place: IndexArray
    kind: IndexArray
    mean: Float64Array
    features: PathFeatures
    proposal: Float64Array
    weight_s: float = 0.0


class PathCorrection:
    """Corrects the model's paths of moving road users.

    :meth:`correct` and :meth:`keep` may be called from any thread, the others from one.

    Args:
        options: may be replaced by :meth:`configure`.
        dt_s: step of the horizon (s).
        steps: H.
        longest_wait_s: how long after a step its truth may come (s).

    Attributes:
        equations: what was learned.
    """

    def __init__(
        self, options: LiveOptions, dt_s: float, steps: int, longest_wait_s: float
    ) -> None:
        # A delay that is compensated moves the horizon, by less than the wait.
        self._kept_ns = round(1e9 * (steps * dt_s + 2.0 * longest_wait_s))
        self.equations = PathEquations(options, dt_s, steps)
        self._served: deque[ServedPaths] = deque()
        self._lock = threading.Lock()

    def configure(self, options: LiveOptions) -> None:
        """Use other options from the next observation on."""
        self.equations.options = options

    def correct(
        self, prediction: Prediction, window: HistoryWindow, row: IndexArray, group: GroupArray
    ) -> tuple[Prediction, ServedPaths]:
        """Return the prediction with corrected paths, and what to :meth:`keep` to learn from it.

        All modes of a road user are moved, but only the heaviest towards their mean. What the
        model does not predict and what stands or has no velocity stays as it is.

        Args:
            prediction: with the shipped calibration.
            window: of all agents.
            row: [n] the predicted agents' positions in the window.
            group: [n] positions in :data:`~mtpgo_core.task.calibration.GROUPS`.
        """
        known = np.isfinite(window.velocity[row, -1]).all(axis=1)
        moves = is_moving(group) & known
        chosen = np.flatnonzero(moves & (prediction.source == Source.MODEL))
        place = np.full(len(prediction), -1)
        place[chosen] = np.arange(len(chosen))
        some, row = select(prediction, chosen), row[chosen]
        kind, fit = kinds(some.agent_class, group[chosen]), self.equations.fit
        features = path_features(some, window, row)
        shares = fit.shares(kind, features.values)
        most = _LARGEST_SHIFT * features.sigma
        proposal = np.clip(fit.propose(kind, features.values, shares), -most, most)
        served = ServedPaths(
            stamp_ns=prediction.stamp_ns,
            place=place,
            kind=kind,
            mean=some.mean[:, 0, :, :2].copy(),  # a view would keep all modes
            features=features,
            proposal=proposal,
        )
        believed = features.share[:, None, None] * fit.belief[kind].transpose(0, 2, 1)
        if not believed.any():
            return prediction, served
        others = features.values.copy()
        others[..., MIXTURE] = 0.0
        proposed = np.clip(fit.propose(kind, others, shares), -most, most)
        shift = np.repeat(proposed[:, None], some.weight.shape[1], axis=1)
        shift[:, 0] = proposal
        shift = fit.as_curves(kind, believed[:, None] * shift)
        # Beyond the limit at some step, the whole curve is made smaller, or it had a kink there.
        excess = (np.abs(shift) / most[:, None]).max(axis=2, keepdims=True)
        shift /= np.maximum(1.0, excess)
        moved = _moved(some, rotate(shift, features.course[:, None, None]))
        moved = without_reversing(moved, window.select(row))
        return replace_rows(prediction, chosen, moved), served

    def keep(self, served: ServedPaths, weight_s: float) -> None:
        """Learn from a prediction when its outcome becomes known.

        Args:
            served: of :meth:`correct`.
            weight_s: how long it stands for (s).
        """
        with self._lock:
            self._served.append(dataclasses.replace(served, weight_s=weight_s))
            while served.stamp_ns - self._served[0].stamp_ns > self._kept_ns:
                self._served.popleft()

    def clear(self) -> None:
        """Forget the predictions whose outcomes are not known yet; keep what was learned."""
        with self._lock:
            self._served.clear()

    def update(self, seconds: float, outcomes: Outcomes) -> None:
        """Learn from the last observation.

        Args:
            seconds: time since the last call (s).
            outcomes: that it reveals.
        """
        self.equations.pass_time(seconds)
        known = np.flatnonzero(outcomes.known)
        stamps, which = np.unique(outcomes.stamp_ns[known], return_inverse=True)
        with self._lock:
            served = {paths.stamp_ns: paths for paths in self._served}
        errors = [
            _errors(paths, outcomes.select(known[which == index]))
            for index, stamp_ns in enumerate(stamps.tolist())
            if (paths := served.get(stamp_ns)) is not None
        ]
        if errors:
            self.equations.add(joined(errors))


def _errors(paths: ServedPaths, outcomes: Outcomes) -> PathErrors:
    """Return the errors of the paths of one prediction, by the outcomes of that prediction."""
    place = paths.place[outcomes.row]
    found = np.flatnonzero(place >= 0)
    row, step = place[found], outcomes.step[found]
    error = rotate(outcomes.truth[found] - paths.mean[row, step], -paths.features.course[row])
    most = _LARGEST_ERROR * paths.features.sigma[row, step]
    return PathErrors(
        kind=paths.kind[row],
        step=step,
        weight=np.full(len(row), paths.weight_s),
        features=paths.features.values[row],
        error=np.clip(error, -most, most),
        sigma=paths.features.sigma[row, step],
        proposal=paths.proposal[row, step],
    )


def _moved(prediction: Prediction, shift: Float64Array) -> Prediction:
    """Return a prediction with its modes moved by [n, M, H, 2] (m), velocities and yaw as well."""
    drift = np.diff(shift, axis=2, prepend=0.0) / time_grid(prediction.time_s)[1]
    mean = prediction.mean + np.concatenate([shift, drift], axis=-1)
    yaw = motion_yaw(mean, prediction.initial_yaw)
    stage = np.where(
        shift.any(axis=(1, 2, 3)), CalibrationStage.ONLINE_PATH, prediction.calibration
    ).astype(np.uint8)
    return dataclasses.replace(prediction, mean=mean, yaw=yaw, calibration=stage)
