# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The predictor that the node runs, on a recording; needs no table of scores."""

from __future__ import annotations

from collections.abc import Sequence

from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.prediction.scene_predictor import PredictorOptions, ScenePredictor
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import Float64Array, Prediction
from mtpgo_core.task.task_description import LANE_CONTEXTS, SceneConfig
from mtpgo_training.data.recording import Recording
from mtpgo_training.scenes.history_replay import replay

MAX_AGENTS = 10_000
"""Limit of the predictor offline (agents); chosen so high that the model predicts all of them."""


def make_predictor(
    runner: ModelRunner,
    recording: Recording,
    policy: str | None = None,
    path_smoothing_s: float = 0.0,
    *,
    trails: bool = True,
    lanes: bool = True,
) -> ScenePredictor:
    """Return the predictor that the node would run on this recording.

    Args:
        runner: the model.
        recording: whose lanes and site it knows.
        policy: graph policy, None for the model's own.
        path_smoothing_s: see :class:`~mtpgo_core.prediction.scene_predictor.PredictorOptions` (s).
        trails: see there.
        lanes: whether the model sees the recording's lanes. As in the node, a model with
            ``scene.lane_ways`` runs without any; one whose context they are does not.
    """
    return ScenePredictor(
        runner,
        options=PredictorOptions(
            policy=policy,
            max_agents=MAX_AGENTS,
            path_smoothing_s=path_smoothing_s,
            trails=trails,
        ),
        lanes=_lanes(runner.task.scene, recording.lanes if lanes else ()),
        site=recording.location,
    )


def _lanes(scene: SceneConfig, lines: Sequence[Float64Array]) -> LaneMap | None:
    """Return the lanes that a model sees, None where it needs some and there are none."""
    return None if not lines and scene.context in LANE_CONTEXTS else LaneMap(lines)


def predict_as_the_node(
    runner: ModelRunner, recording: Recording, stamps_ns: Sequence[int]
) -> list[Prediction]:
    """Return what the node would publish at ascending stamps, live calibration included.

    Args:
        runner: the model.
        recording: what is observed, from its first frame on.
        stamps_ns: times of the predictions (ns).
    """
    history = runner.task.history
    predictor = make_predictor(runner, recording)
    calibration = LiveCalibration(LiveOptions(), history, runner.task.horizon_steps)
    return [
        calibration.serve(predictor.predict(window), window)
        for window in replay(recording, history, stamps_ns, on_update=calibration.observe)
    ]
