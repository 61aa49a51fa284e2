# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates pedestrians on a plaza, in a shared street, on a crowded sidewalk, in crossing flows.

They walk alone or in groups at 0.6 to 2 m/s, stop, turn to other goals, and evade each other
(:mod:`~mtpgo_training.simulate.varied.social_force`); some bicycles ride among them. Recordings
are in inD layout.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mtpgo_core.options import option
from mtpgo_core.schema import Float64Array, IndexArray
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate.drivers import Generator, between
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.simulation_config import LARGEST_FRAME_RATE, SimulationConfig
from mtpgo_training.simulate.sumo import EXTRA_S, FloatingCarData, VehicleType
from mtpgo_training.simulate.varied.road_builder import box_view
from mtpgo_training.simulate.varied.social_force import Crowd, SocialForceConfig
from mtpgo_training.simulate.varied.varied_drivers import draw_varied_types, draw_walking_speed

PLACES = ("plaza", "street", "sidewalk", "crossing")
"""What is simulated: an open place, a wide street, a narrow sidewalk, two crossing flows."""

# All chosen.
_STEP_S = 0.05
_ARRIVED_M = 1.5  # from a goal at which the next one is taken
_IN_VIEW = (18.0, 55.0)  # mean number in view
_SIZES = ([1, 2, 3, 4], [0.62, 0.26, 0.08, 0.04])  # of groups, and their shares
_STOP_RATE = (0.0, 0.02)  # stops per second and pedestrian
_STOP_S = (1.5, 15.0)  # length of a stop
_DRIFT_S = 4.0  # time constant with which the desired direction drifts
_DRIFT_RAD = (0.05, 0.25)  # standard deviation of the desired direction
# Place -> half the edges of the image in x and y (m).
_HALF = {
    "plaza": ((14.0, 28.0), (14.0, 28.0)),
    "street": ((20.0, 35.0), (4.0, 9.0)),
    "sidewalk": ((16.0, 30.0), (1.6, 3.2)),
    "crossing": ((12.0, 24.0), (12.0, 24.0)),
}


@dataclass(frozen=True)
class CrowdConfig(SimulationConfig):
    """What is simulated; None is drawn from the seed.

    Attributes:
        frame_rate: frames per second (Hz).
        warm_up_s: simulated time before the first frame (s).
        place: one of ``PLACES``.
        in_view: mean number of pedestrians in view, about.
        bicycle_share: share of bicycles, 0 to 0.5; none on a sidewalk by default.
    """

    frame_rate: float = option(10.0, low=1.0, high=LARGEST_FRAME_RATE)
    warm_up_s: float = 40.0
    place: str | None = option(None, choices=PLACES)
    in_view: float | None = option(None, above=0.0, high=300.0)
    bicycle_share: float | None = option(None, low=0.0, high=0.5)


def simulate_crowd(config: CrowdConfig, name: str = "00") -> Recording:
    """Return one recording of pedestrians.

    Raises:
        SimulationError: no pedestrian came into view.
    """
    generator = np.random.default_rng(config.seed)
    place = config.place or str(generator.choice(PLACES, p=[0.35, 0.25, 0.2, 0.2]))
    half = np.array([between(generator, *limits) for limits in _HALF[place]])
    bicycles = config.bicycle_share
    if bicycles is None:
        bicycles = 0.0 if place == "sidewalk" else between(generator, 0.0, 0.06)
    visits = _draw_visits(generator, config, place, half, bicycles)
    types, _ = draw_varied_types(generator, {"pedestrian": 1.0})
    cyclists, _ = draw_varied_types(generator, {"bicycle": 1.0})
    seen = _walk(generator, config, place, half, visits, types, cyclists)
    turn = between(generator, -np.pi, np.pi)
    seen = _turned(seen, turn)
    # The upright image around the turned place.
    reach = np.abs(half[0] * np.array([np.cos(turn), np.sin(turn)]))
    reach += np.abs(half[1] * np.array([np.sin(turn), np.cos(turn)]))
    view = box_view((0.0, 0.0), (float(reach[0]), float(reach[1])))
    return make_recording(seen, [*types, *cyclists], view, config, name=name, layout="ind")


@dataclass
class _Visit:
    """One pedestrian or cyclist, from an entrance over goals to an exit.

    Attributes:
        time_s: time of entry (s).
        group: number of the group.
        speed_mps: desired speed (m/s).
        points: entrance, goals and exit, each [2] (m).
        bicycle: whether it is a cyclist.
    """

    time_s: float
    group: int
    speed_mps: float
    points: list[Float64Array]
    bicycle: bool


