# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node's scores of its own predictions, over DDS, compared with those of its bag."""

import json
from collections import defaultdict

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.serialization import serialize_message
from rclpy.time import Time
from ros_helpers import START_NS, Bench, message_of, parameters_of
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.outputs.quality_table import quality_from_array
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass, tracked_states
from mtpgo_core.task.calibration import GROUPS
from mtpgo_training.cli import main

CLOUD = "sensor_msgs/msg/PointCloud2"
SECONDS, AGENTS = 9.0, 14
COMPARED = ("ade", "fde", "miss_rate", "nll", "coverage_50", "coverage_90", "cv_ade")


def weaving_traffic(time_s):
    """Vehicles, a bicycle and pedestrians that weave, brake and stand, with odd observations."""
    number = np.arange(1, AGENTS + 1)
    speed, phase = 3.0 + number, 0.7 * number
    x = speed * time_s + 4.0 * np.sin(0.5 * time_s + phase)
    y = 12.0 * number + 2.0 * np.sin(0.8 * time_s + phase)
    velocity = np.stack(
        [
            speed + 2.0 * np.cos(0.5 * time_s + phase),
            1.6 * np.cos(0.8 * time_s + phase),
        ],
        axis=1,
    )
    position = np.stack([x, y], axis=1)
    position[0], velocity[0] = (5.0, 5.0), 0.0
    kinds = np.full(AGENTS, AgentClass.CAR)
    kinds[3], kinds[4:7], kinds[7] = AgentClass.BICYCLE, AgentClass.PEDESTRIAN, AgentClass.UNKNOWN
    if time_s > 4.0:
        position[8] += 300.0  # an impossible move
    present = np.ones(AGENTS, dtype=bool)
    present[9] = not 3.0 < time_s < 4.0  # a gap
    present[10] = time_s < 2.5  # leaves
    present[11] = time_s > 3.3  # comes
    if abs(time_s - 2.0) < 0.05:
        position[12] = np.nan
    return tracked_states(
        START_NS + round(time_s * 1e9),
        "map",
        keys_from_integers(number[present].tolist()),
        position[present],
        agent_class=kinds[present].astype(np.uint8),
        velocity=velocity[present],
        yaw=np.zeros(int(present.sum())),
    )


@pytest.fixture(scope="module")
def played(models, tmp_path_factory):
    """Traffic with jitter through the node.

    Returns the bench, the last table of scores, the messages for people, the texts, and the bag.
    """
    bench = Bench(models["quick"], quality_min_agents=1, quality_window=60, max_modes=2)
    tables, people, texts, clouds = [], [], [], []
    listen = bench.peer.create_subscription
    listen(Float64MultiArray, "predictor/quality_table", tables.append, 20)
    listen(DiagnosticArray, "predictor/quality", people.append, 20)
    listen(MarkerArray, "predictor/quality_markers", texts.append, 20)
    listen(PointCloud2, "predictor/predictions", clouds.append, 20)
    bench.start().be_patient()
    worker = bench.node._pipeline.worker
    random = np.random.default_rng(5)
    path = tmp_path_factory.mktemp("bag") / "online"
    with McapWriter(path) as bag:
        bag.add_topic("/objects", CLOUD)
        bag.add_topic("/predictor/predictions", CLOUD)
        for step in range(round(SECONDS * 10)):
            jitter_s = random.uniform(-0.02, 0.02) if step else 0.0
            states = weaving_traffic(step / 10 + jitter_s)
            message = message_of(states)
            bench.send(message)
            bag.write_bytes("/objects", states.stamp_ns, serialize_message(message))
            bench.until(lambda: not worker._waiting and worker._running is None)
        bench.until(lambda: len(clouds) == bench.count("predictions"))
        for cloud in clouds:
            stamp_ns = cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec
            bag.write_bytes("/predictor/predictions", stamp_ns + 1000, serialize_message(cloud))
    last_s = states.stamp_ns * 1e-9
    bench.until(
        lambda: tables and abs(quality_from_array(tables[-1])["stamp_s"][0] - last_s) < 1e-3
    )
    last = Time(nanoseconds=states.stamp_ns).to_msg()
    bench.until(lambda: texts and people[-1].header.stamp == last)
    yield bench, quality_from_array(tables[-1]), people, texts, path
    bench.close()


