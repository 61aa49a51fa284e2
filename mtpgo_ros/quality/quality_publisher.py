# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Publishes the scores of the predictions once a second."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile
from rclpy.time import Time
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from msg_adapters.outputs.marker_encoding import TEXT, Drawn, markers_to_message
from msg_adapters.outputs.quality_table import quality_to_array
from msg_adapters.types import RclpyTypes
from mtpgo_core.quality.quality_report import Level, QualityReport, QualityVerdict, judge
from mtpgo_ros.diagnostics.diagnostic_status import NodeStatus
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.quality.live_quality import LiveQuality
from mtpgo_ros.quality.quality_statuses import group_statuses, overlay_text, summary_values

_PERIOD_S = 1.0
"""Time between two publications (s), on the machine's clock."""

_QOS = QoSProfile(depth=5)

QUALITY_TOPICS = ("~/quality", "~/quality_table", "~/quality_markers")
"""Statuses, rows of numbers, and the text in the scene."""

_TEXT_HEIGHT_M, _TEXT_ABOVE_M = 2.0, 10.0
"""Height of the letters of the text in the scene, and its height above ground (m); chosen."""

_COLOURS = {
    Level.OK: (0.6, 1.0, 0.6, 1.0),
    Level.WARN: (1.0, 0.9, 0.3, 1.0),
    Level.ERROR: (1.0, 0.3, 0.3, 1.0),
}


class QualityPublisher:
    """Publishes ``~/quality``, ``~/quality_table`` and ``~/quality_markers`` until it is closed.

    Args:
        node: the node.
        quality: the scores.
        parameters: the initial parameters.
        status: where the verdict for ``/diagnostics`` is kept up to date.
    """

    def __init__(
        self,
        node: LifecycleNode,
        quality: LiveQuality,
        parameters: PredictorParameters,
        status: NodeStatus,
    ) -> None:
        self._node, self._quality = node, quality
        self._parameters, self._status = parameters, status
        self._types = RclpyTypes()
        self._name = node.get_fully_qualified_name().lstrip("/")
        statuses, table, markers = QUALITY_TOPICS
        self._statuses = node.create_publisher(DiagnosticArray, statuses, _QOS)
        self._table = node.create_publisher(Float64MultiArray, table, _QOS)
        self._markers = node.create_publisher(MarkerArray, markers, _QOS)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(_PERIOD_S, self.publish, clock=steady)

    def configure(self, parameters: PredictorParameters) -> None:
        """Use other parameters from the next publication on."""
        self._parameters = parameters

    def publish(self) -> None:
        """Publish the scores now."""
        report = self._quality.report()
        limits, window_s = self._parameters.quality_limits, self._parameters.quality_window
        verdict = judge(report, limits, window_s)
        self._status.quality = verdict
        self._status.quality_values = summary_values(report, limits, window_s)
        message = DiagnosticArray(status=group_statuses(self._name, report, limits))
        message.header.stamp = Time(nanoseconds=report.now_ns).to_msg()
        message.header.frame_id = self._quality.frame_id
        self._statuses.publish(message)
        self._table.publish(quality_to_array(report.rows(limits), self._types))
        if self._quality.frame_id and self._markers.get_subscription_count():
            self._publish_text(report, verdict)

    def _publish_text(self, report: QualityReport, verdict: QualityVerdict) -> None:
        """Write the scores above the middle of the road users."""
        limits, window_s = self._parameters.quality_limits, self._parameters.quality_window
        text = Drawn(
            ns="quality",
            number=0,
            kind=TEXT,
            position=(*self._quality.place, _TEXT_ABOVE_M),
            scale=(0.0, 0.0, _TEXT_HEIGHT_M),
            colour=_COLOURS[verdict.level],
            text=overlay_text(verdict, report, limits, window_s),
        )
        self._markers.publish(
            markers_to_message(
                [text],
                self._types,
                stamp_ns=report.now_ns,
                frame_id=self._quality.frame_id,
                lifetime_s=3.0 * _PERIOD_S,
            )
        )

    def close(self) -> None:
        """Destroy timer and publishers."""
        self._node.destroy_timer(self._timer)
        for publisher in (self._statuses, self._table, self._markers):
            self._node.destroy_publisher(publisher)
        self._status.quality, self._status.quality_values = None, {}
