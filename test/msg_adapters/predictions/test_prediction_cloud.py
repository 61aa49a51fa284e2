# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions in a PointCloud2: documented layout, round trip, unknown values."""

import dataclasses
import struct

import numpy as np
import pytest

from msg_adapters.predictions import prediction_from_pointcloud2, prediction_to_pointcloud2
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import MessageError
from mtpgo_core.schema import CalibrationStage

TYPE = "sensor_msgs/msg/PointCloud2"


def assert_equal(found, wanted):
    assert found.stamp_ns == wanted.stamp_ns
    assert found.frame_id == wanted.frame_id
    for name in ("key", "agent_class", "source", "calibration"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), name)
    for name in ("z", "time_s", "weight", "mean", "yaw", "covariance", "sigma_factor_50", "size"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(wanted, name), rtol=1e-6, err_msg=name
        )


def test_round_trip_through_cdr_and_three_decoders(prediction, offline, decoded):
    message = prediction_to_pointcloud2(prediction, offline)
    for again in decoded(message, TYPE, with_rclpy=True).values():
        assert_equal(prediction_from_pointcloud2(again), prediction)


def test_rclpy_class_with_field_checks(prediction, online, typestore):
    serialization = pytest.importorskip("rclpy.serialization")
    message = prediction_to_pointcloud2(prediction, online)
    data = serialization.serialize_message(message)
    assert_equal(prediction_from_pointcloud2(typestore.deserialize_cdr(data, TYPE)), prediction)


def test_documented_bytes_of_one_point(prediction, offline):
    """The layout of docs/messages.md, read with struct: agent 2, mode 1, step 3."""
    message = prediction_to_pointcloud2(prediction, offline)
    assert message.point_step == 88
    assert (message.width, message.height) == (3 * 4 * 5, 1)
    a, m, h = 2, 1, 3
    values = struct.unpack_from("<11f4I4BfB", bytes(message.data), 88 * ((a * 4 + m) * 5 + h))
    wanted = [
        *prediction.mean[a, m, h, :2],
        prediction.z[a],
        0.8,
        prediction.weight[a, m],
        *prediction.mean[a, m, h, 2:],
        prediction.yaw[a, m, h],
        *prediction.covariance[a, m, h].reshape(4)[[0, 1, 3]],
    ]
    np.testing.assert_allclose(values[:11], wanted, rtol=1e-6)
    assert list(values[11:15]) == prediction.key[a].tolist()
    assert values[15:19] == (2, m, h, 0)
    assert values[19] == pytest.approx(prediction.sigma_factor_50[a, h], rel=1e-6)
    assert values[20] == 1


def test_clouds_from_before_the_calibration_was_published_are_read(prediction, offline):
    message = prediction_to_pointcloud2(prediction, offline)
    points = np.frombuffer(bytes(message.data), dtype=np.uint8).reshape(-1, 88)
    message.data = np.ascontiguousarray(points[:, :64]).reshape(-1)
    message.fields = message.fields[:-6]
    message.point_step, message.row_step = 64, 64 * len(points)
    found = prediction_from_pointcloud2(message)
    np.testing.assert_allclose(found.mean, prediction.mean, rtol=1e-6)
    assert (found.sigma_factor_50 == 1.0).all()
    assert (found.calibration == CalibrationStage.NONE).all()
    assert np.isnan(found.size).all()


def test_max_modes_keeps_the_heaviest_and_renormalises(prediction, offline):
    message = prediction_to_pointcloud2(prediction, offline, max_modes=2)
    found = prediction_from_pointcloud2(message)
    np.testing.assert_allclose(found.weight.sum(axis=1), 1.0, rtol=1e-6)
    kept = prediction.weight[:, :2]
    np.testing.assert_allclose(found.weight, kept / kept.sum(1, keepdims=True), rtol=1e-6)
    np.testing.assert_allclose(found.mean, prediction.mean[:, :2], rtol=1e-6)


def test_shuffled_points_give_the_same_and_missing_ones_are_nan(prediction, offline):
    message = prediction_to_pointcloud2(prediction, offline)
    points = np.frombuffer(bytes(message.data), dtype="V88").copy()
    # Agent 0 stays first, so the order of the agents does not change.
    order = np.concatenate([[0], 1 + np.random.default_rng(1).permutation(len(points) - 1)])
    message.data = points[order].view(np.uint8)
    found = prediction_from_pointcloud2(message)
    agents = [prediction.key.tolist().index(key) for key in found.key.tolist()]
    np.testing.assert_allclose(found.mean, prediction.mean[agents], rtol=1e-6)

    lost = (1 * 4 + 3) * 5 + 4
    message.data = np.delete(points, lost).view(np.uint8)
    message.width -= 1
    found = prediction_from_pointcloud2(message)
    assert np.isnan(found.mean[1, 3, 4]).all()
    assert np.isnan(found.covariance[1, 3, 4]).all()
    kept = np.ones(found.yaw.shape, bool)
    kept[1, 3, 4] = False
    np.testing.assert_allclose(found.mean[kept], prediction.mean[kept], rtol=1e-6)
    np.testing.assert_allclose(found.weight, prediction.weight, rtol=1e-6)


def test_no_agents(prediction, offline, decoded):
    shared = ("stamp_ns", "frame_id", "time_s")
    names = [f.name for f in dataclasses.fields(prediction) if f.name not in shared]
    empty = {name: getattr(prediction, name)[:0] for name in names}
    message = prediction_to_pointcloud2(dataclasses.replace(prediction, **empty), offline)
    for again in decoded(message, TYPE, with_rclpy=True).values():
        found = prediction_from_pointcloud2(again)
        assert len(found) == 0
        assert (found.stamp_ns, found.frame_id) == (prediction.stamp_ns, "map")


def test_non_finite_output_is_not_marked_dense(prediction, offline):
    mean = prediction.mean.copy()
    mean[0, 0, 0, 0] = np.nan
    assert prediction_to_pointcloud2(prediction, offline).is_dense
    assert not prediction_to_pointcloud2(
        dataclasses.replace(prediction, mean=mean), offline
    ).is_dense


def test_other_clouds_are_refused(states, offline):
    with pytest.raises(MessageError, match=r"lacks the field t, weight, .*no predictions"):
        prediction_from_pointcloud2(INPUTS["pointcloud2"].from_states(states, offline))


def test_positions_at_utm_coordinates_are_exact(prediction, offline, decoded):
    mean = prediction.mean.copy()
    mean[..., :2] += (691_000.123, 5_334_000.456)
    far = dataclasses.replace(prediction, mean=mean)
    for again in decoded(prediction_to_pointcloud2(far, offline), TYPE, with_rclpy=True).values():
        found = prediction_from_pointcloud2(again)
        np.testing.assert_allclose(found.mean[..., :2], mean[..., :2], rtol=0.0, atol=1e-6)


def test_a_recording_without_the_rest_of_the_positions_is_read(prediction, offline):
    message = prediction_to_pointcloud2(prediction, offline)
    message.fields = [field for field in message.fields if not field.name.endswith("_rest")]
    assert_equal(prediction_from_pointcloud2(message), prediction)
