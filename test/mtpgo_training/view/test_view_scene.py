# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What of a recording is viewed, and what became of the predictions."""

import dataclasses

import numpy as np
import pytest
from demo_traffic import perfect_prediction

from mtpgo_core.identity import keys_from_strings
from mtpgo_training.view.view_scene import (
    drawn_speeds,
    drawn_yaws,
    ellipse_indices,
    identity_texts,
    view_scene,
)


def test_a_perfect_prediction_has_no_error(scene):
    first = scene.predictions[0]
    np.testing.assert_allclose(first.ade_m, 0.0, atol=1e-9)
    np.testing.assert_allclose(first.final_m, 0.0, atol=1e-9)
    assert first.inside.tolist() == [1.0, 1.0]


def test_an_offset_is_the_error(recording):
    prediction = perfect_prediction(recording, 0)
    prediction.mean[..., 0] += 3.0
    (seen,) = view_scene(recording, [prediction], name="made").predictions
    np.testing.assert_allclose(seen.ade_m, 3.0)
    np.testing.assert_allclose(seen.final_m, 3.0)


def test_what_is_not_observed_to_the_end_has_no_final_error(scene):
    last = scene.predictions[-1]  # at 10 s of 12 s
    assert np.isnan(last.final_m).all()
    assert np.isnan(last.inside).all()
    np.testing.assert_allclose(last.ade_m, 0.0, atol=1e-9)


def test_points_that_are_missing_count_in_no_score(recording):
    prediction = perfect_prediction(recording, 0)
    prediction.mean[..., 0] += 3.0
    prediction.mean[0, 0, 3] = np.nan
    prediction.mean[1, 0, -1] = np.nan
    prediction.covariance[0] = np.nan
    (seen,) = view_scene(recording, [prediction], name="made").predictions
    np.testing.assert_allclose(seen.ade_m, 3.0)
    np.testing.assert_allclose(seen.final_m, [3.0, np.nan])
    assert np.isnan(seen.inside).all()  # no covariance; no position


def test_a_compensated_delay_is_part_of_the_time(recording):
    prediction = perfect_prediction(recording, 1)
    late = dataclasses.replace(
        prediction,
        stamp_ns=recording.stamp_ns(0),
        time_s=prediction.time_s + 0.1,
    )
    (seen,) = view_scene(recording, [late], name="made").predictions
    np.testing.assert_allclose(seen.ade_m, 0.0, atol=1e-6)


def test_only_the_time_asked_for_is_shown(recording):
    predictions = [perfect_prediction(recording, frame) for frame in range(0, 101, 2)]
    cut = view_scene(recording, predictions, name="made", start_s=2.0, end_s=4.0)
    assert cut.recording.duration_s == pytest.approx(2.0)
    assert cut.offset_s == pytest.approx(2.0)
    assert [cut.since_start_s(p.prediction.stamp_ns) for p in cut.predictions] == pytest.approx(
        np.arange(0.0, 2.1, 0.2).tolist()
    )
    # What happened after the end still tells how good they were.
    assert np.isfinite(cut.predictions[-1].final_m).all()


def test_frame_and_identity_are_as_published(recording):
    moved = dataclasses.replace(perfect_prediction(recording, 0), frame_id="odom")
    assert view_scene(recording, [moved], name="made").frame_id == "odom"
    assert identity_texts(recording.key) == ["7", "8"]
    assert [len(text) for text in identity_texts(keys_from_strings(["a", "b"]))] == [36, 36]


def test_unknown_headings_and_speeds_are_drawn(recording):
    blind = dataclasses.replace(
        recording,
        yaw=np.full(len(recording), np.nan),
        velocity=np.full((len(recording), 2), np.nan),
    )
    turned = (drawn_yaws(blind) - recording.yaw + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(turned).max() < 0.1
    np.testing.assert_allclose(drawn_speeds(blind), 10.0, rtol=0.02)


def test_ellipses_are_at_the_headline_times():
    assert ellipse_indices(np.arange(1, 26) * 0.2).tolist() == [4, 14, 24]
    assert ellipse_indices(np.array([0.2, 0.4])).tolist() == [1]
    assert ellipse_indices(np.empty(0)).tolist() == []
    assert ellipse_indices(np.array([np.nan, 1.0, np.nan, 2.9, 3.0, np.nan])).tolist() == [1, 4]
