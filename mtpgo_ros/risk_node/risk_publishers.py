# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The publishers of the node ``risk``.

The two clouds are published immediately. The occupancy grid takes longer than all the rest: a
thread of its own makes it of the newest predictions, at its own rate.
"""

from __future__ import annotations

import math
import threading
from typing import NamedTuple

from nav_msgs.msg import OccupancyGrid
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

from msg_adapters.outputs.marker_encoding import markers_to_cdr
from msg_adapters.outputs.marker_tracker import MarkerTracker
from msg_adapters.outputs.occupancy_grid import field_to_grid
from msg_adapters.outputs.risk_cloud import risk_to_agent_cloud, risk_to_step_cloud
from msg_adapters.outputs.risk_markers import LIFETIME_S, draw_risk
from msg_adapters.types import RclpyTypes
from mtpgo_core.risk.collision_risk import CollisionRisk
from mtpgo_core.risk.ego_plan import EgoPlan
from mtpgo_core.risk.predicted_occupancy import (
    MOST_CELLS,
    OccupancyField,
    predicted_occupancy,
    reach_s,
    unknown_field,
)
from mtpgo_core.schema import Float64Array, Prediction
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.parameters.risk_parameters import RiskParameters
from mtpgo_ros.risk_node.risk_status import RiskStatus
from mtpgo_ros.runtime.work_queue import WorkQueue

_QOS = QoSProfile(depth=5)
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As costmap layers for static maps expect it."""

_CLOCK_SLACK = 0.1
"""Share of a period by which a grid may come early, so that jitter of stamps skips none."""


class _Wanted(NamedTuple):
    """A grid to be made.

    Attributes:
        prediction: without the ego.
        center: [2] middle of the grid (m).
        known: the predictions are not stale.
        number: of the withdrawals before it.
    """

    prediction: Prediction
    center: Float64Array
    known: bool
    number: int


