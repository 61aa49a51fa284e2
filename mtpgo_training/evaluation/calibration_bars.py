# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the online calibration makes of a model on a site, and the bars that it has to reach.

The bars are of the ellipses; beside them stand the displacement errors, which its correction of
paths changes.

Both calibrations are scored on the same predictions, so a model runs once. Only moving road users
count, and only what was predicted after the first minute, in which the factors are learned.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.track_index import find_sort_keys, sort_keys
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import ONLINE, SHIPPED, LiveOptions
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.prediction.output_assembly import select
from mtpgo_core.quality.metrics import TIMES_S, ade, anll, is_inside, min_ade, nees
from mtpgo_core.schema import Float64Array, HistoryWindow, Prediction
from mtpgo_core.task.calibration import calibration_groups, is_moving
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.offline_predictor import make_predictor
from mtpgo_training.evaluation.scorer import GroundTruth, Scorer
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.tracker.simulated_tracker import draw_tracker
from mtpgo_training.scenes.windows import frames_every

CONSTANT = "constant velocity"
"""Beside the names of both calibrations, that of the predictions that need no model."""

AFTER_S = 60.0
"""Time in which the factors are learned before anything counts (s); chosen with the bars."""

LEAST_AGENTS = 10
"""Road users from which on the bars hold; chosen with them."""

BARS = {0.5: (0.44, 0.56), 0.9: (0.87, 0.93)}
"""Least and largest share of truths in the ellipses of each level; chosen."""

_ONLINE = LiveOptions()

_SLACK_S = 0.05
"""A step this close to a time is the one at that time (s); chosen: a quarter of a step."""

_JOINED_BELOW_S = 120.0
"""Factors are kept from one recording to the next where recordings are shorter (s), as with a
calibration file; chosen: with twice ``AFTER_S`` half of a recording counts."""


@dataclass
class SiteCalibration:
    """Shares of truths in ellipses, and likelihoods, with both calibrations on one site.

    Attributes:
        predictions: number of predictions of moving road users that count.
        agents: number of different road users of these.
        known: [times] number of these predictions whose truth at ``TIMES_S`` is known.
    """

    predictions: int = 0
    agents: int = 0
    known: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros(len(TIMES_S), dtype=np.int64)
    )
    _inside: dict[tuple[str, float], NDArray[np.int64]] = field(default_factory=dict)
    _means: dict[tuple[str, str], tuple[float, int]] = field(default_factory=dict)

    def add(self, calibration: str, prediction: Prediction, truth: GroundTruth) -> None:
        """Add predictions with one of the calibrations, or at constant velocity."""
        mean, weight = prediction.mean[..., :2], prediction.weight
        rows = (mean, weight, prediction.covariance, truth.position)
        apart_s = np.abs(prediction.time_s[:, None] - np.array(TIMES_S))  # [H, times]
        steps = apart_s.argmin(axis=0)
        known = truth.mask[:, steps] & (apart_s.min(axis=0) < _SLACK_S)
        squared = nees(*rows)[:, steps]
        for level in BARS:
            factor = prediction.sigma_factor_50[:, steps]
            inside = (is_inside(squared, level, factor) & known).sum(axis=0)
            key = (calibration, level)
            self._inside[key] = self._inside.get(key, np.zeros_like(self.known)) + inside
        for name, values in (
            ("nll", anll(*rows, truth.mask)),
            ("ade", ade(mean, weight, truth.position, truth.mask)),
            ("min_ade", min_ade(mean, truth.position, truth.mask)),
        ):
            values = values[np.isfinite(values)]
            total, number = self._means.get((name, calibration), (0.0, 0))
            self._means[name, calibration] = total + float(values.sum()), number + len(values)
        if calibration == SHIPPED:
            self.known += known.sum(axis=0)
            self.predictions += len(prediction)

    def shares(self, calibration: str, level: float) -> Float64Array:
        """Return [times] shares of truths in the ellipses at ``TIMES_S``, NaN where none."""
        inside = self._inside.get((calibration, level), np.zeros_like(self.known))
        return np.where(self.known > 0, inside / np.maximum(self.known, 1), np.nan)

    def nll(self, calibration: str) -> float:
        """Return the negative log-likelihood (nats), averaged over the predictions."""
        return self._mean("nll", calibration)

    def ade(self, calibration: str) -> float:
        """Return the displacement error of the heaviest mode (m), averaged in the same way."""
        return self._mean("ade", calibration)

    def min_ade(self, calibration: str) -> float:
        """Return that of the best mode (m)."""
        return self._mean("min_ade", calibration)

    def _mean(self, name: str, calibration: str) -> float:
        total, number = self._means.get((name, calibration), (0.0, 0))
        return total / number if number else float("nan")

    @property
    def misses(self) -> list[str]:
        """The bars that the online calibration misses, as text; none with too few road users."""
        if self.agents < LEAST_AGENTS:
            return []
        found = []
        for level, (low, high) in sorted(BARS.items(), reverse=True):
            for time_s, share in zip(TIMES_S, self.shares(ONLINE, level), strict=True):
                if share < low or share > high:
                    found.append(
                        f"{100 * level:.0f} % at {time_s} s: {share:.3f}, expected {low} to {high}"
                    )
        if not self.nll(ONLINE) < self.nll(SHIPPED):
            found.append(f"NLL {self.nll(ONLINE):.3f}, expected below {self.nll(SHIPPED):.3f}")
        return found


