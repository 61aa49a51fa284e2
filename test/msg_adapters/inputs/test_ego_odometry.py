# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ego among the objects, by hand-worked poses."""

import dataclasses

import numpy as np
import pytest

from msg_adapters.conversions import make_header, make_pose, make_vector
from msg_adapters.inputs.ego_odometry import EgoOdometry, EgoOptions
from mtpgo_core.errors import ConfigurationError, MessageError
from mtpgo_core.frames import Pose2, to_fixed_frame
from mtpgo_core.identity import keys_from_integers, keys_from_texts
from mtpgo_core.schema import AgentClass, tracked_states

T0 = 1_700_000_000_000_000_000
EGO = keys_from_texts(["ego"])[0]


def at(time_s):
    return T0 + round(time_s * 1e9)


@pytest.fixture
def odometry(offline):
    """Makes odometry of a vehicle at (x, y) m with yaw (rad) and a twist in its own frame."""

    def make(
        time_s, x, y=0.0, yaw=0.0, twist=(10.0, 0.0, 0.0), frame="map", child="base_link", var=0.0
    ):
        covariance = np.zeros(36)
        covariance[[0, 7]] = var, 4.0 * var
        covariance[[1, 6]] = 0.5 * var
        motion = offline.make(
            "geometry_msgs/msg/Twist",
            linear=make_vector(offline, *twist[:2]),
            angular=make_vector(offline, 0.0, 0.0, twist[2]),
        )
        return offline.make(
            "nav_msgs/msg/Odometry",
            header=make_header(offline, at(time_s), frame),
            child_frame_id=child,
            pose=offline.make(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=make_pose(offline, np.array([x, y]), 0.0, yaw),
                covariance=covariance,
            ),
            twist=offline.make(
                "geometry_msgs/msg/TwistWithCovariance", twist=motion, covariance=covariance
            ),
        )

    return make


@pytest.fixture
def make(odometry):
    """An ego that drives along x at 10 m/s, odometry every 0.1 s from 0 to ``until_s``."""

    def make(until_s=1.0, **options):
        ego = EgoOdometry(EgoOptions(**options))
        for k in range(round(until_s * 10) + 1):
            ego.add(odometry(k / 10, float(k)))
        return ego

    return make


def objects(time_s, positions=((50.0, 0.0), (60.0, 3.0)), frame="map", first=1):
    position = np.array(positions, dtype=np.float64).reshape(-1, 2)
    keys = keys_from_integers(range(first, first + len(position)))
    return tracked_states(at(time_s), frame, keys, position)


def test_the_ego_is_one_more_road_user_at_the_time_of_the_message(make):
    ego = make(length_m=5.0, width_m=2.0, class_name="truck")
    joined = ego.join(objects(0.25), EGO)
    assert (joined.known, joined.added, joined.doubles, joined.problem) == (True, True, 0, "")
    states = joined.states
    assert (len(states), states.stamp_ns, states.frame_id) == (3, at(0.25), "map")
    np.testing.assert_array_equal(states.key[-1], EGO)
    assert states.agent_class[-1] == AgentClass.TRUCK
    assert states.position[-1] == pytest.approx([2.5, 0.0])
    assert states.velocity[-1] == pytest.approx([10.0, 0.0])
    assert (states.yaw[-1], states.size[-1].tolist()) == (0.0, [5.0, 2.0])
    assert np.isnan(states.acceleration[-1]).all()
    assert np.isnan(states.covariance[-1]).all()


def test_the_twist_is_turned_into_the_frame_and_to_the_centre_of_the_box(odometry):
    ego = EgoOdometry(EgoOptions(offset_m=1.5))
    # Turned to +y at 8 m/s, turning left at 0.2 rad/s: the centre is 1.5 m further along y.
    ego.add(odometry(0.0, 3.0, 4.0, np.pi / 2, (8.0, 0.0, 0.2), var=0.04))
    states = ego.join(objects(0.0), EGO).states
    assert states.position[-1] == pytest.approx([3.0, 5.5])
    assert states.velocity[-1] == pytest.approx([-0.3, 8.0])
    assert states.yaw[-1] == pytest.approx(np.pi / 2)
    assert states.covariance[-1, :2, :2] == pytest.approx(np.array([[0.04, 0.02], [0.02, 0.16]]))
    turned = np.array([[0.16, -0.02], [-0.02, 0.04]])
    assert states.covariance[-1, 2:, 2:] == pytest.approx(turned)


