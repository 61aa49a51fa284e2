# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The core as the node uses it: the model or its absence, options, ego, lanes. No ROS in here."""

from __future__ import annotations

import gc

import numpy as np

from mtpgo_core.errors import ModelFileError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers, keys_from_texts
from mtpgo_core.prediction.scene_predictor import (
    PredictionReport,
    PredictorOptions,
    ScenePredictor,
)
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import KeyArray, Prediction, tracked_states
from mtpgo_core.task.model_file import find_model, load_task
from mtpgo_ros.node.history_input import Work
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.runtime.executable import return_free_memory

_WARM_UP_AGENTS = (1, 2, 16, 32)
"""Sizes of scene run before the first deadline: torch prepares itself for each kind anew."""


class Engine:
    """Makes predictions of windows.

    Args:
        parameters: which model, and the options.

    Attributes:
        pipeline: history, scenes, model and fallback.
        degraded: why no model serves, empty if one does.

    Raises:
        ModelFileError: the model cannot be loaded and ``require_model`` is set.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self.degraded = ""
        runner = None
        try:
            path = find_model(parameters.model)
            load_task(path)
            # The runner brings torch along, which takes seconds: not for a file of no use.
            from mtpgo_core.prediction.model_runner import ModelRunner

            runner = ModelRunner.load(path, parameters.num_threads)
            return_free_memory()
        except ModelFileError as error:
            if parameters.require_model:
                raise
            self.degraded = str(error)
        self._runner = runner
        self._lanes_known = False
        self._ego_key: KeyArray | None = None
        # Without lines the model runs as on a road without markings, which beats no model.
        self.pipeline = ScenePredictor(runner, options=_options(parameters), lanes=LaneMap(()))

    @property
    def wants_lanes(self) -> bool:
        """Whether the model looks at lane lines."""
        return self._runner is not None and self.pipeline.task.scene.context == "lanes"

    @property
    def report(self) -> PredictionReport:
        """How the last prediction came about."""
        return self.pipeline.last_report

    def configure(self, parameters: PredictorParameters, ego_topic: str) -> None:
        """Take other options and another ego from the next prediction on.

        Args:
            parameters: the options; their ``ego_id`` goes before the topic's.
            ego_topic: what came on the topic ``ego_id``, empty if nothing.
        """
        self.pipeline.options = _options(parameters)
        text = parameters.ego_id.strip() or ego_topic.strip()
        self._ego_key = keys_from_texts([text])[0] if text else None

    def take_lanes(self, lanes: LaneMap) -> None:
        """Use these lane lines from the next prediction on."""
        self.pipeline.lanes = lanes
        self._lanes_known = True

    def predict(self, work: Work) -> Prediction:
        """The model's prediction, with constant velocity where it cannot serve."""
        return work.stamped(self.pipeline.predict(work.window, ego_key=self._ego_key))

    def fallback(self, work: Work) -> Prediction:
        """Constant velocity for all, from any thread."""
        return work.stamped(self.pipeline.fallback(work.window))

    def notes(self) -> list[str]:
        """Why the predictions are worse than they could be, beside a missing model."""
        policy = self.pipeline.options.policy or self.pipeline.task.scene.policy
        found = []
        if policy == "ego" and self._ego_key is None:
            found.append("graph is 'ego' but no ego is known, 'cover' stands in")
        if self.wants_lanes and not self._lanes_known:
            found.append("the model wants lanes, but nothing has come on lane_markings")
        return found

    def describe(self) -> dict[str, str]:
        """Name and hash of the model and what it serves, for the diagnostics."""
        task, options = self.pipeline.task, self.pipeline.options
        return {
            "model": task.name if self._runner is not None else "constant velocity",
            "file": str(self._runner.path) if self._runner is not None else "",
            "weights_sha256": task.weights_sha256 if self._runner is not None else "",
            "graph": options.policy or task.scene.policy,
            "max_neighbours": str(options.max_neighbours or task.scene.max_neighbours),
            "radius_m": f"{options.radius_m or task.scene.radius_m:g}",
            "horizon_s": f"{task.horizon_steps * task.history.dt_s:g}",
            "modes": str(self.pipeline.modes),
        }

    def warm_up(self) -> None:
        """Run the whole way a few times on made-up agents, so that no deadline pays for it."""
        task = self.pipeline.task
        for agents in _WARM_UP_AGENTS:
            trial = ScenePredictor(
                self._runner, options=self.pipeline.options, task=task, lanes=self.pipeline.lanes
            )
            history = TrackHistory(task.history)
            for step in range(task.history.steps):
                time_s = step * task.history.dt_s
                row = np.arange(agents, dtype=np.float64)
                position = np.stack([10.0 * time_s + 12.0 * row, 3.5 * (row % 4)], axis=1)
                key = keys_from_integers(range(agents))
                history.update(tracked_states(round(time_s * 1e9) + 1, "map", key, position))
            trial.predict(history.window())
        # What has been made by now stays: the collector need not look at it in every cycle.
        gc.collect()
        gc.freeze()


def _options(parameters: PredictorParameters) -> PredictorOptions:
    return PredictorOptions(
        policy=parameters.graph or None,
        max_neighbours=parameters.max_neighbours or None,
        radius_m=parameters.radius or None,
        max_agents=parameters.max_agents,
        use_tracker_covariance=parameters.use_tracker_covariance,
    )
