# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Objects of a vehicle's frame in the fixed frame of the bag's odometry, worked out by hand."""

import dataclasses
import math

import numpy as np
import pytest
from fleet import EPOCH_NS, odometry_message

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.bags.mcap_writer import McapWriter
from mtpgo_core.errors import FrameError
from mtpgo_core.frames import Pose2
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states
from mtpgo_training.data.readers.bags.bag_poses import BagPoses

S_NS = 10**9


def poses_of(path, *topics):
    """Read the poses from topics, each a list of (time in s, pose, changes of the message)."""
    with McapWriter(path) as bag:
        for number, messages in enumerate(topics):
            bag.add_topic(f"/odometry_{number}", "nav_msgs/msg/Odometry")
            for time_s, pose, changes in messages:
                stamp_ns = EPOCH_NS + round(time_s * S_NS)
                message = dataclasses.replace(odometry_message(stamp_ns, pose), **changes)
                bag.write(f"/odometry_{number}", stamp_ns, message)
    return BagPoses(DecodingBagReader(path))


def seen(time_s, frame="base_link"):
    """One object 2 m ahead and 1 m to the left, which moves ahead at 3 m/s."""
    return tracked_states(
        EPOCH_NS + round(time_s * S_NS),
        frame,
        keys_from_integers([7]),
        np.array([[2.0, 1.0]]),
        velocity=np.array([[3.0, 0.0]]),
        yaw=np.array([0.0]),
    )


def test_objects_are_turned_and_moved_by_the_pose(tmp_path):
    north = Pose2(x=10.0, y=5.0, yaw=math.pi / 2)
    poses = poses_of(tmp_path / "a.mcap", [(0.0, north, {}), (1.0, north, {})])
    lifted = poses.lift(seen(1.0))
    assert lifted.frame_id == "odom"
    np.testing.assert_allclose(lifted.position, [[9.0, 7.0]])  # ahead is +y, left is -x
    np.testing.assert_allclose(lifted.velocity, [[0.0, 3.0]], atol=1e-12)
    np.testing.assert_allclose(lifted.yaw, [math.pi / 2])


def test_between_two_poses_the_pose_is_interpolated(tmp_path):
    start, end = Pose2(x=0.0, y=0.0, yaw=0.0), Pose2(x=8.0, y=-4.0, yaw=0.0)
    poses = poses_of(tmp_path / "a.mcap", [(0.0, start, {}), (2.0, end, {})])
    np.testing.assert_allclose(poses.lift(seen(0.5)).position, [[4.0, 0.0]])


def test_states_of_a_frame_without_odometry_are_unchanged(tmp_path):
    poses = poses_of(tmp_path / "a.mcap", [(0.0, Pose2(x=9.0, y=9.0, yaw=1.0), {})])
    states = seen(50.0, "map")
    assert poses.lift(states) is states
    nothing = dataclasses.replace(seen(50.0), key=states.key[:0], position=states.position[:0])
    assert poses.lift(nothing) is nothing


@pytest.mark.parametrize("time_s", [-1.0, 3.0])
def test_without_a_pose_at_the_time_the_reason_is_given(tmp_path, time_s):
    pose = Pose2(x=0.0, y=0.0, yaw=0.0)
    poses = poses_of(tmp_path / "a.mcap", [(0.0, pose, {}), (2.0, pose, {})])
    with pytest.raises(FrameError, match=r"is 1.000 s away, expected at most 0.200 s"):
        poses.lift(seen(time_s))


def test_of_two_topics_with_the_same_frame_the_first_is_used(tmp_path):
    first, second = Pose2(x=1.0, y=0.0, yaw=0.0), Pose2(x=500.0, y=0.0, yaw=0.0)
    poses = poses_of(tmp_path / "a.mcap", [(0.0, first, {})], [(0.0, second, {})])
    np.testing.assert_allclose(poses.lift(seen(0.0)).position, [[3.0, 1.0]])


