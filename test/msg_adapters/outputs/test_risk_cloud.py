# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The clouds of the risk: round trip through bytes, docs/risk.md, unknown values."""

import re
from pathlib import Path

import numpy as np
import pytest

from msg_adapters.outputs.risk_cloud import (
    AGENT_POINT,
    STEP_POINT,
    agents_from_cloud,
    risk_to_agent_cloud,
    risk_to_step_cloud,
    steps_from_cloud,
)
from msg_adapters.predictions import prediction_to_pointcloud2
from mtpgo_core.errors import MessageError
from mtpgo_core.frames import Pose2
from mtpgo_core.risk.collision_risk import Unknown, assess
from mtpgo_core.risk.ego_plan import EgoFootprint, plan_of_motion

TYPE = "sensor_msgs/msg/PointCloud2"
TEXT = (Path(__file__).parents[3] / "docs" / "risk.md").read_text(encoding="utf-8")


@pytest.fixture
def risk(prediction):
    plan = plan_of_motion(prediction.stamp_ns, "map", Pose2(0.0, 0.0, 0.0, velocity=(9.0, 1.0)))
    return assess(prediction, plan, EgoFootprint(length=60.0, width=40.0))


def test_round_trip_of_the_road_users(risk, offline, decoded):
    for message in decoded(risk_to_agent_cloud(risk, offline), TYPE, with_rclpy=True).values():
        found = agents_from_cloud(message)
        assert message.header.frame_id == "map"
        assert message.is_dense
        assert found["probability"].max() > 0.1
        np.testing.assert_allclose(found["probability"], risk.peak, rtol=1e-6)
        np.testing.assert_allclose(found["at_least"], risk.at_least, rtol=1e-6)
        np.testing.assert_allclose(found["t"], risk.peak_time_s, rtol=1e-6)
        np.testing.assert_allclose(found["distance_50"], risk.distance_m[:, 1], rtol=1e-6)
        assert [found[f"id_{i}"].tolist() for i in range(4)] == risk.key.T.tolist()
        assert found["class"].tolist() == risk.agent_class.tolist()
        assert found["known_steps"].tolist() == [5, 5, 5]
        assert (found["unknown"] == Unknown.KNOWN).all()
        x = [risk.position[i, step, 0] for i, step in enumerate(risk.peak_step)]
        np.testing.assert_allclose(found["x"], x, rtol=1e-6)


def test_round_trip_of_the_steps(risk, offline, decoded):
    for message in decoded(risk_to_step_cloud(risk, offline), TYPE, with_rclpy=True).values():
        found = steps_from_cloud(message).reshape(3, 5)
        np.testing.assert_allclose(found["probability"], risk.probability, rtol=1e-6)
        np.testing.assert_allclose(found["t"], np.tile(risk.time_s, (3, 1)), rtol=1e-6)
        assert found["step"].tolist() == [[0, 1, 2, 3, 4]] * 3
        assert found["id_0"][:, 0].tolist() == risk.key[:, 0].tolist()


def test_an_unknown_risk_is_nan_and_says_why(prediction, offline):
    unknown = assess(prediction, None, EgoFootprint(), reason=Unknown.STALE)
    message = risk_to_agent_cloud(unknown, offline)
    assert not message.is_dense
    agents = agents_from_cloud(message)
    steps = steps_from_cloud(risk_to_step_cloud(unknown, offline))
    for name in ("probability", "at_least", "distance_05", "t"):
        assert np.isnan(agents[name]).all()
    assert np.isnan(steps["probability"]).all()
    assert (agents["unknown"] == Unknown.STALE).all()
    assert (steps["unknown"] == Unknown.STALE).all()
    assert np.isfinite(agents["x"]).all()  # the road users are still there


def test_other_clouds_are_refused(prediction, offline):
    with pytest.raises(MessageError, match="lacks the field probability, at_least"):
        agents_from_cloud(prediction_to_pointcloud2(prediction, offline))


def test_the_tables_of_the_page_are_the_layouts():
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \| (FLOAT32|UINT32|UINT8) \|", TEXT, re.MULTILINE)
    kinds = {"<f4": "FLOAT32", "<u4": "UINT32", "|u1": "UINT8"}
    wanted = [
        (str(layout.fields[name][1]), name, kinds[layout.fields[name][0].str])
        for layout in (AGENT_POINT, STEP_POINT)
        for name in layout.names
    ]
    assert rows == wanted


def test_the_codes_of_the_page_are_those_of_the_code():
    section = TEXT.split("## Unknown is not low")[1].split("##")[0]
    codes = [int(code) for code in re.findall(r"^\| (\d) \|", section, re.MULTILINE)]
    assert codes == [member.value for member in Unknown]


def test_the_worked_example_runs(prediction, offline, capsys):
    (example,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    names = {"message": prediction_to_pointcloud2(prediction, offline)}
    exec(example, names)
    lines = capsys.readouterr().out.splitlines()
    weight, mean = prediction.weight[0], prediction.mean[0, :, 1, :2]
    middle = weight @ mean
    assert lines[0].startswith(f"middle ({middle[0]:.1f}, {middle[1]:.1f}) m")
    rng = np.random.default_rng(0)
    modes = rng.choice(len(weight), 20_000, p=weight)
    roots = np.linalg.cholesky(prediction.covariance[0, :, 1])
    samples = mean[modes] + np.einsum("kij,kj->ki", roots[modes], rng.normal(size=(20_000, 2)))
    np.testing.assert_allclose(names["spread"], np.cov(samples.T), rtol=0.05, atol=2.0)
    assert abs(names["share"] - (samples[:, 0] > 10.0).mean()) < 0.02
    assert lines[2].startswith("highest risk ")
