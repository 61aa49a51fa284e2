# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The predictor's parameters: defaults, descriptions, ranges and the check of the whole set.

No ROS in here: :mod:`mtpgo_ros.parameters.parameter_server` declares these fields in rclpy, so
each default is written once and a configuration can be checked without a node.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from msg_adapters.inputs.ego_odometry import EGO_CLASSES, EgoOptions
from msg_adapters.wire.input_limits import InputLimits
from mtpgo_core.class_map import class_map
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.live_calibration.live_options import (
    CALIBRATIONS,
    PREFERENCES,
    LiveOptions,
)
from mtpgo_core.maps.lane_file import require_lane_file
from mtpgo_core.maps.lane_file_options import AUTO, PROJECTIONS, LaneFileOptions
from mtpgo_core.options import check_options, listed
from mtpgo_core.prediction.paths.path_smoothing import LONGEST_MEMORY_S
from mtpgo_core.quality.quality_report import WINDOWS_S, QualityLimits
from mtpgo_core.task.task_description import GRAPH_POLICIES
from mtpgo_ros.parameters.parameter_change import Change, replaced
from mtpgo_ros.parameters.parameter_change import parameter_field as _field

INPUT_TYPES = (
    "auto",
    "pointcloud2",
    "autoware",
    "vision",
    "derived",
    "markers",
    "ika",
    "autoware_auto",
)
OUTPUT_KINDS = ("pointcloud2", "markers", "autoware")
TWIST_FRAMES = ("default", "object", "header")


