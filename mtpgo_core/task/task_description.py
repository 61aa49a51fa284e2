# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The task a model was trained for: everything that must be equal offline and online.

The description is stored as JSON in the exported file (extra file ``task.json``), so the node
builds exactly the input of the training and needs neither the network code nor a further file.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import check_options, from_dict, listed, option, require
from mtpgo_core.task.calibration import Calibration

SCHEMA_VERSION = 1
"""Incremented whenever an older runner can no longer run a newer file."""

TASK_FILE = "task.json"
"""Name of the extra file inside the TorchScript archive."""

LARGEST_STEPS = 1000
"""Largest number of steps of history or horizon; chosen: the memory of the node grows with it."""

LARGEST_MODE_SPREAD = 3.0
"""Largest ``least_mode_spread``; chosen: modes farther out lie outside of the 95 % ellipse."""

LARGEST_S = 3600.0
"""Largest time in a task description (s); chosen: far beyond any prediction of traffic."""

STATES = (("x", "y"), ("x", "y", "vx", "vy"))
"""States that a model can have."""

GRAPH_POLICIES = ("ego", "cover", "each", "scene")
FRAME_POLICIES = ("centre_heading", "driving_direction", "site_origin")
CONTEXTS = ("none", "polar", "lanes", "leaders", "traffic", "road")
ANGLES = ("vector", "radians")
DERIVATIVE_SOURCES = ("message", "estimated")
BASE_FEATURES = ("x", "y", "vx", "vy", "ax", "ay", "cos_yaw", "sin_yaw")
CONTEXT_FEATURES = {
    "none": (),
    "polar": ("r", "cos_theta", "sin_theta"),
    "lanes": ("d_l", "d_r"),
    "leaders": tuple(f"lead{i}_{name}" for i in (1, 2) for name in ("gap", "near", "dv", "ax")),
    "traffic": (
        "length",
        *(f"lead{i}_{name}" for i in (1, 2, 3) for name in ("gap", "near", "dv", "ax")),
        "lead1_across",
        *(f"behind_{name}" for name in ("gap", "near", "dv")),
        *(
            f"{side}_{place}_{name}"
            for side in ("left", "right")
            for place in ("ahead", "behind")
            for name in ("gap", "near", "dv")
        ),
    ),
}
CONTEXT_FEATURES["road"] = (*CONTEXT_FEATURES["leaders"], "in_lane", *CONTEXT_FEATURES["lanes"])

LANE_CONTEXTS = ("lanes", "road")
"""Contexts that need lane lines."""

ANGLE_FEATURES = {("cos_yaw", "sin_yaw"): "yaw", ("cos_theta", "sin_theta"): "theta"}
"""What ``scene.angles: radians`` has in place of two columns (paper, node features, eq. (4b))."""

SIZE_FEATURES = ("length", "width", "size_known")
"""Static features after the classes, with ``scene.sizes``."""

NOISE_FEATURES = (
    "speed_noise_along",
    "speed_noise_across",
    "position_noise_along",
    "position_noise_across",
)
CHANGE_STEPS = (1, 3, 5, 10, 15)
"""Steps over which the change of the velocity is a static feature; chosen: from what an observer
of clean tracks needs to what is left of noisy ones, up to the history of 3 s."""
CHANGES_ALONG = tuple(f"speed_change_along_{steps}" for steps in CHANGE_STEPS)
CHANGES_ACROSS = tuple(f"speed_change_across_{steps}" for steps in CHANGE_STEPS)
TRACK_FEATURES = (*NOISE_FEATURES, "noise_known", *CHANGES_ALONG, *CHANGES_ACROSS)
"""Static features after those, with ``scene.track_summary``."""