def test_poses_of_a_frame_in_itself_are_ignored(tmp_path):
    pose = Pose2(x=5.0, y=0.0, yaw=0.0)
    poses = poses_of(tmp_path / "a.mcap", [(0.0, pose, {"child_frame_id": "odom"})])
    states = seen(0.0, "odom")
    assert poses.lift(states) is states


def two_robots(path, kind):
    """Objects of the second robot, and poses of both in frames of the same names."""
    message = {"odom": "nav_msgs/msg/Odometry", "tf": "tf2_msgs/msg/TFMessage"}[kind]
    with McapWriter(path) as bag:
        for name, x in (("/r1", 1000.0), ("/r2", -1000.0)):
            bag.add_topic(f"{name}/{kind}", message)
            for step in range(3):
                stamp_ns = EPOCH_NS + step * S_NS
                pose = odometry_message(stamp_ns, Pose2(x=x, y=0.0, yaw=0.0))
                if kind == "tf":
                    place, turn = pose.pose.pose.position, pose.pose.pose.orientation
                    make = bag.types.make
                    shift = make("geometry_msgs/msg/Vector3", x=place.x, y=place.y, z=0.0)
                    transform = make(
                        "geometry_msgs/msg/TransformStamped",
                        header=pose.header,
                        child_frame_id="base_link",
                        transform=make(
                            "geometry_msgs/msg/Transform", translation=shift, rotation=turn
                        ),
                    )
                    pose = make(message, transforms=[transform])
                bag.write(f"{name}/{kind}", stamp_ns, pose)
    return DecodingBagReader(path)


@pytest.mark.parametrize("kind", ["odom", "tf"])
def test_the_poses_of_another_robot_are_not_taken(tmp_path, kind):
    reader = two_robots(tmp_path / "a.mcap", kind)
    for robot, x in (("/r1", 1002.0), ("/r2", -998.0)):
        lifted = BagPoses(reader, f"{robot}/tracks/objects").lift(seen(1.0))
        np.testing.assert_allclose(lifted.position, [[x, 1.0]])


@pytest.mark.parametrize("kind", ["odom", "tf"])
def test_messages_of_poses_that_cannot_be_used_are_left_out(tmp_path, kind, caplog):
    reader = two_robots(tmp_path / "a.mcap", kind)
    messages = reader.messages

    def damaged(connections):
        for place, (connection, time_ns, message) in enumerate(messages(connections)):
            yield connection, time_ns, object() if place == 0 else message

    reader.messages = damaged
    lifted = BagPoses(reader, "/r2/objects").lift(seen(1.0))
    np.testing.assert_allclose(lifted.position, [[-998.0, 1.0]])
    assert "a message is left out: message of object cannot be read as" in caplog.text


def test_odometry_of_an_optical_frame_is_the_reason_why_no_pose_is_known(tmp_path):
    message = odometry_message(EPOCH_NS, Pose2(x=4.0, y=0.0, yaw=0.0))
    q = message.pose.pose.orientation
    optical = dataclasses.replace(q, x=-0.5, y=0.5, z=-0.5, w=0.5)
    tilted = dataclasses.replace(
        message.pose, pose=dataclasses.replace(message.pose.pose, orientation=optical)
    )
    poses = poses_of(tmp_path / "a.mcap", [(0.0, Pose2(x=4.0, y=0.0, yaw=0.0), {"pose": tilted})])
    with pytest.raises(FrameError, match=r"no pose .*; the z axis of frame 'base_link' is tilted"):
        poses.lift(seen(0.0))


def test_odometry_without_an_orientation_is_the_reason_why_no_pose_is_known(tmp_path):
    pose = Pose2(x=4.0, y=0.0, yaw=math.nan)
    poses = poses_of(tmp_path / "a.mcap", [(0.0, pose, {}), (1.0, pose, {})])
    with pytest.raises(
        FrameError, match=r"no pose .*; an odometry has the pose \(4, 0\) m, yaw nan"
    ):
        poses.lift(seen(0.5))
