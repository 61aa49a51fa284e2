# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The model of a configured node, or its absence, with its options, ego and lanes. No ROS here."""

from __future__ import annotations

import gc
import threading

import numpy as np

from msg_adapters.inputs.ego_odometry import EGO_NAME
from mtpgo_core.errors import ModelFileError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import first_key, keys_from_integers
from mtpgo_core.live_calibration.live_options import OFF
from mtpgo_core.prediction.scene_predictor import PredictorOptions, ScenePredictor
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import HistoryWindow, KeyArray, Prediction, tracked_states
from mtpgo_ros.node.lanes.lane_input import LaneInput
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.quality.live_calibrator import LiveCalibrator
from mtpgo_ros.runtime.model_loading import load_model

_WARM_UP_AGENTS = (1, 2, 16, 32)
"""Scene sizes of the warm-up: torch prepares itself for each kind of size (measured)."""

_LONGEST_CYCLE_S = 5.0
"""A model that is to be replaced is waited for at most this long (s); chosen: far longer than a
prediction that is in time at the usual rates."""


class ModelHost:
    """Loads the model and predicts windows with the node's options.

    Args:
        parameters: name of the model, and the options.

    Attributes:
        predictor: scenes, model and fallback.
        calibrator: corrects predictions before they are published.
        degraded: why there is no model, empty if there is one.
        lanes: the lane lines of a model that uses them.
        lanes_read: what was read from the lane file, empty if nothing was.
        next_track: number of the next activation's first track: the calibrator, which stays, knows
            road users by their numbers.

    Raises:
        ModelFileError: the model cannot be loaded and ``require_model`` is set.
        ConfigurationError: the model uses lanes and the lane file cannot be used.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self.degraded, self.next_track = "", 0
        runner = None
        try:
            runner = load_model(parameters.model, parameters.num_threads, parameters.model_sha256)
        except ModelFileError as error:
            if parameters.require_model:
                raise
            self.degraded = str(error)
        if runner is not None and parameters.calibration == OFF:
            runner = runner.uncalibrated()
        self._runner = runner
        self._predicting = threading.Lock()  # held while a prediction runs or the model changes
        self._settings = threading.Lock()  # held while options or lanes change
        self._ego_key: KeyArray | None = None
        # Without lines the model runs as on a road without markings, which is better than none.
        self.predictor = ScenePredictor(runner, options=_options(parameters), lanes=LaneMap(()))
        self.calibrator = LiveCalibrator(
            parameters, self.predictor.task, keeps_file=runner is not None
        )
        self.lanes = LaneInput(self.set_lanes)
        self.lanes_read = self.lanes.read(parameters) if self.uses_lanes else ""

    @property
    def ego_key(self) -> KeyArray | None:
        """[4] identity of the ego, None if none is known."""
        return self._ego_key

    @property
    def uses_lanes(self) -> bool:
        """Whether lane lines are an input of the model."""
        return self._runner is not None and self.predictor.task.scene.uses_lanes

    def configure(self, parameters: PredictorParameters, ego_text: str) -> None:
        """Use other options and another ego from the next prediction on.

        Args:
            parameters: the options; their ``ego_id`` has priority over the topic's.
            ego_text: text from the topic ``ego_id``, empty if none came.
        """
        with self._settings:
            self.predictor.options = _options(parameters)
        self.calibrator.configure(parameters)
        if self.uses_lanes:
            self.lanes.configure(parameters)
        by_odometry = EGO_NAME if parameters.ego_topic else ""
        self._ego_key = first_key(parameters.ego_id, ego_text, by_odometry)

    def set_lanes(self, lanes: LaneMap) -> None:
        """Use these lane lines from the next prediction on."""
        with self._settings:
            self.predictor.lanes = lanes

    def reset(self) -> None:
        """Forget graphs and trails; any thread."""
        self.predictor.reset()

    def replace_by(self, loaded: ModelHost) -> None:
        """Predict with another model from the next prediction on; any thread.

        Options, ego, lanes, graphs and trails stay. The online calibration begins with what the
        other host has: nothing, or the calibration file if it is of that model.

        Args:
            loaded: a host whose model is loaded and warm; not to be used afterwards.

        Raises:
            ModelFileError: the other model needs another history, or the present one does not end
                its prediction.
        """
        if loaded.predictor.task.history != self.predictor.task.history:
            raise ModelFileError(
                f"model {loaded.predictor.task.name} takes another history than the present one:"
                f" {loaded.predictor.task.history}, expected {self.predictor.task.history};"
                " clean the node up and configure it with this model"
            )
        if not self._predicting.acquire(timeout=_LONGEST_CYCLE_S):
            raise ModelFileError(
                f"the present model has been predicting for more than {_LONGEST_CYCLE_S:g} s"
            )
        try:
            with self._settings:
                loaded.predictor.continue_from(self.predictor)
                had_lanes = self.uses_lanes
                self._runner, self.predictor = loaded._runner, loaded.predictor
                self.degraded = loaded.degraded
                # What was learned about the other model's errors does not hold for this one.
                self.calibrator.close()
                loaded.calibrator.look_at_file()  # which has just been written
                # Parameters may have changed while the other host was loaded.
                loaded.calibrator.configure(self.calibrator.parameters)
                self.calibrator = loaded.calibrator
            if self.uses_lanes != had_lanes:
                self.lanes.continue_with(loaded.lanes)
        finally:
            self._predicting.release()

    def predict(self, window: HistoryWindow) -> Prediction:
        """Return the model's prediction, constant velocity where its output is not usable."""
        with self._predicting:
            return self.predictor.predict(window, ego_key=self._ego_key)

    def fallback(self, window: HistoryWindow) -> Prediction:
        """Return constant velocity for all agents; any thread."""
        return self.predictor.fallback(window)

    def limitations(self) -> list[str]:
        """Return why predictions are worse than they could be, except for a missing model."""
        policy = self.predictor.options.policy or self.predictor.task.scene.policy
        found = []
        if policy == "ego" and self._ego_key is None:
            found.append("graph is 'ego' but no ego is known, 'cover' is used instead")
        return found + (self.lanes.limitations() if self.uses_lanes else [])

    def describe(self) -> dict[str, str]:
        """Return name and hashes of the model and its settings, for the diagnostics."""
        task, options = self.predictor.task, self.predictor.options
        return {
            "model": task.name if self._runner is not None else "constant velocity",
            "file": str(self._runner.path) if self._runner is not None else "",
            "model_sha256": self._runner.sha256 if self._runner is not None else "",
            "weights_sha256": task.weights_sha256 if self._runner is not None else "",
            "graph": options.policy or task.scene.policy,
            "max_neighbours": str(options.max_neighbours or task.scene.max_neighbours),
            "radius_m": f"{options.radius_m or task.scene.radius_m:g}",
            "horizon_s": f"{task.horizon_steps * task.history.dt_s:g}",
            "modes": str(self.predictor.modes),
            **self.lanes.values(),
        }

    def warm_up(self, *, permanent: bool = True) -> None:
        """Predict synthetic agents a few times, so that the first real prediction is not slow.

        Args:
            permanent: all objects of the process made so far are permanent: the garbage collector
                need not visit them. Looking for garbage first stops all threads for a while.
        """
        task = self.predictor.task
        for agents in _WARM_UP_AGENTS:
            trial = ScenePredictor(
                self._runner, options=self.predictor.options, task=task, lanes=self.predictor.lanes
            )
            history = TrackHistory(task.history)
            for step in range(task.history.steps):
                time_s = step * task.history.dt_s
                row = np.arange(agents, dtype=np.float64)
                position = np.stack([10.0 * time_s + 12.0 * row, 3.5 * (row % 4)], axis=1)
                key = keys_from_integers(range(agents))
                history.update(tracked_states(round(time_s * 1e9) + 1, "map", key, position))
            trial.predict(history.window())
        if permanent:
            # Reference cycles left by an earlier configuration are collected first, or they would
            # stay forever.
            gc.unfreeze()
            gc.collect()
            gc.freeze()


def _options(parameters: PredictorParameters) -> PredictorOptions:
    return PredictorOptions(
        policy=parameters.graph or None,
        max_neighbours=parameters.max_neighbours or None,
        radius_m=parameters.radius or None,
        max_agents=parameters.max_agents,
        max_points=parameters.max_points,
        use_tracker_covariance=parameters.use_tracker_covariance,
        path_smoothing_s=parameters.path_smoothing,
    )