@dataclass(frozen=True)
class HistoryConfig:
    """How observations become the window (docs/design.md, decisions 1 and 13).

    Attributes:
        dt_s: grid step (s).
        steps: grid samples T, the present one included.
        max_gap_s: longest time between two observations that is interpolated (s).
        max_extrapolation_s: longest extrapolation of an agent to the common time t (s).
        velocity_source: ``message``: the message's where it has one, else estimated;
            ``estimated``: always the causal estimate from past positions.
        acceleration_source: the same choice; the estimate is made from past velocities.
        velocity_tau_s: time constant of the causal velocity estimate (s).
        acceleration_tau_s: time constant of the causal acceleration estimate (s).
        max_speed_mps: an observation faster than this is rejected; a faster move since the last
            observation starts a new track (m/s).
    """

    dt_s: float = option(0.2, low=1e-3, high=LARGEST_S)
    steps: int = option(16, low=1, high=LARGEST_STEPS)
    max_gap_s: float = option(0.5, low=0.0, high=LARGEST_S)
    max_extrapolation_s: float = option(0.5, low=0.0, high=LARGEST_S)
    velocity_source: str = option("message", choices=DERIVATIVE_SOURCES)
    acceleration_source: str = option("estimated", choices=DERIVATIVE_SOURCES)
    velocity_tau_s: float = option(0.3, low=0.0, high=LARGEST_S)
    acceleration_tau_s: float = option(0.5, low=0.0, high=LARGEST_S)
    max_speed_mps: float = option(100.0, low=1.0, high=1e4)

    def __post_init__(self) -> None:
        check_options(self, "history.")

    @property
    def grid_ns(self) -> tuple[int, ...]:
        """Times of the T grid samples relative to the common time (ns), from the oldest to 0."""
        dt_ns = round(self.dt_s * 1e9)
        return tuple(range((1 - self.steps) * dt_ns, 1, dt_ns))

    @property
    def max_gap_ns(self) -> int:
        """``max_gap_s`` (ns)."""
        return round(self.max_gap_s * 1e9)

    @property
    def max_extrapolation_ns(self) -> int:
        """``max_extrapolation_s`` (ns)."""
        return round(self.max_extrapolation_s * 1e9)

    @property
    def keep_ns(self) -> int:
        """How long a track is kept after its last observation (ns)."""
        return max(self.max_gap_ns, self.max_extrapolation_ns) - self.grid_ns[0]


@dataclass(frozen=True)
class SceneConfig:
    """Which agents share a graph, and their frame (docs/design.md, decisions 12 to 14).

    Attributes:
        policy: graph policy, one of ``GRAPH_POLICIES``.
        max_neighbours: agents of a graph besides its centre, the nearest first.
        radius_m: an agent farther than this from the centre is not its neighbour (m).
        frame: scene-frame policy, one of ``FRAME_POLICIES``.
        site_origin: origin for ``site_origin``, in the fixed frame (m).
        site_origins: origins by the recording's location (highD, rounD, inD: ``locationId``), in
            place of ``site_origin``; see :meth:`at_site`.
        angles: ``vector``: yaw and polar angle as cosine and sine; ``radians``: as the angles psi
            and theta themselves, as in the paper.
        departed_agents: agents that left before t stay in the graphs of the past, as in the paper;
            see :mod:`mtpgo_core.scene.departed_agents`.
        context: context features, one of ``CONTEXTS``.
        leader_reach_m: range of the contexts ``leaders``, ``traffic`` and ``road`` (m).
        classes: class names of the one-hot static feature, in order.
        sizes: length and width are static features, too.
        track_summary: how noisy an agent's past is and how its velocity changed are static
            features, too, see :func:`mtpgo_core.scene.track_summary.track_summary`.
        trails: whether the model gets the ways that earlier road users took from an agent's place,
            see :func:`mtpgo_core.scene.trails.trail_context.trail_features`.
        lane_ways: with ``trails``: where none is known, ways on are those of the lanes.
    """

    policy: str = option("cover", choices=GRAPH_POLICIES)
    max_neighbours: int = option(31, low=0)
    radius_m: float = option(100.0, low=0.0)
    frame: str = option("centre_heading", choices=FRAME_POLICIES)
    site_origin: tuple[float, float] = option((0.0, 0.0), low=-1e9, high=1e9)
    site_origins: dict[str, tuple[float, float]] = field(default_factory=dict)
    angles: str = option("vector", choices=ANGLES)
    departed_agents: bool = False
    context: str = option("none", choices=CONTEXTS)
    leader_reach_m: float = option(80.0, low=1.0, high=1e4)
    classes: tuple[str, ...] = (
        "car",
        "van",
        "truck",
        "bus",
        "trailer",
        "motorcycle",
        "bicycle",
        "pedestrian",
    )
    sizes: bool = False
    track_summary: bool = False
    trails: bool = False
    lane_ways: bool = False

    def __post_init__(self) -> None:
        check_options(self, "scene.")
        require(
            "scene.lane_ways",
            self.lane_ways,
            self.trails or not self.lane_ways,
            "false without scene.trails",
        )
        origins = {}
        for location, origin in self.site_origins.items():
            numbers = isinstance(origin, list | tuple) and len(origin) == 2
            numbers = numbers and all(
                isinstance(v, int | float) and not isinstance(v, bool) and abs(v) <= 1e9
                for v in origin
            )
            require(f"scene.site_origins.{location}", origin, numbers, "two numbers, x and y (m)")
            origins[str(location)] = (float(origin[0]), float(origin[1]))
        object.__setattr__(self, "site_origins", origins)

    def at_site(self, location: str | None) -> SceneConfig:
        """Return the configuration with the origin of a site as its ``site_origin``.

        Args:
            location: the site's name, as the data set has it; None if it is not known.

        Raises:
            ConfigurationError: there are origins by site, and none for this one.
        """
        if self.frame != "site_origin" or not self.site_origins:
            return self
        if location is None or location not in self.site_origins:
            given = "not given" if location is None else f"{location!r}"
            raise ConfigurationError(
                f"the site is {given}, expected one with an origin in scene.site_origins: "
                + listed(self.site_origins)
            )
        return dataclasses.replace(self, site_origin=self.site_origins[location], site_origins={})

    @property
    def uses_lanes(self) -> bool:
        """Whether lane lines are an input."""
        return self.lane_ways or self.context in LANE_CONTEXTS

    @property
    def features(self) -> tuple[str, ...]:
        """Names of the F features, in the order of the model's input."""
        names = BASE_FEATURES + CONTEXT_FEATURES[self.context]
        if self.angles == "vector":
            return names
        second = {pair[1] for pair in ANGLE_FEATURES}
        angle = {pair[0]: name for pair, name in ANGLE_FEATURES.items()}
        return tuple(angle.get(name, name) for name in names if name not in second)

    @property
    def static_features(self) -> tuple[str, ...]:
        """Names of the C static features, in the order of the model's input."""
        sizes = SIZE_FEATURES if self.sizes else ()
        return self.classes + sizes + (TRACK_FEATURES if self.track_summary else ())