@pytest.mark.parametrize("twist", [(0.0, 0.0, 0.0), (np.nan, np.nan, np.nan)])
def test_a_twist_that_was_never_filled_leaves_the_velocity_to_be_estimated(odometry, twist):
    ego = EgoOdometry(EgoOptions())
    ego.add(odometry(0.0, 1.0, twist=twist))
    states = ego.join(objects(0.05), EGO).states
    assert np.isnan(states.velocity[-1]).all()
    assert states.position[-1] == pytest.approx([1.0, 0.0])
    ego.add(odometry(0.1, 1.0, twist=(0.5, 0.0, 0.0)))
    ego.add(odometry(0.2, 1.0, twist=(0.0, 0.0, 0.0)))  # it stands now
    assert ego.join(objects(0.2), EGO).states.velocity[-1] == pytest.approx([0.0, 0.0])


def test_late_odometry_is_extrapolated_and_stale_odometry_leaves_the_ego_out(make, odometry):
    ego = make(until_s=1.0)
    assert ego.join(objects(1.15), EGO).states.position[-1] == pytest.approx([11.5, 0.0])
    joined = ego.join(objects(1.5), EGO)
    assert not joined.known
    assert len(joined.states) == 2
    assert joined.problem == (
        "its last odometry is 0.5 s older than the objects, expected at most 0.2 s"
    )
    # Odometry that comes in another order is sorted in.
    ego.add(odometry(1.5, 15.0))
    ego.add(odometry(1.3, 13.0))
    assert ego.join(objects(1.4), EGO).known
    assert ego.join(objects(1.52), EGO).states.position[-1] == pytest.approx([15.2, 0.0])


def test_a_gap_of_the_odometry_is_not_interpolated(make, odometry):
    ego = make(until_s=0.0)
    ego.add(odometry(0.9, 9.0))
    joined = ego.join(objects(0.5), EGO)
    assert not joined.known
    assert "are 0.900 s apart" in joined.problem
    assert ego.join(objects(0.9), EGO).known


def test_before_any_odometry_the_objects_stay_as_they_are():
    ego, states = EgoOdometry(EgoOptions()), objects(0.0)
    joined = ego.join(states, EGO)
    assert joined.states is states
    assert (joined.known, joined.problem) == (False, "no odometry of it has come")


def test_the_trackers_own_ego_is_replaced_by_the_odometry_while_there_is_any(make):
    ego = make(until_s=0.0)
    states = objects(0.1, ((1.3, 0.4), (50.0, 0.0)), first=7)
    joined = ego.join(states, states.key[0])
    assert (joined.doubles, len(joined.states)) == (1, 2)
    assert joined.states.position[-1] == pytest.approx([1.0, 0.0])
    later = objects(2.0, ((20.0, 0.4), (70.0, 0.0)), first=7)
    joined = ego.join(later, later.key[0])
    assert (joined.known, joined.states is later) == (False, True)


def test_an_object_in_the_box_of_the_ego_is_the_ego(make):
    ego = make(length_m=4.0, width_m=2.0)
    # At 0.5 s the ego is at (5, 0): inside, at the corner, just outside on each side, far away.
    places = ((6.0, 0.5), (3.1, -0.9), (7.2, 0.0), (5.0, 1.1), (50.0, 0.0))
    joined = ego.join(objects(0.5, places), EGO)
    assert joined.doubles == 2
    assert joined.states.key[:, 0].tolist()[:3] == [3, 4, 5]


def test_the_box_turns_with_the_ego(odometry):
    ego = EgoOdometry(EgoOptions(length_m=4.0, width_m=2.0))
    ego.add(odometry(0.0, 0.0, yaw=np.pi / 2))
    joined = ego.join(objects(0.0, ((0.0, 1.8), (1.8, 0.0))), EGO)
    assert joined.states.key[:1, 0].tolist() == [2]


def test_a_double_that_lags_behind_stays_away_until_it_is_a_box_away(make):
    ego = make(length_m=4.0, width_m=2.0)
    kept = []
    for time_s, behind in ((0.1, 1.0), (0.2, 2.5), (0.3, 3.9), (0.4, 4.5), (0.5, 3.0)):
        joined = ego.join(objects(time_s, ((10.0 * time_s - behind, 0.0),)), EGO)
        kept.append(1 - joined.doubles)
    assert kept == [0, 0, 0, 1, 1]


def test_a_double_stays_one_while_messages_without_it_come(make):
    """Of another publisher of objects, or where its tracker misses it for a moment."""
    ego = make(length_m=4.0, width_m=2.0, until_s=2.0)
    ego.join(objects(0.1, ((0.5, 0.0),)), EGO)
    ego.join(objects(0.2, ((80.0, 0.0),), first=9), EGO)
    assert ego.join(objects(0.3, ((0.5, 0.0),)), EGO).doubles == 1
    ego.join(objects(0.5, ((80.0, 0.0),), first=9), EGO)
    ego.join(objects(0.9, ((80.0, 0.0),), first=9), EGO)
    assert ego.join(objects(1.0, ((7.5, 0.0),)), EGO).doubles == 0  # it was away for too long