@dataclass(frozen=True)
class PredictorParameters:
    """All parameters of the node ``predictor``; each field's metadata describes it."""

    model: str = _field(
        "default",
        "Name of an installed model or path of an exported one (.pt).",
        change=Change.CONFIGURE,
    )
    model_sha256: str = _field(
        "",
        "SHA-256 that the model file must have, as sha256sum prints it; empty accepts any file.",
        change=Change.CONFIGURE,
    )
    require_model: bool = _field(
        True,
        "A model that cannot be loaded ends the process with status 2; if false, constant"
        " velocity is predicted instead and the diagnostics report it.",
        change=Change.CONFIGURE,
    )
    rate: float = _field(
        5.0, "Predictions per second of the observations' time, at most (Hz).", low=0.1, high=50.0
    )
    input_type: str = _field(
        "auto",
        "Message type of the topic objects; auto uses the type of its publisher.",
        choices=INPUT_TYPES,
        change=Change.CONFIGURE,
    )
    graph: str = _field(
        "",
        "Which agents share a graph; empty uses the policy that the model was trained with.",
        choices=("", *GRAPH_POLICIES),
    )
    ego_id: str = _field(
        "",
        "Identity of the ego or another chosen object: a number, a UUID or the tracker's text;"
        " empty uses the one published on the topic ego_id.",
    )
    ego_topic: str = _field(
        "",
        "Topic with the odometry of the ego (nav_msgs/Odometry), which makes it a road user of the"
        " graph; empty leaves it out.",
        change=Change.CONFIGURE,
    )
    ego_length: float = _field(
        EgoOptions.length_m,
        "With ego_topic: length of the ego (m).",
        low=0.1,
        high=100.0,
        change=Change.CONFIGURE,
    )
    ego_width: float = _field(
        EgoOptions.width_m,
        "With ego_topic: width of the ego (m).",
        low=0.1,
        high=20.0,
        change=Change.CONFIGURE,
    )
    ego_class: str = _field(
        EgoOptions.class_name,
        "With ego_topic: class of the ego.",
        choices=EGO_CLASSES,
        change=Change.CONFIGURE,
    )
    ego_offset: float = _field(
        EgoOptions.offset_m,
        "With ego_topic: how far the ego's centre is ahead of the odometry's frame (m).",
        low=-50.0,
        high=50.0,
        change=Change.CONFIGURE,
    )
    ego_overlap: bool = _field(
        EgoOptions.overlap,
        "With ego_topic: an object whose centre lies in the ego's box is the ego, seen by its own"
        " tracker, and is left out.",
        change=Change.CONFIGURE,
    )
    ego_predicted: bool = _field(
        True,
        "The ego is predicted like all others; if false, the others are predicted in its presence"
        " and it is not published.",
    )
    max_agents: int = _field(
        128,
        "Most agents that the model predicts in a cycle, the nearest first; the rest is predicted"
        " at constant velocity.",
        low=1,
        high=4096,
    )
    max_tracks: int = _field(
        4096,
        "Most road users that are followed and predicted, the nearest to the ego or the middle"
        " first; others are left out.",
        low=1,
        high=65536,
        change=Change.CONFIGURE,
    )
    max_points: int = _field(
        200_000,
        "Most points (road users x modes x steps) of a prediction; with more, fewer modes are"
        " published, the most probable first.",
        low=1000,
        high=10_000_000,
    )
    max_neighbours: int = _field(
        0,
        "Agents of a graph besides its centre, the nearest first; 0 uses the number that the model"
        " was trained with. The graph 'scene' has no such limit.",
        low=0,
        high=4096,
    )
    radius: float = _field(
        0.0,
        "Agents farther than this from a graph's centre are not its neighbours (m); 0 uses the"
        " radius that the model was trained with.",
        low=0.0,
        high=10000.0,
    )
    fixed_frame: str = _field(
        "",
        "Frame into which objects are transformed with the topic odometry or TF; empty uses the"
        " objects' own frame, which must then be a fixed one.",
        change=Change.CONFIGURE,
    )
    output: tuple[str, ...] = _field(
        ("pointcloud2", "markers"), "Kinds of output that are published.", choices=OUTPUT_KINDS
    )
    max_modes: int = _field(
        8, "Most modes published of each agent, the most probable first.", low=1, high=64
    )
    num_threads: int = _field(
        1,
        "Threads of the model; measure before using more than one.",
        low=1,
        high=64,
        change=Change.CONFIGURE,
    )
    use_tracker_covariance: bool = _field(
        False, "The model starts from the tracker's covariance where a message carries one."
    )
    path_smoothing: float = _field(
        0.2,
        "Memory of the farthest predicted points of moving vehicles over the cycles (s), 0 for"
        " none: predictions jump less and follow news later.",
        low=0.0,
        high=LONGEST_MEMORY_S,
    )
    twist_frame: str = _field(
        "default",
        "Frame of the velocities in the messages: the object's axes, the header's frame, or by"
        " default the one that publishers of that type usually use.",
        choices=TWIST_FRAMES,
    )
    class_map: str = _field(
        "",
        "Our classes by the names and numbers in the messages: a preset (nuscenes, coco, coco91,"
        " autoware, ...) or a YAML file; empty takes our own names.",
        change=Change.CONFIGURE,
    )
    lane_file: str = _field(
        "",
        "File with the lanes of the site, for a model that uses lanes: a Lanelet2 map (OSM) or"
        " GeoJSON; empty takes the topic lane_markings.",
    )
    lane_projection: str = _field(
        AUTO,
        "How the coordinates of the lane file become metres: auto takes the metres in the file"
        " (local_x and local_y), the others project latitude and longitude.",
        choices=PROJECTIONS,
    )
    lane_origin: str = _field(
        "", "Latitude and longitude of the origin of the lane file's metres, '49.01, 8.43'."
    )
    lane_offset: str = _field(
        "", "x and y that are subtracted from the lane file's metres, '1000, -250.5' (m)."
    )
    lane_frame: str = _field(
        "",
        "Frame of the lane file's metres; TF leads from the objects' fixed frame to it. Empty: the"
        " objects' fixed frame.",
    )
    delay_compensation: bool = _field(
        False,
        "The horizon starts at the node's present time, at most 0.5 s after the observation,"
        " instead of at the observation; stamp and frame remain those of the observation.",
    )
    max_message_bytes: int = _field(
        InputLimits.max_message_bytes,
        "Largest message on objects that is decoded (bytes); larger ones are left out.",
        low=1024,
        high=1 << 30,
    )
    max_objects: int = _field(
        InputLimits.max_objects,
        "Most objects of a message that is decoded.",
        low=1,
        high=1_000_000,
    )
    max_fields: int = _field(
        InputLimits.max_fields,
        "Most fields of a point cloud of objects that is decoded.",
        low=3,
        high=4096,
    )
    input_timeout: float = _field(
        1.0,
        "The input counts as stale when no message has come for this long (s).",
        low=0.05,
        high=3600.0,
    )
    stamp_tolerance: float = _field(
        1.0,
        "A single observation stamped farther ahead of the node's clock than this is dropped (s).",
        low=0.01,
        high=3600.0,
    )
    budget: float = _field(
        0.85,
        "Share of the period after which constant velocity replaces a model that has not"
        " answered.",
        low=0.05,
        high=1.0,
    )
    diagnostic_period: float = _field(
        1.0, "Time between two diagnostics without a change (s).", low=0.1, high=60.0
    )
    quality_window: int = _field(
        300,
        "Time over which the node judges its own predictions for the diagnostics (s).",
        choices=WINDOWS_S,
    )
    quality_min_agents: int = _field(
        QualityLimits.min_agents,
        "Fewest road users of a class group and motion whose scores are given and judged.",
        low=1,
        high=100000,
    )
    quality_warn_coverage: float = _field(
        QualityLimits.warn_coverage,
        "The diagnostics warn when the 90 % ellipses hold less than this share of what happened.",
        low=0.0,
        high=1.0,
    )
    quality_error_coverage: float = _field(
        QualityLimits.error_coverage,
        "The diagnostics report an error when they hold less than this share.",
        low=0.0,
        high=1.0,
    )
    quality_error_cv_ratio: float = _field(
        QualityLimits.error_cv_ratio,
        "The diagnostics report an error when the average displacement error is more than this"
        " many times that of constant velocity; they warn when it is worse by 2 %. Differences"
        " up to 0.1 m do not count.",
        low=1.0,
        high=100.0,
    )
    calibration: str = _field(
        LiveOptions.calibration,
        "What is applied to the model's output: the calibration in its file (shipped), that one"
        " corrected by what became known of earlier predictions (online), or nothing (off).",
        choices=CALIBRATIONS,
        change=Change.CONFIGURE,
    )
    correct_paths: bool = _field(
        LiveOptions.correct_paths,
        "With calibration online: the model's paths are corrected by what became of earlier ones,"
        " too, not only the covariances.",
        change=Change.CONFIGURE,
    )
    calibration_file: str = _field(
        "",
        "File in which the online calibration survives a restart; empty keeps it in memory.",
        change=Change.CONFIGURE,
    )
    calibration_memory: float = _field(
        LiveOptions.memory_s,
        "Time constant with which the online calibration forgets what no new outcomes confirm"
        " (s).",
        low=1.0,
        high=1e6,
    )
    prefer: str = _field(
        LiveOptions.prefer,
        "Who predicts: the model wherever it can, or constant velocity for the class groups,"
        " moving or standing, in which it has been better (best).",
        choices=PREFERENCES,
        change=Change.CONFIGURE,
    )
    prefer_time: float = _field(
        LiveOptions.prefer_time_s,
        "With prefer best: time for which the other predictor must have been better (s).",
        low=1.0,
        high=36000.0,
    )
    prefer_agents: int = _field(
        LiveOptions.prefer_agents,
        "With prefer best: road users of the group in that time.",
        low=1,
        high=10000,
    )
    autostart: bool = _field(
        True, "The node configures and activates itself at its start.", change=Change.START
    )

    @property
    def ego_options(self) -> EgoOptions:
        """What is known of the ego besides its odometry."""
        return EgoOptions(
            length_m=self.ego_length,
            width_m=self.ego_width,
            class_name=self.ego_class,
            offset_m=self.ego_offset,
            overlap=self.ego_overlap,
        )

    @property
    def input_limits(self) -> InputLimits:
        """The largest messages that are decoded."""
        return InputLimits(self.max_message_bytes, self.max_objects, self.max_fields)

    @property
    def lane_options(self) -> LaneFileOptions:
        """How the coordinates of the lane file become metres."""
        return LaneFileOptions(self.lane_projection, self.lane_origin, self.lane_offset)

    @property
    def live_options(self) -> LiveOptions:
        """What the live calibration learns."""
        return LiveOptions(
            calibration=self.calibration,
            prefer=self.prefer,
            correct_paths=self.correct_paths,
            memory_s=self.calibration_memory,
            prefer_time_s=self.prefer_time,
            prefer_agents=self.prefer_agents,
        )

    @property
    def period_s(self) -> float:
        """Shortest time between two predictions, which is also the deadline of each (s)."""
        return 1.0 / self.rate

    @property
    def quality_limits(self) -> QualityLimits:
        """From when on the node's scores are bad."""
        return QualityLimits(
            min_agents=self.quality_min_agents,
            warn_coverage=self.quality_warn_coverage,
            error_coverage=self.quality_error_coverage,
            error_cv_ratio=self.quality_error_cv_ratio,
        )