class RiskPublishers:
    """Publishes ``~/risk``, ``~/risk_steps``, ``~/markers`` and ``~/occupancy``.

    Args:
        node: the node that owns the publishers.
        parameters: the initial parameters.
        status: where a problem of the grid is noted.
        events: where failures are logged.
    """

    def __init__(
        self,
        node: LifecycleNode,
        parameters: RiskParameters,
        status: RiskStatus,
        events: EventLog,
    ) -> None:
        self._node, self._parameters = node, parameters
        self._status, self._events = status, events
        self._types, self._tracker = RclpyTypes(), MarkerTracker()
        make = node.create_lifecycle_publisher
        self._agents: LifecyclePublisher = make(PointCloud2, "~/risk", _QOS)
        self._steps: LifecyclePublisher = make(PointCloud2, "~/risk_steps", _QOS)
        self._markers: LifecyclePublisher = make(MarkerArray, "~/markers", _QOS)
        self._grid: LifecyclePublisher = make(OccupancyGrid, "~/occupancy", _LATCHED)
        self._grid_ns: int | None = None
        self._last: _Wanted | None = None  # of the grids that are made
        self._place: tuple[str, Float64Array] | None = None  # frame and middle of the last grid
        self._withdrawals = 0
        self._grid_lock = threading.Lock()  # held while a grid is published or withdrawn
        self._queue = WorkQueue(self._make_grid, 1, "occupancy")

    def configure(self, parameters: RiskParameters) -> None:
        """Use other parameters from the next predictions on."""
        self._parameters = parameters

    def publish(self, risk: CollisionRisk, plan: EgoPlan | None) -> None:
        """Publish both clouds, and the markers while they have subscribers."""
        self._agents.publish(risk_to_agent_cloud(risk, self._types))
        self._steps.publish(risk_to_step_cloud(risk, self._types))
        if self._markers.get_subscription_count():
            drawn = draw_risk(risk, self._tracker, plan, self._parameters.footprint)
            self._markers.publish(
                markers_to_cdr(
                    drawn,
                    stamp_ns=risk.stamp_ns,
                    frame_id=risk.frame_id,
                    lifetime_s=LIFETIME_S,
                )
            )

    def publish_grid(
        self, prediction: Prediction, center: Float64Array | None, *, known: bool
    ) -> None:
        """Publish the occupancy if it is due and has a subscriber; an unknown one at once.

        The last grid is latched. So an unknown one also replaces a known one for subscribers that
        come later, and one without a place is where the last one was.

        Args:
            prediction: without the ego.
            center: [2] middle of the grid (m), None if it is not known.
            known: the predictions are not stale.
        """
        if center is not None:
            self._place = (prediction.frame_id, center)
        elif self._place is not None and self._place[0] == prediction.frame_id:
            center = self._place[1]
        period_ns = (1.0 - _CLOCK_SLACK) * 1e9 / self._parameters.occupancy_rate
        last_ns, now_ns = self._grid_ns, prediction.stamp_ns
        due = not known or last_ns is None or not 0 <= now_ns - last_ns < period_ns
        heard = self._grid.get_subscription_count() > 0
        if not heard:
            self._status.occupancy_problem = self._status.occupancy_warning = ""
        latched = self._last is not None and self._last.known
        if center is None or not due or not (heard or (latched and not known)):
            return
        self._grid_ns = now_ns
        self._last = _Wanted(prediction, center, known, self._withdrawals)
        self._queue.submit(self._last)

    def withdraw_grid(self) -> None:
        """Replace a known grid by an unknown one, before no more are published."""
        last, self._last = self._last, None
        if last is None or not last.known or not self._grid.is_activated:
            return
        field = unknown_field(self._parameters.grid, last.center)
        message = self._grid_of(field, last.prediction)
        with self._grid_lock:
            self._withdrawals += 1  # The grids that are being made are dropped.
            self._grid.publish(message)

    def _grid_of(self, field: OccupancyField, prediction: Prediction) -> OccupancyGrid:
        return field_to_grid(
            field, self._types, stamp_ns=prediction.stamp_ns, frame_id=prediction.frame_id
        )

    def _make_grid(self, wanted: _Wanted) -> None:
        prediction, center, known, number = wanted
        parameters = self._parameters
        try:
            if known:
                field = predicted_occupancy(
                    prediction,
                    parameters.grid,
                    center,
                    parameters.occupancy_from,
                    parameters.occupancy_until,
                )
            else:
                field = unknown_field(parameters.grid, center)
            self._note(field, prediction.time_s)
            message = self._grid_of(field, prediction)
            with self._grid_lock:
                if not self._queue.stopped and number == self._withdrawals:
                    self._grid.publish(message)
        except Exception as error:
            self._events.failure("the occupancy grid could not be published", error)

    def _note(self, field: OccupancyField, time_s: Float64Array) -> None:
        """Note in the status what a grid of predictions at [H] times lacks."""
        status, parameters = self._status, self._parameters
        status.occupancy_problem = status.occupancy_warning = ""
        last_s = time_s[-1] if len(time_s) else math.inf
        if field.begins_beyond:
            status.occupancy_problem = (
                f"the occupancy is unknown: occupancy_from is {parameters.occupancy_from:g} s, and"
                f" the predictions end at {last_s:.1f} s"
            )
        elif field.unknown_agents:
            status.occupancy_problem = (
                f"the occupancy is unknown: the prediction of {field.unknown_agents} road users is"
                " not finite, or lacks modes or covariances"
            )
        elif field.too_many_cells:
            status.occupancy_problem = (
                "the occupancy is unknown: road users and their errors cover"
                f" {field.too_many_cells / 1e6:.0f} million cells, expected at most"
                f" {MOST_CELLS / 1e6:.0f}: lower occupancy_size or occupancy_until, or raise"
                " occupancy_resolution"
            )
        elif len(time_s) and parameters.occupancy_until > reach_s(time_s):
            status.occupancy_warning = (
                f"the occupancy is that until {last_s:.1f} s, where the predictions end;"
                f" occupancy_until is {parameters.occupancy_until:g} s"
            )

    def close(self) -> None:
        """Destroy the publishers."""
        self._queue.stop()
        for publisher in (self._agents, self._steps, self._markers, self._grid):
            self._node.destroy_lifecycle_publisher(publisher)
