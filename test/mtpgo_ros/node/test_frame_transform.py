# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Transform into the fixed frame by odometry, by hand; TF is tested with the node."""

import sys
import types

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from ros_helpers import START_NS, RecordingLogger, traffic

from mtpgo_core.errors import FrameError
from mtpgo_core.history.odd_input import ODD_INPUT
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.node.frame_transform import FixedFrameTransform, NoTransform


@pytest.fixture
def transform():
    node = Node("transform")
    one = FixedFrameTransform(node, "odom", EventLog(RecordingLogger()))
    yield one
    one.close()
    node.destroy_node()


def odometry(time_s, x, *, child="base_link", parent="odom"):
    """A pose at (x, 0) m, turned by a quarter to the left, driving ahead at 5 m/s."""
    message = Odometry(child_frame_id=child)
    message.header.frame_id = parent
    stamp_ns = START_NS + round(time_s * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.pose.pose.position.x = x
    message.pose.pose.orientation.z = message.pose.pose.orientation.w = np.sqrt(0.5)
    message.twist.twist.linear.x = 5.0
    return message


def test_without_a_fixed_frame_states_are_unchanged():
    states = traffic(0.0, frame_id="base_link")
    assert NoTransform().apply(states) is states


def test_states_of_the_vehicle_are_rotated_and_shifted_by_its_pose(transform):
    transform.add_odometry(odometry(0.0, 100.0))
    transform.add_odometry(odometry(0.2, 104.0))
    # Agents at (1, 0) and (13, 0) m in the vehicle's frame, half way between the poses.
    states = transform.apply(traffic(0.1, agents=2, frame_id="base_link"))
    assert (states.frame_id, states.stamp_ns) == ("odom", START_NS + 100_000_000)
    assert states.position == pytest.approx(np.array([[102.0, 1.0], [102.0, 13.0]]))
    assert states.velocity == pytest.approx(np.array([[0.0, 10.0]] * 2), abs=1e-9)
    assert states.yaw == pytest.approx([np.pi / 2] * 2)


def test_after_the_last_pose_the_vehicle_is_extrapolated_by_its_velocity(transform):
    transform.add_odometry(odometry(0.0, 100.0))
    states = transform.apply(traffic(0.2, agents=1, frame_id="base_link"))
    # The vehicle drives along y: 1 m in 0.2 s; the agent is 2 m ahead of it.
    assert states.position == pytest.approx(np.array([[100.0, 3.0]]))
    with pytest.raises(FrameError, match=r"0\.300 s away, expected at most 0\.200 s"):
        transform.apply(traffic(0.3, agents=1, frame_id="base_link"))


def test_states_in_the_fixed_frame_and_empty_messages_need_no_pose(transform):
    states = traffic(0.0, frame_id="odom")
    assert transform.apply(states) is states
    empty = transform.apply(traffic(0.0, agents=0, frame_id=""))
    assert (empty.frame_id, len(empty)) == ("odom", 0)


def test_after_the_clock_was_set_back_no_pose_of_the_earlier_time_is_used(transform):
    for step in range(20):
        transform.add_odometry(odometry(0.1 * step, 100.0))
    for step in range(3):  # the same stamps, elsewhere: a simulation was reset
        transform.add_odometry(odometry(0.1 * step, 7.0))
    seen = traffic(0.15, agents=1, frame_id="base_link")
    assert transform.apply(seen).position[0, 0] == pytest.approx(7.0)
    transform.clear()
    with pytest.raises(FrameError, match="no pose is known"):
        transform.apply(seen)


def test_a_missing_pose_is_reported_with_what_was_received(transform):
    with pytest.raises(FrameError, match=r"'base_link', expected 'odom'.*nothing came there"):
        transform.apply(traffic(0.0, frame_id="base_link"))
    transform.add_odometry(odometry(0.0, 0.0, child="camera", parent="map"))
    with pytest.raises(FrameError, match="it gives 'camera' in 'map'"):
        transform.apply(traffic(0.0, frame_id="base_link"))


def test_odometry_that_is_none_is_counted_and_changes_nothing(transform):
    transform.add_odometry(odometry(0.0, 100.0))
    unstamped, nowhere, no_turn = (odometry(0.1, x) for x in (0.0, float("nan"), 0.0))
    unstamped.header.stamp.sec = unstamped.header.stamp.nanosec = 0
    no_turn.pose.pose.orientation.z = no_turn.pose.pose.orientation.w = 0.0
    for message in (unstamped, nowhere, no_turn):
        transform.add_odometry(message)
    states = transform.apply(traffic(0.1, agents=1, frame_id="base_link"))
    assert states.position == pytest.approx(np.array([[100.0, 1.5]]))
    assert transform._events.counts() == {"odometry_refused": 3}
    (line,) = transform._events._logger.warnings
    assert line == "message on /odometry left out: odometry has no stamp, expected the pose's time"
    (said,) = transform._events.recent(ODD_INPUT)  # of the last one
    assert "could not be used (odometry has the pose (0, 0) m, yaw nan rad" in said


def test_odometry_of_a_tilted_frame_cannot_place_objects(transform):
    """As TF; an optical frame has x to the right and y down, so its yaw says nothing."""
    message = odometry(0.0, 100.0, child="camera")
    q = message.pose.pose.orientation
    q.x, q.y, q.z, q.w = -0.5, 0.5, -0.5, 0.5
    transform.add_odometry(message)
    transform.add_odometry(odometry(0.0, 100.0))  # another frame does not suffer
    with pytest.raises(FrameError, match="frame 'camera' is tilted by 90 degrees in 'odom'"):
        transform.apply(traffic(0.0, agents=1, frame_id="camera"))
    assert transform.apply(traffic(0.0, agents=1, frame_id="base_link")).frame_id == "odom"
    q.x, q.y, q.z, q.w = 0.0, 0.0, 0.0, 2.0
    message.header.stamp.nanosec += 1
    transform.add_odometry(message)
    assert transform.apply(traffic(0.0, agents=1, frame_id="camera")).frame_id == "odom"
    assert transform._events.counts() == {}


def test_odometry_of_another_frame_on_the_topic_takes_no_pose_away(transform):
    for step in range(4):
        transform.add_odometry(odometry(0.1 * step, 100.0))
        transform.add_odometry(odometry(0.1 * step, 0.0, child="imu"))
        transform.add_odometry(odometry(0.1 * step, 7.0, parent="map"))
    states = transform.apply(traffic(0.1, agents=1, frame_id="base_link"))
    assert states.position[0, 0] == pytest.approx(100.0)
    # Of many frames the last ones are kept.
    for number in range(8):
        transform.add_odometry(odometry(0.3, 0.0, child=f"wheel_{number}"))
    with pytest.raises(FrameError, match="it gives 'wheel_7' in 'odom'"):
        transform.apply(traffic(0.1, agents=1, frame_id="base_link"))


def test_poses_of_other_frames_are_not_mixed(transform):
    transform.add_odometry(odometry(0.0, 100.0))
    transform.add_odometry(odometry(0.1, 0.0, child="camera"))
    transform.add_odometry(odometry(0.2, 200.0))
    states = transform.apply(traffic(0.2, agents=1, frame_id="base_link"))
    assert states.position[0, 0] == pytest.approx(200.0)
    states = transform.apply(traffic(0.1, agents=1, frame_id="base_link"))
    assert states.position == pytest.approx(np.array([[150.0, 1.0]]))


class SilentListener:
    """A listener of TF that hears nothing."""

    def __init__(self, buffer, node, *, spin_thread):
        pass

    def unregister(self):
        pass


def give_tf(monkeypatch, buffer):
    """Stand in for tf2_ros, of which there is no wheel, with a buffer."""
    module = types.SimpleNamespace(Buffer=buffer, TransformListener=SilentListener)
    monkeypatch.setitem(sys.modules, "tf2_ros", module)


def test_tf_serves_where_the_odometry_has_no_pose_at_the_time(monkeypatch):
    """It may come twice a second, or have ended."""

    class Buffer:
        def lookup_transform(self, target, source, when):
            if when.nanoseconds > START_NS + 10**9:
                raise LookupError("the future")
            transform = TransformStamped()
            transform.transform.translation.x = 7.0
            transform.transform.rotation.w = 1.0
            return transform

    give_tf(monkeypatch, Buffer)
    node = Node("transform")
    one = FixedFrameTransform(node, "odom", EventLog())
    one.add_odometry(odometry(0.0, 100.0))
    for time_s, x in ((0.1, 100.0), (0.4, 7.0 + 4.0)):
        states = one.apply(traffic(time_s, agents=1, frame_id="base_link"))
        assert states.position[0, 0] == pytest.approx(x)
    with pytest.raises(FrameError, match=r"2\.000 s away.*; TF has no .*the future"):
        one.apply(traffic(2.0, agents=1, frame_id="base_link"))
    one.close()
    node.destroy_node()


def test_an_optical_frame_of_a_camera_is_refused(monkeypatch):
    """Its z axis points forward, x to the right: quaternion (-0.5, 0.5, -0.5, 0.5)."""
    turn = [-0.5, 0.5, -0.5, 0.5]

    class Buffer:
        def lookup_transform(self, target, source, when):
            transform = TransformStamped()
            rotation = transform.transform.rotation
            rotation.x, rotation.y, rotation.z, rotation.w = turn
            return transform

    give_tf(monkeypatch, Buffer)
    node = Node("transform")
    one = FixedFrameTransform(node, "odom", EventLog())
    states = traffic(0.0, agents=1, frame_id="camera_optical_frame")
    with pytest.raises(FrameError, match=r"'camera_optical_frame'.* tilted by 90 degrees"):
        one.apply(states)
    # A lidar that looks down by 15 degrees is used.
    turn[:] = [0.0, float(np.sin(np.radians(7.5))), 0.0, float(np.cos(np.radians(7.5)))]
    assert one.apply(states).frame_id == "odom"
    one.close()
    node.destroy_node()
