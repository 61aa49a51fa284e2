# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plans in another frame wait for their transform, and are never taken as they are."""

import math

import numpy as np
import pytest
from risk_scene import START

from mtpgo_core.errors import FrameError
from mtpgo_core.frames import Pose2
from mtpgo_core.risk.ego_plan import plan_of_motion
from mtpgo_ros.risk_node.plan_frames import PlanFrames, no_transform

STEP_NS = 10_000_000


class Transforms:
    """TF that knows ``odom`` in ``map`` until a time; odom is turned by 90 degrees."""

    def __init__(self, until_ns=START + 10**12):
        self.until_ns, self.asked = until_ns, []

    def __call__(self, frame_id, other, stamp_ns):
        self.asked.append((frame_id, other, stamp_ns))
        if (frame_id, other) != ("map", "odom") or stamp_ns > self.until_ns:
            raise FrameError(f"TF has no transform from {other!r} to {frame_id!r}")
        return Pose2(100.0, 0.0, math.pi / 2)


def odometry(number=0, frame_id="odom"):
    """The odometry of a car at x = ``number`` that drives along x."""
    stamp_ns = START + number * STEP_NS
    return plan_of_motion(stamp_ns, frame_id, Pose2(float(number), 0.0, 0.0, velocity=(10.0, 0.0)))


def test_a_plan_in_the_frame_of_the_predictions_needs_no_transform():
    plans = PlanFrames()
    assert plans.newest("map") is None
    assert plans.problem == ""
    plans.add(odometry(1, "map"))
    assert plans.newest("map").position[0, 0] == 1.0
    assert plans.newest("map") is plans.in_use


def test_a_plan_in_another_frame_is_transformed_at_its_own_time():
    transforms = Transforms()
    plans = PlanFrames(transforms)
    plans.add(odometry(3))
    found = plans.newest("map")
    assert transforms.asked == [("map", "odom", START + 3 * STEP_NS)]
    assert (found.frame_id, found.stamp_ns) == ("map", START + 3 * STEP_NS)
    position, yaw = found.at(found.stamp_ns, np.array([0.0, 1.0]))
    np.testing.assert_allclose(position, [[100.0, 3.0], [100.0, 13.0]], atol=1e-9)
    np.testing.assert_allclose(yaw, math.pi / 2)


def test_the_newest_plan_with_a_transform_is_used():
    """Odometry is newer than the newest transform; the newest that both know is used."""
    transforms = Transforms(START + 5 * STEP_NS)
    plans = PlanFrames(transforms)
    for number in range(9):
        plans.add(odometry(number))
    assert plans.newest("map").stamp_ns == START + 5 * STEP_NS
    assert "TF has no transform from 'odom' to 'map'" in plans.problem
    transforms.until_ns = START + 7 * STEP_NS
    assert plans.newest("map").stamp_ns == START + 7 * STEP_NS
    transforms.until_ns = START + 8 * STEP_NS
    assert plans.newest("map").stamp_ns == START + 8 * STEP_NS
    assert plans.problem == ""
    # Plans before the one in use are forgotten.
    transforms.asked.clear()
    transforms.until_ns = 0
    assert plans.newest("map") is None
    assert len(transforms.asked) == 1


@pytest.mark.parametrize("pose_at", [Transforms(0), no_transform])
def test_without_a_transform_no_plan_is_used_and_one_sentence_says_why(pose_at):
    plans = PlanFrames(pose_at)
    plans.add(odometry(1))
    assert plans.newest("map") is None
    assert plans.in_use is None
    assert plans.problem.startswith(
        "the odometry is in the frame 'odom' and the predictions in 'map', expected the same or a"
        " transform: "
    )


def test_a_plan_in_a_new_frame_replaces_those_in_the_old_one():
    plans = PlanFrames(Transforms(0))
    plans.add(odometry(1, "map"))
    assert plans.newest("map") is not None
    plans.add(odometry(2, "odom"))
    assert plans.newest("map") is None
    plans.add(odometry(3, "map"))
    assert plans.newest("map").stamp_ns == START + 3 * STEP_NS
    plans.clear()
    assert plans.newest("map") is None
    assert plans.problem == ""


def test_a_pose_that_is_not_finite_is_no_transform():
    plans = PlanFrames(lambda *_: Pose2(math.nan, 0.0, 0.0))
    plans.add(odometry())
    assert plans.newest("map") is None
    assert "the pose of frame 'odom' in 'map' is (nan, 0.0, 0.0), expected finite" in plans.problem


def test_so_many_plans_are_kept_and_no_more():
    transforms = Transforms(0)
    plans = PlanFrames(transforms)
    for number in range(1000):
        plans.add(odometry(number))
    plans.newest("map")
    assert len(transforms.asked) == 64


@pytest.mark.parametrize("frame_id", ["base_link", "robot1/base_link"])
def test_predictions_in_a_frame_that_moves_need_a_plan_in_the_same(frame_id):
    transforms = Transforms()
    plans = PlanFrames(transforms)
    plans.add(odometry())
    assert plans.newest(frame_id) is None
    assert f"{frame_id!r} usually moves with the vehicle" in plans.problem
    assert not transforms.asked
    plans.add(odometry(1, frame_id))
    assert plans.newest(frame_id) is not None
