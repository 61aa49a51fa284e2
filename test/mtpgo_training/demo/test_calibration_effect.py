# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the demo shows of the online calibration."""

from traffic import braking_cars

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.model_file import find_model
from mtpgo_training.demo.calibration_effect import calibration_effect
from mtpgo_training.reports.honesty.live_scores import calibration_effect_table
from mtpgo_training.table_format import to_text


def test_both_calibrations_are_compared_on_the_same_predictions():
    runner = ModelRunner.load(find_model("default"))
    effect = calibration_effect(runner, [braking_cars("01", tracks=4, seconds=8.0)])
    assert list(effect) == ["shipped", "online"]
    for key in ("ade", "anll"):
        assert effect["shipped"][key] != effect["online"][key]
    text = to_text(calibration_effect_table(effect))
    assert "moving, 5 s" in text
    assert "ADE m" in text
    assert len(text.splitlines()) == 3