def test_a_double_stays_away_during_a_short_gap_of_the_odometry(make):
    ego = make(until_s=0.0)
    ego.join(objects(0.0, ((0.5, 0.0),)), EGO)
    for time_s, doubles in ((0.4, 1), (0.6, 0)):
        joined = ego.join(objects(time_s, ((10.0 * time_s, 0.0),)), EGO)
        assert (joined.known, joined.doubles) == (False, doubles)


def test_without_the_overlap_rule_only_the_identity_counts(make):
    ego = make(overlap=False)
    assert ego.join(objects(0.5, ((5.0, 0.0),)), EGO).doubles == 0


def test_two_messages_of_one_stamp_get_the_ego_once(make):
    ego = make()
    first, second = (ego.join(objects(0.5), EGO) for _ in range(2))
    assert (first.added, second.known, second.added) == (True, True, False)
    assert len(second.states) == 2
    assert not ego.join(objects(0.4), EGO).added  # late objects
    assert ego.join(objects(0.6), EGO).added


def test_on_an_empty_road_the_ego_is_alone_in_the_objects_frame(make):
    ego = make()
    joined = ego.join(objects(0.1, (), frame=""), EGO)
    assert (len(joined.states), joined.states.frame_id) == (1, "map")
    ego.join(objects(0.2, frame="odom"), EGO)
    assert len(ego.join(objects(0.3, (), frame=""), EGO).states) == 0  # objects came in odom


def test_another_frame_is_a_problem_unless_there_is_a_transform(make):
    ego = make()
    joined = ego.join(objects(0.1, frame="odom"), EGO)
    assert (joined.known, len(joined.states)) == (False, 2)
    assert "odometry is in the frame 'map', the objects are in 'odom'" in joined.problem
    assert not ego.join(objects(0.1, frame=""), EGO).known  # objects that name no frame
    pose = Pose2(x=0.0, y=100.0, yaw=np.pi / 2)
    joined = ego.join(
        objects(0.2, frame="odom"), EGO, lambda one: to_fixed_frame(one, pose, "odom")
    )
    assert joined.states.position[-1] == pytest.approx([0.0, 102.0])
    assert joined.states.velocity[-1] == pytest.approx([0.0, 10.0])


def test_a_clock_that_is_set_back_starts_again(make, odometry):
    ego = make()
    ego.join(objects(1.0), EGO)
    ego.add(odometry(0.2, 500.0))  # 0.8 s earlier, elsewhere
    assert ego.join(objects(0.2), EGO).states.position[-1] == pytest.approx([500.0, 0.0])
    ego.clear()
    assert not ego.join(objects(0.2), EGO).known


def test_another_vehicle_or_frame_is_not_mixed_with_the_last(make, odometry):
    ego = make(until_s=0.1)
    ego.add(odometry(0.2, 900.0, child="other"))
    assert ego.join(objects(0.15), EGO).states.position[-1] == pytest.approx([899.5, 0.0])


@pytest.mark.parametrize(
    ("values", "words"),
    [({"x": np.nan}, "has the pose"), ({"x": 1e9}, "up to 1e.08 m"), ({}, "no stamp")],
)
def test_odometry_without_stamp_or_pose_is_refused(odometry, values, words):
    message = odometry(0.0, values.get("x", 0.0))
    if not values:
        message = dataclasses.replace(
            message,
            header=dataclasses.replace(
                message.header, stamp=type(message.header.stamp)(sec=0, nanosec=0)
            ),
        )
    with pytest.raises(MessageError, match=words):
        EgoOdometry(EgoOptions()).add(message)


def test_an_unset_orientation_is_refused(odometry):
    message = odometry(0.0, 1.0, yaw=np.nan)  # a quaternion of zeros
    with pytest.raises(MessageError, match="an orientation"):
        EgoOdometry(EgoOptions()).add(message)


def test_a_frame_that_does_not_stand_upright_is_refused(odometry):
    """Of an optical frame neither the yaw nor the twist is what the ego needs."""
    message = odometry(0.0, 1.0)
    q = message.pose.pose.orientation
    optical = dataclasses.replace(q, x=-0.5, y=0.5, z=-0.5, w=0.5)
    pose = dataclasses.replace(message.pose.pose, orientation=optical)
    covered = dataclasses.replace(message.pose, pose=pose)
    ego = EgoOdometry(EgoOptions())
    with pytest.raises(MessageError, match="the ego: the z axis of frame 'base_link' is tilted"):
        ego.add(dataclasses.replace(message, pose=covered))
    assert not ego.join(objects(0.0), EGO).known


@pytest.mark.parametrize("values", [{"length_m": 0.0}, {"class_name": "tank"}])
def test_options_are_checked(values):
    with pytest.raises(ConfigurationError, match="ego "):
        EgoOptions(**values)


def test_odometry_of_another_definition_is_refused():
    with pytest.raises(MessageError, match="message of object cannot be read as nav_msgs/msg/Od"):
        EgoOdometry(EgoOptions()).add(object())