def _draw_visits(
    generator: Generator, config: CrowdConfig, place: str, half: Float64Array, bicycles: float
) -> list[_Visit]:
    """Draw who comes when, from where and to where."""
    wanted = config.in_view or between(generator, *_IN_VIEW)
    # A visit takes about the length of the place at 1.2 m/s; groups have 1.5 members.
    rate = wanted / (1.7 * half.max() / 1.2) / 1.5
    flow = between(generator, 0.2, 0.8)  # share of those who go in the positive direction
    end_s = config.warm_up_s + config.seconds + EXTRA_S
    visits: list[_Visit] = []
    time_s, group = 0.0, 0
    while time_s < end_s:
        bicycle = generator.random() < bicycles
        size = 1 if bicycle else int(generator.choice(_SIZES[0], p=_SIZES[1]))
        speed = between(generator, 2.5, 5.5) if bicycle else draw_walking_speed(generator)
        points = _draw_points(generator, place, half, flow)
        for _ in range(size):
            aside = generator.normal(0.0, 0.5, 2) if size > 1 else np.zeros(2)
            own = [np.asarray(point + aside) for point in points]
            visits.append(_Visit(time_s, group, speed, own, bicycle))
        time_s += float(generator.exponential(1.0 / rate))
        group += 1
    return visits


def _draw_points(
    generator: Generator, place: str, half: Float64Array, flow: float
) -> list[Float64Array]:
    """Draw entrance, goals and exit of a group, which are outside the image at both ends."""
    beyond = half + 3.0

    def across(limit: float) -> float:
        return between(generator, -0.85, 0.85) * limit

    def along(axis: int, forward: bool) -> list[Float64Array]:
        ends = (-beyond[axis], beyond[axis]) if forward else (beyond[axis], -beyond[axis])
        points = np.array([[end, across(float(half[1 - axis]))] for end in ends])
        return list(points if axis == 0 else points[:, ::-1])

    if place == "crossing":
        axis = int(generator.integers(2))
        return along(axis, generator.random() < (flow if axis else 1 - flow))
    if place in ("street", "sidewalk"):
        points = along(0, generator.random() < flow)
        if place == "street" and generator.random() < 0.3:
            # Across to a shop on the way.
            shop = np.array([across(float(half[0])), generator.choice([-0.9, 0.9]) * half[1]])
            points.insert(1, shop)
        if generator.random() < 0.08:
            points[-1] = points[0] * np.array([1.0, -1.0])  # turns back
            points.insert(1, np.array([across(float(half[0])), across(float(half[1]))]))
        return points
    # A plaza has entrances all around it.
    first, last = generator.uniform(0.0, 2 * np.pi, 2)
    ring = float(np.hypot(*beyond))
    points = [
        np.clip(ring * np.array([np.cos(a), np.sin(a)]), -beyond, beyond) for a in (first, last)
    ]
    for _ in range(int(generator.choice([0, 1, 2], p=[0.5, 0.35, 0.15]))):
        points.insert(1, generator.uniform(-0.8, 0.8, 2) * half)
    return points


class _Visitors:
    """Visitors who walk from goal to goal, stop for a while and drift off the straight line.

    Args:
        generator: of all random decisions.
        visits: one for each visitor.

    Attributes:
        crowd: positions, velocities and desired velocities of the visitors.
    """

    def __init__(self, generator: Generator, visits: list[_Visit]) -> None:
        count = len(visits)
        self._generator = generator
        self._visits = visits
        self._points = [np.array(visit.points) for visit in visits]
        self._arrive_s = np.array([visit.time_s for visit in visits])
        self._speed = np.array([visit.speed_mps for visit in visits])
        self._goal = np.ones(count, dtype=np.int64)  # index of the point that is walked to
        self._stop_until_s = np.zeros(count)
        self._drift = np.zeros(count)  # of the heading (rad)
        self._drift_rad = between(generator, *_DRIFT_RAD)
        self._stop_rate = between(generator, *_STOP_RATE)
        self.crowd = Crowd(
            position=np.array([visit.points[0] for visit in visits]),
            velocity=np.zeros((count, 2)),
            desired=np.zeros((count, 2)),
            group=np.array([visit.group for visit in visits]),
            present=np.zeros(count, dtype=np.bool_),
        )

    def decide(self, now: float) -> None:
        """Let visitors enter, reach goals, leave and stop, and set the desired velocities."""
        self._enter(now)
        present = np.flatnonzero(self.crowd.present)
        self._reach_goals(present, now)
        self._stop_groups(present, now)
        # An Ornstein-Uhlenbeck process of standard deviation ``drift_rad``.
        noise = self._generator.standard_normal(len(self._visits))
        diffusion = self._drift_rad * np.sqrt(2 * _STEP_S / _DRIFT_S)
        self._drift += -self._drift * _STEP_S / _DRIFT_S + diffusion * noise
        goals = np.array([points[i] for points, i in zip(self._points, self._goal, strict=True)])
        ahead = goals - self.crowd.position
        heading = np.arctan2(ahead[:, 1], ahead[:, 0]) + self._drift
        speed = np.where(self._stop_until_s > now, 0.0, self._speed)
        self.crowd.desired = speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)

    def _enter(self, now: float) -> None:
        entering = ~self.crowd.present & (self._arrive_s <= now) & (self._arrive_s > now - _STEP_S)
        self.crowd.present |= entering
        new = np.flatnonzero(entering)
        towards = np.array([self._points[i][1] - self._points[i][0] for i in new]).reshape(-1, 2)
        self.crowd.velocity[new] = _unit(towards) * self._speed[new, None]

    def _reach_goals(self, present: IndexArray, now: float) -> None:
        """Turn those at their goal to the next one; who has reached the last one leaves."""
        for i in present:
            if np.hypot(*(self._points[i][self._goal[i]] - self.crowd.position[i])) >= _ARRIVED_M:
                continue
            self._goal[i] += 1
            if self._goal[i] == len(self._points[i]):
                self.crowd.present[i] = False
                self._goal[i] -= 1
            elif not self._visits[i].bicycle and self._generator.random() < 0.5:
                self._stop_until_s[i] = now + between(self._generator, *_STOP_S)

    def _stop_groups(self, present: IndexArray, now: float) -> None:
        """Let some pedestrians stop, each together with its group."""
        group = self.crowd.group[present]
        stops = self._generator.random(len(present)) < self._stop_rate * _STEP_S
        for number in np.unique(group[stops]):
            members = present[group == number]
            if not self._visits[int(members[0])].bicycle:
                self._stop_until_s[members] = now + between(self._generator, *_STOP_S)