def test_the_text_in_the_scene_waits_for_a_frame(models):
    """Displays report a marker without one as an error."""
    bench = Bench(models["quick"])
    tables, texts = [], []
    bench.peer.create_subscription(Float64MultiArray, "predictor/quality_table", tables.append, 20)
    bench.peer.create_subscription(MarkerArray, "predictor/quality_markers", texts.append, 20)
    bench.start()
    markers = bench.node._pipeline._quality_publisher._markers
    bench.until(lambda: markers.get_subscription_count() > 0)
    seen = len(tables)
    bench.until(lambda: len(tables) >= seen + 2)
    assert texts == []
    bench.predict(weaving_traffic(0.0))
    bench.until(lambda: texts)
    assert texts[0].markers[0].header.frame_id == "map"
    bench.close()


def test_the_same_scores_from_a_bag(played, tmp_path, capsys):
    _, rows, _, _, bag = played
    out = tmp_path / "scores.json"
    assert main(["evaluate", "--predictions", str(bag), "--json", str(out)]) == 0
    assert "as the node scores it live" in capsys.readouterr().out
    offline = json.loads(out.read_text())["live"]["online"]
    online = {
        (GROUPS[r["group"]], r["window_s"], r["time_s"]): r for r in rows if r["predictions"]
    }
    assert {group for group, _, _ in online} == {
        "vehicle_standing",
        "vehicle_moving",
        "two_wheeler_moving",
        "pedestrian_moving",
        "any_moving",
    }
    assert len(offline) == len(online) == 5 * 3 * 3
    for row in offline:
        live = online[row["group"], row["window_s"], row["time_s"]]
        for name in ("agents", "predictions", "by_model"):
            assert row[name] == live[name], (row, name)
        for name in COMPARED:
            assert row[name] == pytest.approx(live[name], abs=1e-3, rel=1e-3), (row, name)
    moving = online["vehicle_moving", 60, 3]
    assert moving["ade"] > 0.5
    assert moving["predictions"] > 100


def test_odd_truth_is_counted_by_cause_and_enters_no_score(played):
    bench, rows, *_ = played

    def counted():
        pairs = bench.statuses["quality"].values
        found = {p.key: int(p.value) for p in pairs if p.key.startswith("no_truth_")}
        return defaultdict(int, found)

    bench.until(lambda: counted()["no_truth_restarted"] > 0 and counted()["no_truth_gap"] > 0)
    assert counted()["no_truth_clock_reset"] == counted()["no_truth_frame_changed"] == 0
    assert np.nanmax(rows["fde"]) < 20.0  # the move of 300 m is in none


def test_people_get_a_status_for_every_group_and_window(played):
    bench, rows, people, texts, _ = played
    name = bench.namespace.strip("/") + "/predictor"
    statuses = {status.name: status for status in people[-1].status}
    moving = statuses[f"{name}: quality of moving vehicle in 1 min"]
    values = {pair.key: pair.value for pair in moving.values}
    row = rows[(rows["window_s"] == 60) & (rows["group"] == 1) & (rows["time_s"] == 3)][0]
    assert float(values["ade_3s"]) == pytest.approx(row["ade"], abs=1e-4)
    assert int(values["agents_3s"]) == row["agents"]
    text = texts[-1].markers[0]
    assert text.header.frame_id == "map"
    assert "moving vehicle: " in text.text


def test_the_limits_may_change_and_too_few_road_users_are_reported_in_place_of_numbers(played):
    bench, _, people, *_ = played

    def given(**values):
        request = SetParametersAtomically.Request(parameters=parameters_of(values))
        return bench.call(SetParametersAtomically, "set_parameters_atomically", request).result

    refused = given(quality_error_coverage=0.9)
    assert not refused.successful
    assert "expected at most quality_warn_coverage, 0.8" in refused.reason
    assert given(quality_warn_coverage=1.0, quality_error_coverage=1.0).successful
    bench.status("quality", DiagnosticStatus.ERROR, "90 % ellipses hold")
    assert given(quality_min_agents=100).successful
    values = bench.status("quality", DiagnosticStatus.OK, "too few road users to judge")
    assert values["vehicle_moving"].startswith("too few road users, ")
    bench.until(lambda: "too few road users" in people[-1].status[0].message)
    values = {pair.key: pair.value for pair in people[-1].status[0].values}
    assert values["scores_3s"] == "too few road users"
    assert not any(key.startswith("ade") for key in values)
