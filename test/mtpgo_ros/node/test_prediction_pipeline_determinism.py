# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The same bag gives the same predictions, byte for byte, and those that it has always given."""

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2

from msg_adapters.bags.bag_reader import BagReader
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.conversions import make_time
from msg_adapters.predictions import prediction_from_pointcloud2
from msg_adapters.registry import INPUTS
from msg_adapters.ring_traffic import RingTraffic
from msg_adapters.types import RclpyTypes
from mtpgo_core.schema import Source

STEPS, DT_NS, START_NS = 20, 200_000_000, 1_700_000_000_000_000_000

GOLDEN = {"messages": 20, "agents": 238, "model": 238, "modes": 3, "steps": 25}
GOLDEN_REACH_M = 20_601.6
"""Distance from the first to the last mean position, summed over all agents (m): 238 of them for
4.8 s at the ring's mean speed of 18 m/s, which the model ``quick`` keeps."""


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A bag of twelve vehicles, of which one after the other is not seen for a while."""
    path = tmp_path_factory.mktemp("bag") / "traffic.mcap"
    traffic, kind = RingTraffic(12), INPUTS["pointcloud2"]
    with McapWriter(path) as out:
        out.add_topic("/objects", kind.message_type)
        for step in range(STEPS):
            stamp_ns = START_NS + step * DT_NS
            states = traffic.at(step * DT_NS * 1e-9, stamp_ns)
            seen = np.arange(12) != step // 2 % 12
            columns = {k: v[seen] for k, v in vars(states).items() if isinstance(v, np.ndarray)}
            out.write(
                "/objects",
                stamp_ns,
                kind.from_states(type(states)(**{**vars(states), **columns}), out.types),
            )
    return path


def predictions_of(bench, bag):
    """Return the bytes of every prediction of a node that runs on the time of a bag."""
    answers = []
    bench.peer.create_subscription(
        PointCloud2, "predictor/predictions", answers.append, 20, raw=True
    )
    clock = bench.peer.create_publisher(Clock, "/clock", 20)
    topic = bench.namespace + "/predictor/predictions"
    bench.until(lambda: bench.node.count_subscribers(topic) > 1)
    bench.until(lambda: clock.get_subscription_count() > 0)
    with BagReader(bag) as reader:
        for _, time_ns, data in reader.raw_messages(reader.topics(), START_NS, 2**62):
            clock.publish(Clock(clock=make_time(RclpyTypes(), time_ns)))
            bench.until(
                lambda time_ns=time_ns: bench.node.get_clock().now().nanoseconds >= time_ns
            )
            before = len(answers)
            bench.objects.publish(data)
            bench.until(lambda before=before: len(answers) > before)
    return [bytes(answer) for answer in answers]


def test_two_runs_on_a_bag_give_the_same_bytes(bench, bag):
    first, second = (
        predictions_of(bench("default", use_sim_time=True, output=["pointcloud2"]), bag)
        for _ in range(2)
    )
    assert len(first) == STEPS
    assert first == second


def test_the_predictions_of_a_bag_are_those_of_the_golden_summary(bench, bag):
    parameters = {"use_sim_time": True, "output": ["pointcloud2"], "path_smoothing": 0.0}
    answers = predictions_of(bench("quick", **parameters), bag)
    given = [prediction_from_pointcloud2(deserialize_message(a, PointCloud2)) for a in answers]
    assert {
        "messages": len(given),
        "agents": sum(len(one.key) for one in given),
        "model": sum(int((one.source == Source.MODEL).sum()) for one in given),
        "modes": max(one.mean.shape[1] for one in given),
        "steps": max(one.mean.shape[2] for one in given),
    } == GOLDEN
    reach = sum(
        float(np.linalg.norm(one.mean[:, 0, -1, :2] - one.mean[:, 0, 0, :2], axis=1).sum())
        for one in given
    )
    assert reach == pytest.approx(GOLDEN_REACH_M, abs=0.5)