def _walk(
    generator: Generator,
    config: CrowdConfig,
    place: str,
    half: Float64Array,
    visits: list[_Visit],
    types: list[VehicleType],
    cyclists: list[VehicleType],
) -> FloatingCarData:
    """Simulate the visits and return them at the frame rate."""
    forces = SocialForceConfig(
        relaxation_s=between(generator, 0.4, 0.9),
        repulsion_mps2=between(generator, 1.5, 3.5),
        repulsion_m=between(generator, 0.3, 0.6),
        horizon_s=between(generator, 0.4, 1.2),
    )
    walls = float(half[1]) if place in ("street", "sidewalk") else np.inf
    visitors = _Visitors(generator, visits)
    crowd = visitors.crowd
    steps = round((config.warm_up_s + config.seconds + EXTRA_S) / _STEP_S)
    times, rows, positions, velocities = [], [], [], []
    for step in range(steps + 1):
        now = step * _STEP_S
        visitors.decide(now)
        if now >= config.warm_up_s - EXTRA_S:
            present = np.flatnonzero(crowd.present)
            times.append(np.full(len(present), now - config.warm_up_s))
            rows.append(present)
            positions.append(crowd.position[present].copy())
            velocities.append(crowd.velocity[present].copy())
        crowd.step(_STEP_S, forces, walls)
    kinds = [
        (cyclists if visit.bicycle else types)[i % len(cyclists if visit.bicycle else types)].name
        for i, visit in enumerate(visits)
    ]
    return _at_frames(
        config,
        np.concatenate(times),
        np.concatenate(rows),
        np.concatenate(positions),
        np.concatenate(velocities),
        kinds,
    )


def _unit(vectors: Float64Array) -> Float64Array:
    """Return [n, 2] vectors scaled to length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)


def _at_frames(
    config: CrowdConfig,
    time: Float64Array,
    visitor: np.ndarray,
    position: Float64Array,
    velocity: Float64Array,
    kinds: list[str],
) -> FloatingCarData:
    """Return the rows at the frame rate, interpolated between the steps."""
    order = np.lexsort((time, visitor))
    time, visitor = time[order], visitor[order]
    values = np.concatenate([position, velocity], axis=1)[order]
    bounds = np.flatnonzero(np.diff(visitor, prepend=-1, append=-1))
    pieces = []
    for start, end in itertools.pairwise(bounds):
        rate = config.frame_rate
        frames = np.arange(
            np.ceil(time[start] * rate - 1e-6), np.floor(time[end - 1] * rate + 1e-6) + 1
        )
        at = [np.interp(frames / rate, time[start:end], v) for v in values[start:end].T]
        pieces.append(np.column_stack([np.full(len(frames), visitor[start]), frames, *at]))
    rows = np.concatenate(pieces)
    return FloatingCarData(
        vehicle=rows[:, 0].astype(np.int64),
        step=rows[:, 1].astype(np.int64),
        front=rows[:, 2:4],
        speed=np.hypot(rows[:, 4], rows[:, 5]),
        heading=np.arctan2(rows[:, 5], rows[:, 4]),
        names=[str(i) for i in range(len(kinds))],
        types=kinds,
    )


def _turned(seen: FloatingCarData, angle: float) -> FloatingCarData:
    """Return the data turned around the origin (rad)."""
    cos, sin = np.cos(angle), np.sin(angle)
    front = seen.front @ np.array([[cos, sin], [-sin, cos]])
    return FloatingCarData(
        seen.vehicle, seen.step, front, seen.speed, seen.heading + angle, seen.names, seen.types
    )