def check(parameters: PredictorParameters) -> None:
    """Check every value and their combination.

    Raises:
        ConfigurationError: one sentence with the parameter, its value and what was expected.
    """
    check_options(parameters, "parameter ")
    if not parameters.output:
        raise ConfigurationError(
            f"parameter output is empty, expected at least one of {listed(OUTPUT_KINDS)}"
        )
    if not re.fullmatch(r"|[0-9a-fA-F]{64}", parameters.model_sha256.strip()):
        raise ConfigurationError(
            f"parameter model_sha256 is {parameters.model_sha256!r}, expected the 64 digits that"
            " sha256sum prints, or nothing"
        )
    topic = r"|(~/|/)?[A-Za-z_]\w*(/[A-Za-z_]\w*)*"
    if not re.fullmatch(topic, parameters.ego_topic, flags=re.ASCII):
        raise ConfigurationError(
            f"parameter ego_topic is {parameters.ego_topic!r}, expected the name of a topic with"
            " nav_msgs/Odometry, or nothing"
        )
    if not parameters.model.strip():
        raise ConfigurationError(
            "parameter model is empty, expected the name of an installed model or a file"
        )
    try:
        _ = parameters.lane_options
    except ConfigurationError as error:
        raise ConfigurationError(f"parameter {error}") from error  # it begins with the name
    if parameters.input_timeout < parameters.period_s:
        raise ConfigurationError(
            f"parameter input_timeout is {parameters.input_timeout:g} s, shorter than a period of"
            f" parameter rate ({parameters.rate:g} Hz): every input would count as stale, expected"
            f" at least {parameters.period_s:g} s"
        )
    if parameters.quality_error_coverage > parameters.quality_warn_coverage:
        raise ConfigurationError(
            f"parameter quality_error_coverage is {parameters.quality_error_coverage:g}, expected"
            f" at most quality_warn_coverage, {parameters.quality_warn_coverage:g}"
        )


def updated(current: PredictorParameters, values: Mapping[str, Any]) -> PredictorParameters:
    """Return ``current`` with ``values`` replaced, checked as a whole.

    Names that are not parameters of the predictor (``use_sim_time``, QoS overrides) are ignored.

    Raises:
        ConfigurationError: see :func:`check`.
    """
    new = replaced(current, values)
    check(new)
    # Files are looked at when they are chosen: one that is deleted later hinders no other change.
    if new.class_map != current.class_map:
        try:
            class_map(new.class_map)
        except ConfigurationError as error:
            raise ConfigurationError(f"parameter class_map: {error}") from error
    if new.lane_file and new.lane_file != current.lane_file:
        try:
            require_lane_file(new.lane_file)
        except ConfigurationError as error:
            raise ConfigurationError(f"parameter lane_file: {error}") from error
    return new
