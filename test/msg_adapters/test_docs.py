# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What docs/messages.md shows is run, and its tables are checked against the code."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.inputs.object_cloud import COVARIANCE_FIELDS
from msg_adapters.predictions import POINT, prediction_to_pointcloud2
from msg_adapters.registry import INPUTS, OUTPUTS
from mtpgo_core.schema import AgentClass, Prediction

TEXT = (Path(__file__).parents[2] / "docs" / "messages.md").read_text(encoding="utf-8")
PUBLISHER, DECODER, QUESTIONS, PLAIN = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
TYPE = "sensor_msgs/msg/PointCloud2"


def test_publisher_example():
    pytest.importorskip("rclpy")
    names: dict = {}
    exec(PUBLISHER, names)
    found = INPUTS["pointcloud2"].to_states(names["message"])
    np.testing.assert_array_equal(found.position, [[0.0, 0.0], [30.0, 3.5]])
    assert found.key[:, 0].tolist() == [17, 18]


def test_decoder_example(prediction, offline, capsys):
    exec(DECODER, {"message": prediction_to_pointcloud2(prediction, offline)})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    x, y = prediction.mean[1, 0, -1, :2]
    assert lines[1].startswith(
        f"track {prediction.key[1, 0]}: {prediction.weight[1, 0]:.0%} to be"
    )
    assert f"({x:.1f}, {y:.1f}) m in 1.0 s" in lines[1]


def test_example_of_what_is_asked_most_often(prediction, offline, typestore, tmp_path):
    pytest.importorskip("pandas")
    key = prediction.key.copy()
    key[1] = [17, 0, 0, 0]
    prediction = dataclasses.replace(prediction, key=key)
    bag = tmp_path / "drive.mcap"
    with McapWriter(bag) as out:
        out.add_topic("/predictor/predictions", TYPE)
        message = prediction_to_pointcloud2(prediction, out.types)
        out.write("/predictor/predictions", prediction.stamp_ns, message)
    names = {
        "data": bytes(typestore.serialize_cdr(message, TYPE)),
        "now_ns": prediction.stamp_ns - 300_000_000,
        "bag": bag,
    }
    exec(QUESTIONS, names)
    assert names["row"] == 1
    np.testing.assert_allclose(names["path"], prediction.mean[1, 0], rtol=1e-6)
    then = 0.5 * (prediction.mean[:, :, 2] + prediction.mean[:, :, 3])
    np.testing.assert_allclose(names["then"].mean[:, :, 0], then, rtol=1e-5)
    wanted = (prediction.weight[..., None] * then).sum(axis=1)
    np.testing.assert_allclose(names["mean"][:, 0], wanted, rtol=1e-4, atol=1e-4)
    back = names["vehicle"].point(names["around_us"].mean[..., :2])
    np.testing.assert_allclose(back, prediction.mean[..., :2], atol=1e-4)
    expected = np.sqrt(prediction.covariance[:, :, -1, 0, 0].mean(axis=1))
    np.testing.assert_allclose(np.sort(names["spread"]), np.sort(expected), rtol=1e-6)


def test_every_attribute_of_a_prediction_is_documented():
    section = TEXT.partition("#### Reading it in Python")[2].partition("#### Reading it in C++")[0]
    for field in dataclasses.fields(Prediction):
        assert f"`{field.name}`" in section, field.name


def test_example_without_the_package(prediction, offline):
    names = {"message": prediction_to_pointcloud2(prediction, offline)}
    exec(PLAIN, names)
    x = names["points"]["x"].reshape(3, 4, 5)
    np.testing.assert_allclose(x, prediction.mean[..., 0], rtol=1e-6)


def test_output_table_is_the_layout():
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \| (FLOAT32|UINT32|UINT8) \|", TEXT, re.MULTILINE)
    kinds = {"FLOAT32": "<f4", "UINT32": "<u4", "UINT8": "u1"}
    layout = [
        (str(POINT.fields[name][1]), name, np.dtype(POINT.fields[name][0])) for name in POINT.names
    ]
    assert [(offset, name, np.dtype(kinds[kind])) for offset, name, kind in rows] == layout


def test_every_kind_and_field_is_documented():
    for adapter in (*INPUTS.values(), *OUTPUTS.values()):
        assert f"`{adapter.name}`" in TEXT
        assert f"`{adapter.message_type}`" in TEXT
    for name in COVARIANCE_FIELDS:
        assert f"`{name}`" in TEXT
    for member in AgentClass:
        assert f"| {member.value} | {member.name.lower()} |" in TEXT
