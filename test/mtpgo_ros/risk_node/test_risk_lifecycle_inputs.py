# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions of Autoware's type and plans in another frame, over DDS."""

import gc
import itertools
import math
import sys
import types

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from risk_bench import RiskBench
from risk_scene import ERROR, OK, WARN, prediction
from ros_helpers import borrowed_class
from ros_stubs import install_tf2_ros

from msg_adapters.outputs.autoware_predictions import prediction_to_predicted_objects_bytes
from mtpgo_core.risk.collision_risk import Unknown

PREDICTED = "autoware_perception_msgs/msg/PredictedObjects"


@pytest.fixture
def tf(monkeypatch):
    """A module tf2_ros that knows one transform: odom is turned by 180 degrees about (3, 0)."""
    known = types.SimpleNamespace(frames={("map", "odom")}, listening=0)

    class Buffer:
        def lookup_transform(self, target, source, when):
            if (target, source) not in known.frames:
                raise LookupError(f"{source} does not exist")
            found = TransformStamped()
            found.transform.translation.x = 3.0
            found.transform.rotation.z, found.transform.rotation.w = 1.0, 0.0
            return found

    class TransformListener:
        def __init__(self, buffer, node, *, spin_thread):
            known.listening += 1

        def unregister(self):
            known.listening -= 1

    module = types.SimpleNamespace(Buffer=Buffer, TransformListener=TransformListener)
    monkeypatch.setitem(sys.modules, "tf2_ros", module)
    return known


_namespaces = itertools.count()
"""A node that has ended is known until Python's garbage is collected."""


@pytest.fixture
def bench():
    """A function that starts benches; all are closed at the end."""
    made = []

    def start(*arguments, **parameters):
        name = f"/risk_inputs{next(_namespaces)}"
        made.append(RiskBench(name, *arguments, **parameters))
        made[-1].start()
        return made[-1]

    yield start
    for one in made:
        one.close()


def ego_places(one):
    """Return the x of the ego's box in every marker array so far, rounded (m)."""
    markers = [marker for array in one.got["markers"] for marker in array.markers]
    assert {marker.header.frame_id for marker in markers} <= {"map"}
    boxes = [marker for marker in markers if (marker.ns, marker.id) == ("risk_plan", 1)]
    return [round(box.pose.position.x, 3) for box in boxes]


def test_predicted_objects_are_read(bench, monkeypatch):
    kind = borrowed_class(monkeypatch, PREDICTED)
    one = bench(kind, prediction_type="autoware")
    one.plan()
    now_ns = one.node.get_clock().now().nanoseconds
    times = np.array([1.0, 2.0])
    given = prediction(
        stamp_ns=now_ns,
        initial=np.array([[3.0, 0.0, 0.0, 0.0], [40.0, 0.0, 0.0, 0.0]]),
        time_s=times,
    )
    data = prediction_to_predicted_objects_bytes(given)
    # The message has no covariance, so the risk is not known, and one sentence says why.
    found = one.answer(data)
    assert found["id_0"].tolist() == [1, 2]
    assert found["unknown"].tolist() == [Unknown.NO_PREDICTION] * 2
    assert np.isnan(found["probability"]).all()
    one.status("predictions", WARN, "2 of 2 road users have no usable covariance")
    one.until(lambda: one.got["occupancy"] and set(one.got["occupancy"][-1].data) == {-1})
    one.node.set_parameters([Parameter("missing_covariance", value="assumed")])
    found = one.answer(data)
    assert found["unknown"].tolist() == [Unknown.KNOWN] * 2
    assert found["probability"][0] > 0.9
    assert found["probability"][1] == 0.0
    assert one.got["risk"][-1].header.frame_id == "map"
    one.status("predictions", OK)
    # What is no such message is refused and counted.
    before = one.count("rejected")
    one.predictor.publish(data[:-40])
    one.until(lambda: one.count("rejected") > before)
    one.status("predictions", ERROR, "is cut off")


def test_a_plan_in_another_frame_is_transformed(bench, tf):
    one = bench()
    # There is no subscription to TF before it is needed.
    one.plan()
    assert one.predict(prediction())["probability"][0] > 0.8
    assert tf.listening == 0
    # The origin of odom is where the first road user stands; the ego is 37 m behind it there.
    one.plan(frame_id="odom", x=(-37.0, -37.0))
    found = one.predict(prediction())
    assert tf.listening == 1
    assert found["unknown"].tolist() == [Unknown.KNOWN] * 2
    assert found["probability"][0] == 0.0
    assert found["probability"][1] > 0.8
    one.status("plan", OK)
    one.until(lambda: 40.0 in ego_places(one))
    # A frame that TF does not know gives no risk, and one sentence says why.
    one.plan(frame_id="base_link")
    found = one.predict(prediction())
    assert found["unknown"].tolist() == [Unknown.NO_PLAN] * 2
    assert all(math.isnan(value) for value in found["probability"])
    one.status(
        "plan",
        ERROR,
        "the path is in the frame 'base_link' and the predictions in 'map', expected the same or a"
        " transform: TF has no transform from 'base_link' to 'map': base_link does not exist; the"
        " risk is unknown",
    )
    assert str(one.node.trigger_deactivate()).endswith("SUCCESS")
    assert tf.listening == 0


def test_a_plan_from_before_a_jump_back_of_the_clock_is_not_used(bench, monkeypatch):
    buffers = install_tf2_ros(monkeypatch)
    one = bench(use_sim_time=True)

    def tick(time_s):
        one.node.get_clock().set_ros_time_override(Time(nanoseconds=round(time_s * 1e9)))

    tick(100.0)
    one.plan(frame_id="odom")  # for which TF is asked
    one.predict(prediction())
    one.plan()
    assert one.predict(prediction())["unknown"].tolist() == [Unknown.KNOWN] * 2
    tick(99.9)  # only jitter
    assert one.predict(prediction())["unknown"].tolist() == [Unknown.KNOWN] * 2
    tick(99.0)
    assert one.predict(prediction())["unknown"].tolist() == [Unknown.NO_PLAN] * 2
    assert [buffer.cleared for buffer in buffers] == [1]
    one.status("plan", ERROR, "the clock was set")
    one.plan()
    assert one.predict(prediction())["unknown"].tolist() == [Unknown.KNOWN] * 2


def test_another_node_of_the_same_name_is_reported(bench):
    one = bench()
    one.plan()
    one.predict(prediction())
    one.status("predictions", OK)
    other = Node("risk", namespace=one.namespace)
    sentence = f"another node is called {one.namespace}/risk, and its risks go to the same topics"
    one.status("predictions", WARN, sentence)
    other.destroy_node()
    del other
    gc.collect()
    one.status("predictions", OK)
