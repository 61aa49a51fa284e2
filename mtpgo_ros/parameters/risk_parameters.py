# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node ``risk``. No ROS in here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import check_options
from mtpgo_core.risk.ego_plan import EgoFootprint
from mtpgo_core.risk.predicted_occupancy import GridShape
from mtpgo_ros.parameters.parameter_change import Change, parameter_field, replaced

PREDICTION_TYPES = ("pointcloud2", "autoware")
PLAN_TYPES = ("odometry", "path", "autoware")
AFTER_PLAN = ("unknown", "stand")
MISSING_COVARIANCE = ("unknown", "assumed")


@dataclass(frozen=True)
class RiskParameters:
    """All parameters of the node ``risk``; each field's metadata describes it."""

    prediction_type: str = parameter_field(
        "pointcloud2",
        "The message with the predictions: the topic predictor/predictions (pointcloud2), or"
        " predictor/predicted_objects as autoware_perception_msgs/PredictedObjects (autoware).",
        choices=PREDICTION_TYPES,
        change=Change.CONFIGURE,
    )
    missing_covariance: str = parameter_field(
        "unknown",
        "Where PredictedObjects gives no covariance of position and velocity, the risk is unknown,"
        " or it starts from 0.2 m and 0.3 m/s (assumed).",
        choices=MISSING_COVARIANCE,
    )
    plan_type: str = parameter_field(
        "odometry",
        "Where the ego will be: constant velocity of the topic odometry, or the topic plan as"
        " nav_msgs/Path with times (path) or autoware_planning_msgs/Trajectory (autoware).",
        choices=PLAN_TYPES,
        change=Change.CONFIGURE,
    )
    plan_timeout: float = parameter_field(
        2.0,
        "A plan made longer than this before or after the observation of the predictions is not"
        " used (s).",
        low=0.05,
        high=3600.0,
    )
    after_plan: str = parameter_field(
        "unknown",
        "Where the ego is after the end of its plan: not known, or it stands at its end.",
        choices=AFTER_PLAN,
    )
    prediction_timeout: float = parameter_field(
        1.0,
        "Predictions older than this by the node's clock are stale, as is a topic without"
        " predictions for this long (s).",
        low=0.05,
        high=3600.0,
    )
    ego_id: str = parameter_field(
        "",
        "Identity of the ego among the predicted road users, which is left out: a number, a UUID"
        " or the tracker's text; empty uses the one published on the topic ego_id.",
    )
    ego_length: float = parameter_field(
        EgoFootprint.length, "Length of the ego (m).", above=0.0, high=100.0
    )
    ego_width: float = parameter_field(
        EgoFootprint.width, "Width of the ego (m).", above=0.0, high=100.0
    )
    ego_offset: float = parameter_field(
        EgoFootprint.center_offset,
        "How far the middle of the ego is ahead of the point that plan or odometry move, often the"
        " middle of the rear axle (m).",
        low=-50.0,
        high=50.0,
    )
    ego_margin: float = parameter_field(
        EgoFootprint.margin,
        "Room that is kept free around the ego and counts as part of it (m).",
        low=0.0,
        high=20.0,
    )
    occupancy_from: float = parameter_field(
        0.0, "Begin of the time ahead whose occupancy is published (s).", low=0.0, high=60.0
    )
    occupancy_until: float = parameter_field(
        2.0,
        "Its end (s); of several steps within, the highest probability counts. Equal to the begin:"
        " the one step there.",
        low=0.0,
        high=60.0,
    )
    occupancy_size: float = parameter_field(
        60.0, "Side of the occupancy grid (m).", low=1.0, high=1000.0
    )
    occupancy_resolution: float = parameter_field(
        GridShape.resolution, "Side of a cell of the grid (m).", low=0.05, high=10.0
    )
    occupancy_rate: float = parameter_field(
        2.0, "Occupancy grids per second, at most (Hz).", low=0.01, high=50.0
    )
    diagnostic_period: float = parameter_field(
        1.0, "Time between two diagnostics without a change (s).", low=0.1, high=60.0
    )
    autostart: bool = parameter_field(
        True, "The node configures and activates itself at its start.", change=Change.START
    )

    @property
    def footprint(self) -> EgoFootprint:
        """The box of the ego."""
        return EgoFootprint(self.ego_length, self.ego_width, self.ego_offset, self.ego_margin)

    @property
    def grid(self) -> GridShape:
        """The shape of the occupancy grid."""
        return GridShape(self.occupancy_size, self.occupancy_resolution)

    @property
    def assumes_covariance(self) -> bool:
        """Whether a covariance is assumed for road users whose message gives none."""
        return self.missing_covariance == "assumed"

    @property
    def stands_after(self) -> bool:
        """Whether the ego stands at the end of its plan."""
        return self.after_plan == "stand"


_MOST_CELLS = 4_000_000
"""Most cells of a grid; chosen: 1 km at half a metre."""


def updated_risk(current: RiskParameters, values: Mapping[str, Any]) -> RiskParameters:
    """Return ``current`` with ``values`` replaced, checked as a whole.

    Raises:
        ConfigurationError: one sentence with the parameter, its value and what was expected.
    """
    new = replaced(current, values)
    check_options(new, "parameter ")
    if new.occupancy_until < new.occupancy_from:
        raise ConfigurationError(
            f"parameter occupancy_until is {new.occupancy_until:g}, expected at least"
            f" occupancy_from, {new.occupancy_from:g}"
        )
    if new.grid.cells**2 > _MOST_CELLS:
        raise ConfigurationError(
            f"parameter occupancy_size is {new.occupancy_size:g} m, {new.grid.cells} cells a side"
            f" with occupancy_resolution {new.occupancy_resolution:g} m, expected at most"
            f" {round(_MOST_CELLS**0.5)}"
        )
    return new
