# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which trackers are simulated: ranges, and the parameters of one tracker drawn from them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import check_options, option

OBSERVATIONS = (RECORDED, SIMULATED) = ("recorded", "simulated")
"""Where observations come from: a recording as it is, or as a simulated tracker reports it."""

YAW_SOURCES = ("course", "box", "none")
"""Where a tracker's yaw comes from: its own velocity, the detected box, or nowhere."""

Range = tuple[float, float]


@dataclass(frozen=True)
class Tracker:
    """One tracker.

    Attributes:
        position_std_m: white noise of a measured position, per axis, of a usual agent (m).
        drift_std_m: slowly varying noise of a measured position, per axis (m).
        drift_time_s: correlation time of that noise (s).
        agent_spread: standard deviation over the agents of the logarithm of their noise.
        assumed_std_m: noise of a position that the filter assumes (m).
        order: states of the filter on each axis: 2 for constant velocity, 3 for constant
            acceleration.
        process_noise: square root of the spectral density of the white acceleration
            (m/s^2/sqrt(Hz)) for order 2, of the white jerk (m/s^3/sqrt(Hz)) for order 3.
        rate_hz: measurements per second, at most those of the recording (Hz).
        dropout_share: share of the measurements that are missing; bursts may overlap, so that of
            0.15 asked for, 0.14 are.
        dropout_s: mean length of a burst of missing measurements (s).
        birth_s: time until a new track is reported (s).
        gives_velocity: velocity (and acceleration, for order 3) is reported.
        yaw_source: one of :data:`YAW_SOURCES`.
        yaw_std_rad: white noise of the yaw (rad).
        moving_mps: above this speed the course is the yaw; below, the last one is held (m/s).
        unknown_class_share: share of the agents whose class is unknown.
        gives_size: sizes are reported.
        size_std: standard deviation of the logarithm of an agent's reported size.
    """

    position_std_m: float
    drift_std_m: float
    drift_time_s: float
    agent_spread: float
    assumed_std_m: float
    order: int
    process_noise: float
    rate_hz: float
    dropout_share: float
    dropout_s: float
    birth_s: float
    gives_velocity: bool
    yaw_source: str
    yaw_std_rad: float
    moving_mps: float
    unknown_class_share: float
    gives_size: bool
    size_std: float