@dataclass(frozen=True)
class TaskDescription:
    """Everything that a model file states about its model.

    Attributes:
        name: short name of the model.
        version: version of the package that exported it.
        states: names of the S states in the model's output (2 or 4).
        horizon_steps: H, at ``history.dt_s``.
        modes: M.
        least_mode_spread: smallest distance between the modes, see
            :func:`mtpgo_core.prediction.paths.mode_spread.with_least_spread`; 0 leaves them where
            the network puts them.
        history: see :class:`HistoryConfig`.
        scene: see :class:`SceneConfig`.
        calibration: applied to the model's output by the runner; none by default.
        model: the network's configuration, for information.
        training: data (names, hashes), licence and attribution, splits, schedule, seed.
        metrics: measured results, by data set.
        weights_sha256: hash over the parameters and buffers of the checkpoint that was exported.
        content_sha256: hash over the exported file, see
            :func:`mtpgo_core.task.model_file.content_sha256`; empty in files of earlier versions.
    """

    name: str = "unnamed"
    version: str = ""
    states: tuple[str, ...] = ("x", "y", "vx", "vy")
    horizon_steps: int = option(25, low=1, high=LARGEST_STEPS)
    modes: int = option(8, low=1, high=64)
    least_mode_spread: float = option(0.0, low=0.0, high=LARGEST_MODE_SPREAD)
    history: HistoryConfig = HistoryConfig()
    scene: SceneConfig = SceneConfig()
    calibration: Calibration = Calibration()  # noqa: RUF009  frozen
    model: dict[str, Any] = field(default_factory=dict)
    training: dict[str, Any] = field(default_factory=dict)
    metrics: dict[str, Any] = field(default_factory=dict)
    weights_sha256: str = ""
    content_sha256: str = ""
    schema_version: int = SCHEMA_VERSION

    def __post_init__(self) -> None:
        check_options(self, "task.")
        require("task.states", self.states, self.states in STATES, f"one of {listed(STATES)}")

    def to_json(self) -> str:
        """Return the JSON text that is stored in the exported file."""
        return json.dumps(dataclasses.asdict(self), indent=2, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> TaskDescription:
        """Return the description stored in ``text``.

        Raises:
            ConfigurationError: the text is not a JSON object, has an unknown or ill-typed field,
                has another schema version, or a calibration for another horizon; the sentence
                names the field.
        """
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ConfigurationError(f"the task description is no JSON: {error}") from error
        if not isinstance(data, dict):
            raise ConfigurationError(
                f"the task description is a JSON {type(data).__name__}, expected an object"
            )
        version = data.get("schema_version")
        if version != SCHEMA_VERSION:
            raise ConfigurationError(
                f"the task description has schema version {version!r}, expected {SCHEMA_VERSION}"
            )
        task = from_dict(cls, data, "task")
        steps = task.calibration.horizon_steps
        require(
            "length of task.calibration.factors",
            steps,
            task.calibration.is_none or steps == task.horizon_steps,
            f"{task.horizon_steps}, the steps of the horizon",
        )
        return task
