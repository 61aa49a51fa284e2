# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The live calibration of a stream: corrects predictions and learns from their outcomes."""

from __future__ import annotations

import threading

import numpy as np

from mtpgo_core.history.stream_guard import UpdateReport
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.history.track_index import find_sort_keys, sort_keys
from mtpgo_core.live_calibration.live_options import BEST, LiveOptions
from mtpgo_core.live_calibration.model_preference import ModelPreference
from mtpgo_core.live_calibration.path_correction import PathCorrection
from mtpgo_core.live_calibration.served_tables import (
    ServedTables,
    apply_factors,
    as_preferred,
    log_shipped_50,
)
from mtpgo_core.live_calibration.sigma_tracker import POOL_OF, SigmaTracker, SquaredErrors
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.output_assembly import merge, with_time_origin
from mtpgo_core.quality.metrics import mahalanobis
from mtpgo_core.quality.outcome_matcher import OutcomeMatcher
from mtpgo_core.quality.outcomes import Outcomes
from mtpgo_core.quality.prediction_memory import MemoryLimits
from mtpgo_core.schema import Float64Array, HistoryWindow, Prediction, Source
from mtpgo_core.task.calibration import calibration_groups
from mtpgo_core.task.task_description import HistoryConfig

_LONGEST_STEP_S = 5.0
"""Most time that passes with one observation (s); chosen: nothing is learned in a pause."""

MODEL, CV = int(Source.MODEL), int(Source.CONSTANT_VELOCITY)


