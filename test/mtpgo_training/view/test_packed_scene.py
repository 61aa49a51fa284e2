# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The packed scene, unpacked again by a second implementation."""

import dataclasses
import json
import zlib

import numpy as np
import pytest

from mtpgo_core.schema import AgentClass, CalibrationStage, Source
from mtpgo_training.view.packed_scene import POSITION_M, pack_integers, pack_scene, path_indices
from mtpgo_training.view.view_scene import rows_by_track


def unpack(packed):
    """Return head and columns, number by number."""
    data = zlib.decompress(packed)
    start = 4 + int.from_bytes(data[:4], "little")
    head = json.loads(data[4:start])
    columns, at = {}, start
    for name, count in head["columns"]:
        values = []
        for _ in range(count):
            value = shift = 0
            while True:
                byte = data[at]
                at += 1
                value |= (byte & 127) << shift
                shift += 7
                if byte < 128:
                    break
            values.append((value >> 1) ^ -(value & 1))
        columns[name] = values
    assert at == len(data)
    return head, columns


def second_sums(values):
    """Undo differences of order 2 of one part."""
    out, change = [], 0
    for i, value in enumerate(values):
        change = value if i <= 1 else change + value
        out.append(value if i == 0 else out[-1] + change)
    return np.array(out)


def test_numbers_of_any_size_and_sign_are_packed():
    values = np.array([0, -1, 1, 63, -64, 64, -65, 8191, 8192, -(2**31), 2**40])
    packed = pack_integers(values)
    head = {"columns": [["a", len(values)]]}
    text = json.dumps(head).encode()
    whole = zlib.compress(len(text).to_bytes(4, "little") + text + packed)
    assert unpack(whole)[1]["a"] == values.tolist()
    assert len(pack_integers(np.array([0, -1, 1, 63, -64]))) == 5


def test_positions_are_kept_to_the_step(scene):
    head, columns = unpack(pack_scene(scene))
    order, starts = rows_by_track(scene.recording)
    at = 0
    for track, rows in enumerate(columns["track_rows"]):
        for axis, name in enumerate(("row_x", "row_y")):
            found = second_sums(columns[name][at : at + rows]) * POSITION_M
            own = scene.recording.position[order[starts[track] : starts[track + 1]], axis]
            assert np.abs(found + head["origin"][axis] - own).max() <= POSITION_M / 2 + 1e-9
        at += rows
    assert head["ids"] == ["7", "8"]
    assert np.cumsum(columns["frame_ms"])[-1] == 12_000


def test_modes_weights_and_errors_are_kept(scene):
    head, columns = unpack(pack_scene(scene))
    points = len(head["path_s"])
    shown = scene.predictions[0].prediction
    modes = columns["agent_modes"][0]
    path = path_indices(shown.time_s)
    first = second_sums(columns["mode_x"][:points]) * POSITION_M + head["origin"][0]
    np.testing.assert_allclose(first, shown.mean[0, 0, path, 0], atol=POSITION_M)
    other = second_sums(columns["mode_y"][points : 2 * points]) * POSITION_M
    np.testing.assert_allclose(other, 1.0, atol=2 * POSITION_M)  # beside the first mode
    weights = np.array(columns["mode_weight"][:modes]) / head["steps"]["weights"]
    np.testing.assert_allclose(weights, shown.weight[0, :modes], atol=1e-3)
    assert columns["agent_final"][0] == 1  # known, and zero
    assert columns["agent_final"][-1] == 0  # not known
    assert [head["path_s"][i] for i in head["ellipse_points"]] == [1.0, 3.0, 5.0]


def test_ellipses_are_kept_to_their_step(scene):
    head, columns = unpack(pack_scene(scene))
    steps = head["steps"]
    prediction = scene.predictions[0].prediction
    value = np.linalg.eigvalsh(prediction.covariance[0, 0, 4])
    radius = np.sqrt(-2.0 * np.log(0.1) * value)
    found = [
        steps["ellipse_base"] * np.exp(columns[name][0] / steps["ellipse_steps"])
        for name in ("ellipse_minor", "ellipse_major")
    ]
    np.testing.assert_allclose(found, radius, rtol=0.05)


def test_every_value_of_the_fields_of_a_prediction_has_a_name(scene):
    head, _ = unpack(pack_scene(scene))
    for names, values in (
        ("classes", AgentClass),
        ("sources", Source),
        ("stages", CalibrationStage),
    ):
        assert len(set(head[names])) == len(values) == max(values) + 1


def test_a_scene_without_predictions_is_packed(scene):
    head, columns = unpack(pack_scene(dataclasses.replace(scene, predictions=())))
    assert head["path_s"] == []
    assert columns["prediction_ms"] == []


def test_holes_in_a_filtered_cloud_are_left_out(scene):
    holes = scene.predictions[0]
    mean = holes.prediction.mean.copy()
    mean[0, 0, 5] = np.nan
    broken = dataclasses.replace(
        holes, prediction=dataclasses.replace(holes.prediction, mean=mean)
    )
    _, columns = unpack(pack_scene(dataclasses.replace(scene, predictions=(broken,))))
    assert columns["agent_modes"] == [1, 2]


def test_predictions_with_other_steps_are_told(scene, caplog):
    first, second = scene.predictions[:2]
    short = dataclasses.replace(
        second.prediction,
        time_s=second.prediction.time_s[:10],
        mean=second.prediction.mean[:, :, :10],
        covariance=second.prediction.covariance[:, :, :10],
        sigma_factor_50=second.prediction.sigma_factor_50[:, :10],
    )
    both = (first, dataclasses.replace(second, prediction=short))
    _, columns = unpack(pack_scene(dataclasses.replace(scene, predictions=both)))
    assert len(columns["prediction_ms"]) == 1
    assert "1 of the 2 predictions of made have other steps than the first" in caplog.text


@pytest.mark.parametrize("rate", [10.0, 25.0])
def test_frames_come_at_most_every_tenth_of_a_second(scene, rate):
    fast = dataclasses.replace(scene.recording, frame_rate=rate)
    _, columns = unpack(pack_scene(dataclasses.replace(scene, recording=fast, predictions=())))
    assert min(columns["frame_ms"][1:]) >= 90
