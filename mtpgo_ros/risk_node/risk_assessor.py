# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the newest plan means for predictions. No ROS in here.

Whatever is wrong with plan or predictions makes the risk unknown, with one sentence in the status.
"""

from __future__ import annotations

import math
import time

import numpy as np

from msg_adapters.inputs.ego_odometry import EGO_NAME
from mtpgo_core.frames import moves_with_vehicle
from mtpgo_core.identity import first_key, key_to_int
from mtpgo_core.prediction.output_assembly import without_agent
from mtpgo_core.risk.collision_risk import CollisionRisk, Unknown, assess, known_poses
from mtpgo_core.risk.ego_plan import EgoPlan
from mtpgo_core.risk.footprint_overlap import is_covariance
from mtpgo_core.schema import Float64Array, Prediction
from mtpgo_ros.parameters.risk_parameters import RiskParameters
from mtpgo_ros.risk_node.plan_frames import PlanFrames, PoseAt, no_transform
from mtpgo_ros.risk_node.risk_status import RiskStatus


class RiskAssessor:
    """Keeps the newest plans and computes risks; to be used on one thread.

    Args:
        parameters: the initial parameters.
        status: where problems and results are kept up to date.
        plan_topic: resolved name of the plan's topic, for sentences.
        pose_at: asks TF where a plan is in another frame than the predictions.
    """

    def __init__(
        self,
        parameters: RiskParameters,
        status: RiskStatus,
        plan_topic: str,
        pose_at: PoseAt = no_transform,
    ) -> None:
        self._parameters, self._status, self._plan_topic = parameters, status, plan_topic
        self._ego_topic = ""
        self._plans = PlanFrames(pose_at)
        self._missing = f"no plan has come on {plan_topic} yet"
        status.plan_problem = self._missing

    @property
    def plan(self) -> EgoPlan | None:
        """The plan in the frame of the last predictions, None if there is none."""
        return self._plans.in_use

    def configure(self, parameters: RiskParameters) -> None:
        """Use other parameters from the next predictions on."""
        self._parameters = parameters

    def set_ego(self, text: str) -> None:
        """Take the identity of the ego from its topic; empty for none."""
        self._ego_topic = text

    def add_plan(self, plan: EgoPlan) -> None:
        """Use a plan from now on."""
        self._plans.add(plan)
        if self._missing:
            self._missing = self._status.plan_problem = ""

    def refuse_plan(self, error: Exception) -> None:
        """Note a plan that is not usable: the one before it is not valid any more."""
        self._plans.clear()
        self._missing = f"the plan on {self._plan_topic} is not usable: {error}"
        self._status.plan_problem = self._missing

    def forget_plans(self) -> None:
        """Forget all plans: the clock was set, and they are those of another time."""
        self._plans.clear()
        self._missing = f"the clock was set, and no plan has come on {self._plan_topic} since"
        self._status.plan_problem = self._missing

    def others(self, prediction: Prediction) -> Prediction:
        """Return the prediction without the ego."""
        # Without a given identity, the ego is the one that the predictor adds by odometry.
        key = first_key(self._parameters.ego_id, self._ego_topic, EGO_NAME)
        return without_agent(prediction, key)

    def assess(self, prediction: Prediction, now_ns: int) -> CollisionRisk:
        """Return the risk of predictions, without the ego, and note the result.

        Args:
            prediction: of :meth:`others`.
            now_ns: the node's time (ns).
        """
        began_s = time.perf_counter()
        status = self._status
        status.prediction_problem = self._stale(prediction.stamp_ns, now_ns)
        status.plan_problem, status.plan_warning = self._unusable(prediction), ""
        footprint = self._parameters.footprint
        if status.prediction_problem:
            risk = assess(prediction, None, footprint, reason=Unknown.STALE)
        elif status.plan_problem:
            risk = assess(prediction, None, footprint, reason=Unknown.NO_PLAN)
        else:
            risk = assess(prediction, self.plan, footprint)
        self._note(risk)
        status.prediction_warning = _without_covariance(prediction) or _moving(prediction)
        status.processing_ms = 1e3 * (time.perf_counter() - began_s)
        return risk

    def expire(self, prediction: Prediction) -> CollisionRisk:
        """Return the unknown risk of predictions that no newer ones have followed in time."""
        risk = assess(prediction, None, self._parameters.footprint, reason=Unknown.STALE)
        self._note(risk)
        return risk

    def place(self, prediction: Prediction) -> Float64Array | None:
        """Return [2] where the ego is at the predictions' stamp (m), else the road users' middle.

        None if neither is known.
        """
        if self.plan is not None and self.plan.frame_id == prediction.frame_id:
            position, _ = self.plan.at(prediction.stamp_ns, np.zeros(1))
            if np.isfinite(position).all():
                return position[0]
        first = prediction.mean[:, :, :1, :2][known_poses(prediction)[:, :, :1]]
        return first.mean(axis=0) if len(first) else None

    def _stale(self, stamp_ns: int, now_ns: int) -> str:
        """Return why predictions are too old, empty if they are not."""
        if now_ns == 0:  # Simulated time that has not begun.
            return (
                "the age of the predictions is not known: use_sim_time is set, but no time has"
                " come on /clock; the risk is unknown"
            )
        limit_s, age_s = self._parameters.prediction_timeout, (now_ns - stamp_ns) * 1e-9
        if abs(age_s) <= limit_s:
            return ""
        side = "old" if age_s > 0.0 else "ahead of it"
        return (
            f"predictions are stale: by the node's clock they are {abs(age_s):.1f} s {side},"
            f" expected within {limit_s:g} s (a played bag needs use_sim_time); the risk is"
            " unknown"
        )

    def _unusable(self, prediction: Prediction) -> str:
        """Return why the plan cannot be used for predictions, empty if it can."""
        plan = self._plans.newest(prediction.frame_id)
        if plan is None:
            self._status.plan_age_s = float("nan")
            return self._missing or self._plans.problem
        age_s = (prediction.stamp_ns - plan.stamp_ns) * 1e-9
        self._status.plan_age_s = age_s
        if abs(age_s) <= self._parameters.plan_timeout:
            return ""
        if self._plans.problem:  # A newer plan cannot be transformed.
            return self._plans.problem
        side = "before" if age_s > 0.0 else "after"
        return (
            f"the {plan.source} is stale: it was made {abs(age_s):.1f} s {side} the"
            f" observation, expected within {self._parameters.plan_timeout:g} s"
        )

    def _note(self, risk: CollisionRisk) -> None:
        status = self._status
        status.agents = len(risk)
        known = np.isfinite(risk.peak)
        status.unknown_agents = int((~known).sum())
        status.partly_known_agents = int((risk.agent_unknown == Unknown.PARTLY).sum())
        beyond = (risk.unknown == Unknown.BEYOND_PLAN).any(axis=0)
        if beyond.any() and not status.plan_problem:
            covered_s = risk.time_s[~beyond]
            span = f" (from {covered_s[0]:.1f} to {covered_s[-1]:.1f} s)" if len(covered_s) else ""
            status.plan_warning = (
                f"the plan covers {len(covered_s)} of {len(beyond)} predicted steps{span}: the"
                " risk at the others is unknown"
            )
        if known.any():
            worst = int(np.nanargmax(risk.peak))
            status.peak = float(risk.peak[worst])
            status.peak_time_s = float(risk.peak_time_s[worst])
            status.peak_agent = str(key_to_int(risk.key[worst]))
        else:
            status.peak = status.peak_time_s = math.nan
            status.peak_agent = ""


def _moving(prediction: Prediction) -> str:
    """Return a warning of predictions in a moving frame, empty for none."""
    if not moves_with_vehicle(prediction.frame_id):
        return ""
    return (
        f"predictions are in the frame {prediction.frame_id!r}, which usually moves with the"
        " vehicle: the risk is right only for a plan of the same instant"
    )


def _without_covariance(prediction: Prediction) -> str:
    """Return how many road users have finite paths without a usable covariance, empty for none."""
    finite = np.isfinite(prediction.mean[..., :2]).all(axis=-1) & np.isfinite(prediction.yaw)
    lacking = np.asarray((finite & ~is_covariance(prediction.covariance)).any(axis=(1, 2)))
    if not lacking.any():
        return ""
    return (
        f"the predictions of {int(lacking.sum())} of {len(lacking)} road users have no usable"
        " covariance: their risk is unknown (parameter missing_covariance)"
    )
