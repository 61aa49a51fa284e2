# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the online calibration changes on recordings, by the code that the node runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mtpgo_core.live_calibration.live_options import ONLINE, SHIPPED
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.evaluator import Settings, evaluate_all
from mtpgo_training.reports.honesty.live_scores import EFFECT_TITLES

Json = dict[str, Any]

_STRIDE_S = 0.4
"""Time between two predictions (s): the least from which the calibration learns each time."""


def calibration_effect(runner: ModelRunner, recordings: Sequence[Recording]) -> Json:
    """Return scores with the shipped calibration and with the online one.

    Args:
        runner: the model.
        recordings: each starts with the shipped calibration.

    Returns:
        By calibration, the values of
        :data:`~mtpgo_training.reports.honesty.live_scores.EFFECT_TITLES`.
    """
    settings = Settings(stride_s=_STRIDE_S, centre=False, online_effect=True)
    named = [(recording.name, recording) for recording in recordings]
    evaluation = evaluate_all({"model": runner}, named, settings)
    tables = {SHIPPED: evaluation.shipped, ONLINE: evaluation.online}
    averages = {name: table.averages()["model"]["all"] for name, table in tables.items()}
    return {
        name: {key: scores.get(key) for key in EFFECT_TITLES} for name, scores in averages.items()
    }