class LiveCalibration:
    """Corrects predictions before they are published, by the outcomes of earlier ones.

    The predictions of the model and of constant velocity are both compared with the observations,
    no matter which is served. :meth:`serve` may be called from any thread, :meth:`observe` from
    one.

    Args:
        options: what is learned; may be replaced by :meth:`configure`.
        history: configuration of the history that observes.
        horizon_steps: H of the predictions.

    Attributes:
        options: as above.
        tracker: the factors.
        preference: who is better, by group.
        paths: the correction of the model's paths.
    """

    def __init__(self, options: LiveOptions, history: HistoryConfig, horizon_steps: int) -> None:
        self.options = options
        self.tracker = SigmaTracker(options, horizon_steps)
        self.preference = ModelPreference(options)
        self._limits, self._max_gap_s = MemoryLimits(modes=1), history.max_gap_s
        self.paths = PathCorrection(options, history.dt_s, horizon_steps, self._max_gap_s)
        self._matcher = OutcomeMatcher(history, self._limits)
        self._served = ServedTables()
        self._now_ns: int | None = None
        self._lock = threading.Lock()

    def configure(self, options: LiveOptions) -> None:
        """Use other options from the next observation on; what was learned is kept."""
        self.options = self.tracker.options = self.preference.options = options
        self.paths.configure(options)

    def serve(self, prediction: Prediction, window: HistoryWindow) -> Prediction:
        """Return the corrected prediction, which is to be published, and remember it for learning.

        Args:
            prediction: with the shipped calibration, of the agents present in the window. A
                prediction with another horizon, made before a change of models, is returned
                unchanged.
            window: the window that it was made from.
        """
        if not self.options.watches or not len(prediction):
            return prediction
        if len(prediction.time_s) != self.tracker.log_sigma.shape[-1]:
            return prediction
        row = find_sort_keys(sort_keys(window.key), sort_keys(prediction.key))
        everybody, window = window, window.select(row)
        group = calibration_groups(prediction.agent_class, window.velocity[:, -1])
        log_sigma = self.tracker.log_sigma
        if not self.options.learns_factors:
            log_sigma = np.zeros_like(log_sigma)
        corrected, paths = prediction, None
        if self.options.learns_paths:
            corrected, paths = self.paths.correct(prediction, everybody, row, group)
        if self.options.learns_factors:
            corrected = apply_factors(corrected, group, log_sigma)
        spacing_s = self._limits.spacing_s(float(prediction.time_s[-1]), self._max_gap_s)
        with self._lock:
            span_s = self._served.add(
                prediction.stamp_ns, log_sigma, log_shipped_50(prediction, group), spacing_s
            )
        if span_s:
            if paths is not None:
                self.paths.keep(paths, span_s)
            self._matcher.add(corrected, everybody)
        if self.options.prefer != BEST:
            return corrected
        preferred = self.preference.constant_velocity[group] & (prediction.source == MODEL)
        if not preferred.any():
            return corrected
        constant = self._constant(prediction, window)
        if self.options.learns_factors:
            constant = apply_factors(constant, group, log_sigma)
        return as_preferred(merge(corrected, constant, preferred), preferred)

    @staticmethod
    def _constant(prediction: Prediction, window: HistoryWindow) -> Prediction:
        """Return a constant-velocity prediction with the times and modes of a prediction."""
        start_s = (window.stamp_ns - prediction.stamp_ns) * 1e-9
        constant = predict_constant_velocity(
            window,
            horizon_steps=len(prediction.time_s),
            dt_s=float(prediction.time_s[0]) - start_s,
            modes=prediction.weight.shape[1],
        )
        return with_time_origin(constant, prediction.stamp_ns)

    def observe(self, history: TrackHistory, report: UpdateReport) -> None:
        """Learn from the last observation of the history.

        Args:
            history: after the observation.
            report: on it.
        """
        if not self.options.watches:
            return
        outcomes = self._matcher.update(history, report)
        if report.clock_reset:
            self._now_ns = None
            self.paths.clear()
            with self._lock:
                self._served.clear()
        seconds = self._passed_s(outcomes.now_ns)
        if self.options.learns_factors:
            self.tracker.pass_time(seconds)
            errors = self._squared_errors(outcomes)
            self.tracker.update(errors)
        if self.options.learns_paths:
            self.paths.update(seconds, outcomes)
        if self.options.prefer == BEST:
            error_m = _errors(outcomes)
            group = outcomes.group.astype(np.intp)
            self.preference.update(seconds, outcomes.track, group, error_m)

    def clear_stream(self, cause: str) -> None:
        """Forget the predictions whose outcomes are not known yet; keep what was learned.

        Args:
            cause: one of :data:`mtpgo_core.quality.outcomes.UNKNOWN`.
        """
        self._matcher.clear(cause)
        self.paths.clear()
        self._now_ns = None

    def _passed_s(self, now_ns: int) -> float:
        """Return the stream's time since the last call (s)."""
        before, self._now_ns = self._now_ns, now_ns
        if before is None:
            return 0.0
        return min(max(0.0, (now_ns - before) * 1e-9), _LONGEST_STEP_S)

    def _squared_errors(self, outcomes: Outcomes) -> SquaredErrors:
        """Return the squared errors of outcomes, relative to the shipped covariances."""
        with self._lock:
            table, tables = self._served.find(outcomes.stamp_ns)
        rows = np.flatnonzero(outcomes.known & (table >= 0))
        outcomes, table = outcomes.select(rows), table[rows]
        step, group = outcomes.step, outcomes.group.astype(np.intp)
        if not len(rows):
            nothing = np.empty((0, 2, 2))
            return SquaredErrors(
                outcomes.track,
                group,
                step,
                table,
                np.empty(0),
                nothing[..., 0],
                nothing[..., 0],
                nothing,
                nothing,
            )
        logs = np.stack([one.log_sigma for one in tables])
        own = logs[table, :, :, group, step]
        shipped_50 = np.stack([one.log_shipped_50 for one in tables])[table, group, step]
        truth = outcomes.truth
        model = mahalanobis(truth - outcomes.heaviest_mean, outcomes.heaviest_covariance)[0]
        # The covariances of the model are kept as served, those of constant velocity are not.
        model = model * np.exp(2.0 * own[:, MODEL, 1])
        constant = mahalanobis(truth - outcomes.cv_mean, outcomes.cv_covariance)[0]
        return SquaredErrors(
            track=outcomes.track,
            group=group,
            step=step,
            cycle=table,
            span_s=np.array([one.span_s for one in tables])[table],
            squared=np.stack(
                [np.where(outcomes.source == MODEL, model, np.nan), constant], axis=1
            ),
            shipped_50=np.stack([shipped_50, np.zeros_like(shipped_50)], axis=1),
            own=own,
            pool=logs[table, :, :, POOL_OF[group], step],
        )


def _errors(outcomes: Outcomes) -> Float64Array:
    """Return [m, 2] errors of model and constant velocity (m), NaN where the model has none."""
    model = np.linalg.norm(outcomes.heaviest_mean - outcomes.truth, axis=1)
    constant = np.linalg.norm(outcomes.cv_mean - outcomes.truth, axis=1)
    return np.stack([np.where(outcomes.source == MODEL, model, np.nan), constant], axis=1)