def measure_calibration(
    runner: ModelRunner,
    recordings: Iterable[Recording],
    *,
    tracker_seed: int | None = None,
    stride_s: float = 0.4,
    after_s: float = AFTER_S,
    options: LiveOptions = _ONLINE,
) -> SiteCalibration:
    """Return what both calibrations are worth on the recordings of a site.

    Each recording starts with the shipped calibration. Short ones follow each other without a new
    start.

    Args:
        runner: the model.
        recordings: of the site.
        tracker_seed: of the simulated tracker that observes, None for observations as recorded.
        stride_s: time between two predictions (s); the calibration learns from each at 0.4 s.
        after_s: predictions of the first seconds after a start do not count (s).
        options: of the online calibration.
    """
    history, horizon = runner.task.history, runner.task.horizon_steps
    result = SiteCalibration()
    live, past_s = LiveCalibration(options, history, horizon), 0.0
    for recording in recordings:
        if recording.duration_s >= _JOINED_BELOW_S:
            live, past_s = LiveCalibration(options, history, horizon), 0.0
        observed = recording
        if tracker_seed is not None:
            observed = draw_tracker(recording, tracker_seed).observe(recording)
        seen = set[int]()
        for one in served_predictions(runner, live, recording, observed, stride_s):
            if past_s + one.time_s < after_s:
                continue
            seen.update(one.truth.agents.track.tolist())
            constant = predict_constant_velocity(
                one.window, horizon_steps=horizon, dt_s=history.dt_s
            )
            for name, prediction in (
                (SHIPPED, one.shipped),
                (ONLINE, one.online),
                (CONSTANT, constant),
            ):
                result.add(name, prediction, one.truth)
        past_s += recording.duration_s
        result.agents += len(seen)
    return result


class ServedPrediction(NamedTuple):
    """A prediction as shipped and as the online calibration serves it, and what became of it.

    All of moving road users of which a later position is known.

    Attributes:
        time_s: since the first prediction of the recording (s).
        window: that it was made from.
        shipped: with the calibration of the model's file.
        online: as served.
        truth: of both.
    """

    time_s: float
    window: HistoryWindow
    shipped: Prediction
    online: Prediction
    truth: GroundTruth


def served_predictions(
    runner: ModelRunner,
    live: LiveCalibration,
    recording: Recording,
    observed: Recording,
    stride_s: float,
) -> Iterator[ServedPrediction]:
    """Play a recording to a model and an online calibration, which goes on from earlier ones.

    Args:
        runner: the model.
        live: the calibration.
        recording: the truth.
        observed: what the history observes.
        stride_s: time between two predictions (s).
    """
    history, horizon = runner.task.history, runner.task.horizon_steps
    live.clear_stream("clock_reset")
    scorer = Scorer(recording, max_gap_s=history.max_gap_s)
    predictor = make_predictor(runner, recording)
    stamps = [recording.stamp_ns(int(frame)) for frame in frames_every(recording, stride_s)]
    windows = replay(observed, history, stamps, on_update=live.observe)
    for stamp_ns, window in zip(stamps, windows, strict=True):
        shipped = predictor.predict(window)
        online = live.serve(shipped, window)
        if not len(shipped):
            continue
        own = window.select(find_sort_keys(sort_keys(window.key), sort_keys(shipped.key)))
        group = calibration_groups(shipped.agent_class, own.velocity[:, -1])
        truth = scorer.ground_truth(shipped.key, stamp_ns, horizon, history.dt_s)
        rows = is_moving(group) & truth.mask.any(axis=1)
        yield ServedPrediction(
            (stamp_ns - stamps[0]) * 1e-9,
            own.select(rows),
            select(shipped, rows),
            select(online, rows),
            truth.select(rows),
        )