@dataclass(frozen=True)
class TrackerConfig:
    """Ranges from which trackers are drawn; all chosen, see the reasons.

    Together they give velocities that differ from the recorded ones by 0.35 to 0.7 m/s per axis (5
    to 95 % of the noisy trackers on NGSIM, whose velocities are noisy themselves; measured) and
    positions that are off by 0.05 to 0.26 m.

    Attributes:
        ideal_share: share of the trackers without any defect: noiseless measurements of every
            frame, everything known. Their velocity, acceleration and yaw still come from a causal
            filter, because those of recordings come from centred filters, which know the future.
        position_std_m: white noise (m), logarithmically uniform: lidar boxes 0.03 to 0.15 m,
            cameras and radars to 0.4 m.
        drift_std_m: slow noise (m): the centre of a box moves on the vehicle as other sides of it
            come into sight.
        drift_time_s: its correlation time (s): such a change of view.
        agent_spread: far agents are measured worse than near ones.
        assumed_factor: assumed over true noise, logarithmically uniform: few filters are tuned
            exactly.
        assumed_least_m: the least noise that a filter assumes (m), so that it stays stable.
        acceleration_share: share of the trackers with a constant acceleration model; most use
            constant velocity.
        process_noise: of constant velocity, logarithmically uniform (m/s^2/sqrt(Hz)): from smooth
            with a lag of a second to fast and noisy.
        jerk_noise: of constant acceleration (m/s^3/sqrt(Hz)).
        rate_hz: slow lidars with 5 Hz to fast cameras with 25 Hz.
        clear_share: share of the trackers without drop-outs.
        dropout_share: missing measurements of the others: occlusions and missed detections.
        dropout_s: mean length of a burst (s); longer ones end a track in most trackers.
        birth_s: time until a track is confirmed (s): two frames to several detections in a row.
        no_velocity_share: share of the trackers that report no velocity.
        course_share: share whose yaw is the course of their own velocity.
        no_yaw_share: share that report no yaw; the others report the detected box's.
        exact_yaw_share: share whose yaw has no noise of its own.
        yaw_std_rad: noise of the others (rad): box fits are exact to 1 to 8 degrees.
        moving_mps: limit between course and held yaw (m/s).
        unclassified_share: share that report every agent as unknown.
        some_classified_share: share that report a random share of the agents as unknown.
        no_size_share: share that report no sizes.
        size_std: spread of the reported sizes of the others: sides that are not seen are guessed.
    """

    ideal_share: float = option(0.2, low=0.0, high=1.0)
    position_std_m: tuple[float, float] = option((0.03, 0.4), above=0.0)
    drift_std_m: tuple[float, float] = option((0.0, 0.15), low=0.0)
    drift_time_s: tuple[float, float] = option((1.0, 5.0), above=0.0)
    agent_spread: float = option(0.3, low=0.0)
    assumed_factor: tuple[float, float] = option((0.7, 2.0), above=0.0)
    assumed_least_m: float = option(0.03, above=0.0)
    acceleration_share: float = option(0.4, low=0.0, high=1.0)
    process_noise: tuple[float, float] = option((0.5, 3.0), above=0.0)
    jerk_noise: tuple[float, float] = option((0.5, 4.0), above=0.0)
    rate_hz: tuple[float, float] = option((5.0, 25.0), above=0.0)
    clear_share: float = option(0.4, low=0.0, high=1.0)
    dropout_share: tuple[float, float] = option((0.01, 0.15), low=0.0, below=1.0)
    dropout_s: tuple[float, float] = option((0.1, 0.6), above=0.0)
    birth_s: tuple[float, float] = option((0.2, 1.5), low=0.0)
    no_velocity_share: float = option(0.15, low=0.0, high=1.0)
    course_share: float = option(0.4, low=0.0, high=1.0)
    no_yaw_share: float = option(0.15, low=0.0, high=1.0)
    exact_yaw_share: float = option(0.4, low=0.0, high=1.0)
    yaw_std_rad: tuple[float, float] = option((0.02, 0.15), low=0.0)
    moving_mps: tuple[float, float] = option((0.3, 1.0), low=0.0)
    unclassified_share: float = option(0.15, low=0.0, high=1.0)
    some_classified_share: float = option(0.2, low=0.0, high=1.0)
    no_size_share: float = option(0.25, low=0.0, high=1.0)
    size_std: tuple[float, float] = option((0.0, 0.15), low=0.0)

    def __post_init__(self) -> None:
        check_options(self, "tracker.")
        for first, second in (
            ("course_share", "no_yaw_share"),
            ("unclassified_share", "some_classified_share"),
        ):
            total = getattr(self, first) + getattr(self, second)
            if total > 1.0:
                raise ConfigurationError(
                    f"tracker.{first} and tracker.{second} add up to {total:g}, expected at most 1"
                )

    def draw(self, rng: np.random.Generator) -> Tracker:
        """Return a tracker drawn from the ranges."""

        def uniform(between: Range) -> float:
            return float(rng.uniform(*between))

        def log_uniform(between: Range) -> float:
            return math.exp(rng.uniform(math.log(between[0]), math.log(between[1])))

        def chance(share: float) -> bool:
            return bool(rng.random() < share)

        order = 3 if chance(self.acceleration_share) else 2
        process_noise = log_uniform(self.process_noise if order == 2 else self.jerk_noise)
        moving_mps = uniform(self.moving_mps)
        if chance(self.ideal_share):
            return ideal_tracker(
                order,
                process_noise=process_noise,
                assumed_std_m=self.assumed_least_m,
                moving_mps=moving_mps,
            )
        position_std_m = log_uniform(self.position_std_m)
        drift_std_m = uniform(self.drift_std_m)
        assumed = math.hypot(position_std_m, drift_std_m) * log_uniform(self.assumed_factor)
        kind = rng.random()
        classified = rng.random()
        unknown = uniform((0.1, 0.9)) if classified < self.some_classified_share else 0.0
        unclassified = classified >= 1.0 - self.unclassified_share
        yaw_known = kind >= self.course_share + self.no_yaw_share
        return Tracker(
            position_std_m=position_std_m,
            drift_std_m=drift_std_m,
            drift_time_s=uniform(self.drift_time_s),
            agent_spread=self.agent_spread,
            assumed_std_m=max(assumed, self.assumed_least_m),
            order=order,
            process_noise=process_noise,
            rate_hz=uniform(self.rate_hz),
            dropout_share=0.0 if chance(self.clear_share) else uniform(self.dropout_share),
            dropout_s=uniform(self.dropout_s),
            birth_s=uniform(self.birth_s),
            gives_velocity=not chance(self.no_velocity_share),
            yaw_source=("course" if kind < self.course_share else "box" if yaw_known else "none"),
            yaw_std_rad=0.0 if chance(self.exact_yaw_share) else uniform(self.yaw_std_rad),
            moving_mps=moving_mps,
            unknown_class_share=1.0 if unclassified else unknown,
            gives_size=not chance(self.no_size_share),
            size_std=uniform(self.size_std),
        )


def ideal_tracker(
    order: int = 3,
    *,
    process_noise: float = 5.0,
    assumed_std_m: float = 0.03,
    moving_mps: float = 0.5,
) -> Tracker:
    """Return a tracker without noise or gaps; its filter is causal like any other.

    Args:
        order: see :class:`Tracker`, as for the others.
        process_noise: see there.
        assumed_std_m: see there.
        moving_mps: see there.
    """
    return Tracker(
        position_std_m=0.0,
        drift_std_m=0.0,
        drift_time_s=1.0,
        agent_spread=0.0,
        assumed_std_m=assumed_std_m,
        order=order,
        process_noise=process_noise,
        rate_hz=math.inf,
        dropout_share=0.0,
        dropout_s=1.0,
        birth_s=0.0,
        gives_velocity=True,
        yaw_source="course",
        yaw_std_rad=0.0,
        moving_mps=moving_mps,
        unknown_class_share=0.0,
        gives_size=True,
        size_std=0.0,
    )
