# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plans: interpolation, their ends, and what is refused."""

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError, FrameError, MessageError
from mtpgo_core.frames import Pose2
from mtpgo_core.risk.ego_plan import EgoFootprint, make_plan, plan_in_frame, plan_of_motion

START = 1_700_000_000_000_000_000


def plan(times_s=(0.0, 1.0, 3.0), x=(0.0, 10.0, 14.0), yaw=(0.0, 0.0, 0.0), **options):
    position = np.stack([np.array(x, float), np.zeros(len(x))], axis=-1)
    times = START + np.round(1e9 * np.array(times_s)).astype(np.int64)
    return make_plan(START, "map", times, position, np.array(yaw, float), **options)


def test_between_poses_it_is_interpolated_at_absolute_times():
    position, yaw = plan(yaw=(3.0, -3.0, -3.0)).at(START + 500_000_000, np.array([0.0, 1.5]))
    np.testing.assert_allclose(position[:, 0], [5.0, 12.0])
    # The shorter arc from 3.0 to -3.0 goes through pi.
    assert abs(yaw[0]) == pytest.approx(np.pi)
    assert yaw[1] == pytest.approx(-3.0)


def test_before_its_begin_it_goes_back_for_half_a_second():
    position, yaw = plan(yaw=(0.0, 0.4, 0.4)).at(START, np.array([-0.5, -0.6]))
    assert position[0, 0] == pytest.approx(-5.0)
    assert yaw[0] == 0.0
    assert np.isnan(position[1]).all()
    assert np.isnan(yaw[1])


def test_after_its_end_nothing_is_known_unless_the_ego_stands_there():
    times = np.array([3.0, np.float32(3.0), 3.2])
    position, _ = plan().at(START, times)
    np.testing.assert_allclose(position[:2, 0], 14.0)
    assert np.isnan(position[2]).all()
    position, yaw = plan(stands_after=True).at(START, times)
    np.testing.assert_allclose(position[:, 0], 14.0)
    assert np.isfinite(yaw).all()


def test_one_pose_is_a_plan_only_of_an_ego_that_stands():
    position, _ = plan((0.0,), (7.0,), (0.0,), stands_after=True).at(START, np.array([0.0, 9.0]))
    np.testing.assert_allclose(position[:, 0], 7.0)
    with pytest.raises(MessageError, match="has 1 poses, expected at least 2"):
        plan((0.0,), (7.0,), (0.0,))


def test_a_missing_orientation_is_that_of_the_motion():
    found = plan((0.0, 1.0, 2.0), (5.0, 4.0, 4.0), (np.nan, np.nan, 0.5))
    np.testing.assert_allclose(found.yaw, [np.pi, np.pi, 0.5])
    with pytest.raises(MessageError, match="no orientation at pose 0 and does not move"):
        plan((0.0, 1.0), (5.0, 5.0), (np.nan, 0.0))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"times_s": (0.0, 0.0, 0.0)}, "has no times: its 3 poses all have the time"),
        ({"times_s": (0.0, 2.0, 1.0)}, "do not ascend: pose 2 is -1 s after pose 1"),
        ({"times_s": (0.0, 1.0, 1.0)}, "do not ascend: pose 2 is 0 s after pose 1"),
        ({"x": (0.0, np.nan, 1.0)}, r"position \[nan, 0.0\] at pose 1, expected finite"),
        ({"x": (0.0, np.inf, 1.0)}, "expected finite"),
        ({"x": (0.0, 1.0, 1e300)}, r"position \[1e\+300, 0.0\] at pose 2, expected finite"),
        ({"x": (0.0, 10.0, 1e6)}, "moves 1e.06 m in 2 s from pose 1 to pose 2, expected at most"),
    ],
)
def test_a_plan_without_usable_times_or_places_is_refused(change, words):
    with pytest.raises(MessageError, match=words):
        plan(**change)


def test_a_plan_without_a_frame_is_refused():
    with pytest.raises(MessageError, match="names no frame"):
        make_plan(START, "", np.arange(2), np.zeros((2, 2)), np.zeros(2))


def test_constant_velocity_keeps_direction_and_heading():
    pose = Pose2(1.0, 2.0, 0.3, velocity=(3.0, -4.0))
    position, yaw = plan_of_motion(START, "odom", pose).at(START, np.array([-0.2, 5.0]))
    np.testing.assert_allclose(position, [[0.4, 2.8], [16.0, -18.0]])
    np.testing.assert_allclose(yaw, 0.3)
    with pytest.raises(MessageError, match="expected finite"):
        plan_of_motion(START, "odom", Pose2(0.0, 0.0, 0.0, velocity=(np.nan, 0.0)))
    with pytest.raises(MessageError, match=r"the velocity \(300.0, 0.0\) m/s, expected at most"):
        plan_of_motion(START, "odom", Pose2(0.0, 0.0, 0.0, velocity=(300.0, 0.0)))


@pytest.mark.parametrize(
    ("times_s", "x", "expected"),
    [
        ((0.0, 0.001, 0.5, 1.0), (0.0, 1.5, 6.0, 12.0), -2.4),  # the pose now, then the plan's
        ((0.0, 1e-9, 0.5), (0.0, 0.0, 6.0), -2.4),  # two poses on top of each other
        ((0.0, 0.1, 0.2), (0.0, 1.0, 2.0), -2.0),  # a short plan
        ((0.0, 0.001, 0.002), (0.0, 1.5, 1.5), -20.0),  # of a moment, at most 100 m/s
        ((0.0,), (0.0,), 0.0),
    ],
)
def test_before_its_begin_it_came_at_the_mean_velocity_of_its_first_half_second(
    times_s, x, expected
):
    short = plan(times_s, x, np.zeros(len(x)), stands_after=True)
    position, _ = short.at(START, np.array([-0.2, 0.0]))
    np.testing.assert_allclose(position[:, 0], [expected, 0.0], atol=1e-6)


def test_two_poses_in_a_moment_are_no_jump():
    assert len(plan((0.0, 0.001, 1.0), (0.0, 0.5, 9.0)).time_ns) == 3


def test_the_box_is_ahead_of_the_planned_point_and_has_a_margin():
    box = EgoFootprint(length=4.0, width=2.0, center_offset=1.5, margin=0.5)
    np.testing.assert_allclose(box.size, [5.0, 3.0])
    center = box.center(np.array([[1.0, 1.0]]), np.array([0.5 * np.pi]))
    np.testing.assert_allclose(center, [[1.0, 2.5]])
    with pytest.raises(ConfigurationError, match="length is 0"):
        EgoFootprint(length=0.0)


def test_in_another_frame_the_plan_is_shifted_and_turned():
    given = plan(yaw=(0.0, 3.0, 3.0), stands_after=True)
    found = plan_in_frame(given, Pose2(100.0, 50.0, np.pi / 2), "odom")
    assert (found.frame_id, found.stamp_ns, found.stands_after) == ("odom", START, True)
    np.testing.assert_allclose(found.position, [[100, 50], [100, 60], [100, 64]])
    np.testing.assert_allclose(found.yaw[:2], [np.pi / 2, 3.0 - 1.5 * np.pi])
    np.testing.assert_array_equal(found.time_ns, given.time_ns)
    with pytest.raises(
        FrameError, match=r"the pose of frame 'map' in 'odom' is \(0.0, 0.0, inf\)"
    ):
        plan_in_frame(given, Pose2(0.0, 0.0, np.inf), "odom")
