# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The newest plans, and the newest of them in the frame of the predictions. No ROS in here."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from mtpgo_core.errors import FrameError
from mtpgo_core.frames import Pose2, moves_with_vehicle
from mtpgo_core.risk.ego_plan import EgoPlan, plan_in_frame

PoseAt = Callable[[str, str, int], Pose2]
"""Returns the pose of the second frame in the first one at a time (ns), or raises FrameError."""

_KEPT = 64
"""Plans that are kept; chosen: odometry at 100 Hz until a transform comes that is 0.5 s late."""


def no_transform(frame_id: str, other: str, stamp_ns: int) -> Pose2:
    """Raise FrameError: there is no TF."""
    raise FrameError("tf2_ros is not installed, so there is no TF")


class PlanFrames:
    """Keeps plans until there is a transform for them.

    Odometry is often newer than the newest transform of its frame. So a plan that cannot be
    transformed yet does not replace one of the same frame that can.

    Args:
        pose_at: asks TF.

    Attributes:
        in_use: what :meth:`newest` returned last.
        problem: why a newer plan than that one is not used, empty if there is none.
    """

    def __init__(self, pose_at: PoseAt = no_transform) -> None:
        self._pose_at = pose_at
        self._plans: deque[EgoPlan] = deque(maxlen=_KEPT)
        self.in_use: EgoPlan | None = None
        self.problem = ""

    def add(self, plan: EgoPlan) -> None:
        """Use a plan from now on, or as soon as it can be transformed."""
        if self._plans and self._plans[-1].frame_id != plan.frame_id:
            self.clear()
        self._plans.append(plan)

    def clear(self) -> None:
        """Forget all plans."""
        self._plans.clear()
        self.in_use, self.problem = None, ""

    def newest(self, frame_id: str) -> EgoPlan | None:
        """Return the newest plan that is known in a frame, in that frame; None if none is.

        Plans older than that one are forgotten.
        """
        self.in_use, self.problem = None, ""
        for index in range(len(self._plans) - 1, -1, -1):
            plan = self._plans[index]
            try:
                self.in_use = self._in_frame(plan, frame_id)
            except FrameError as error:
                self.problem = self.problem or (
                    f"the {plan.source} is in the frame {plan.frame_id!r} and the predictions in"
                    f" {frame_id!r}, expected the same or a transform: {error}"
                )
                continue
            for _ in range(index):
                self._plans.popleft()
            break
        return self.in_use

    def _in_frame(self, plan: EgoPlan, frame_id: str) -> EgoPlan:
        if plan.frame_id == frame_id:
            return plan
        if moves_with_vehicle(frame_id):
            # The pose at the plan's stamp would be another one than at that of the predictions.
            raise FrameError(
                f"{frame_id!r} usually moves with the vehicle, predictions are needed in a frame"
                " fixed to the ground (parameter fixed_frame of the predictor)"
            )
        pose = self._pose_at(frame_id, plan.frame_id, plan.stamp_ns)
        return plan_in_frame(plan, pose, frame_id)
