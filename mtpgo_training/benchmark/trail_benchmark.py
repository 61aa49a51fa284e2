# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo benchmark trails``: what a full memory of trails costs per cycle, and its size."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.scene.trails.trail_context import TrailContext, trail_features
from mtpgo_core.scene.trails.trail_memory import CAPACITY, TrailMemory
from mtpgo_core.scene.trails.trail_points import IntArray
from mtpgo_core.schema import AgentClass, Float64Array, HistoryWindow
from mtpgo_core.task.task_description import HistoryConfig, TaskDescription
from mtpgo_training.benchmark.measurement.machine import print_heading, table, write_json

ARM_M, LANE_M, CORNER_M = 150.0, 1.75, 10.0
"""Length of each of the four arms, a lane's distance from its middle, and where turns begin and
end (m); chosen: a usual junction."""

SPEED_MPS = 10.0
"""Speed of all vehicles (m/s); chosen."""

SPREAD_M = 0.3
"""Standard deviation of the vehicles' distances from the middle of their lane (m); chosen."""

_FILLING, _USUAL, _USUAL_S = 1024, 64, 120.0
"""Vehicles that fill the memory, in a hundred seconds instead of half an hour, those that drive at
the junction afterwards, and for how long (s); chosen: the most recent trails at each place, which
are the ones that are looked at, are the latter's."""

_STAMP_NS = 10**18
"""Stamp of the first observation (ns). Any time will do."""

_COLUMNS = {
    "agents": "{.agents}",
    "points": "{.points}",
    "features ms": "{.features_ms:.1f}",
    "add ms": "{.add_ms:.1f}",
    "MB": "{.memory_mb:.0f}",
}


@dataclass(frozen=True)
class TrailCost:
    """What the memory of trails costs.

    Attributes:
        agents: road users in the scene.
        points: points in the memory.
        features_ms: processor time of the trail features of all agents, median (ms).
        add_ms: processor time of adding a window, median (ms).
        memory_mb: points and index (10^6 bytes).
    """

    agents: int
    points: int
    features_ms: float
    add_ms: float
    memory_mb: float

    @property
    def cycle_ms(self) -> float:
        """Processor time of both, once a cycle (ms)."""
        return self.features_ms + self.add_ms


class JunctionTraffic:
    """Vehicles that drive straight on, to the left and to the right at a junction of four arms.

    Args:
        vehicles: how many there are at any time; one that leaves is followed by another.
        seed: of their ways and places.
        first: number of the first vehicle.
    """

    def __init__(self, vehicles: int, seed: int, first: int = 0) -> None:
        draw = np.random.default_rng(seed)
        self._ways = [_way(arm, turn) for arm in range(4) for turn in (-1, 0, 1)]
        self._directions = [_directions(way) for way in self._ways]
        self._way = draw.integers(0, len(self._ways), vehicles)
        self._length = np.array([len(way) for way in self._ways], dtype=np.float64)[self._way]
        self._start = draw.uniform(0.0, self._length)
        self._aside = draw.normal(0.0, SPREAD_M, vehicles)
        self._first = first

    def at(self, time_s: float) -> tuple[IntArray, Float64Array, Float64Array, Float64Array]:
        """Return numbers [n], positions [n, 2] (m), velocities [n, 2] (m/s) and yaws [n] (rad)."""
        lap, along = np.divmod(self._start + SPEED_MPS * time_s, self._length)
        number = self._first + np.arange(len(lap)) + len(lap) * lap.astype(np.int64)
        position, ahead = np.empty((2, len(lap), 2))
        for index, (way, direction) in enumerate(zip(self._ways, self._directions, strict=True)):
            rows = np.flatnonzero(self._way == index)
            here = along[rows]
            metre = np.arange(len(way))
            for axis in range(2):
                position[rows, axis] = np.interp(here, metre, way[:, axis])
                ahead[rows, axis] = np.interp(here, metre, direction[:, axis])
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        position += self._aside[:, None] * ahead[:, ::-1] * (-1.0, 1.0)
        return number, position, SPEED_MPS * ahead, np.arctan2(ahead[:, 1], ahead[:, 0])

    def window(self, time_s: float, history: HistoryConfig) -> HistoryWindow:
        """Return the window of all vehicles at a time, without those that came during it."""
        number, *_ = self.at(time_s)
        ages = history.dt_s * np.arange(history.steps)[::-1]
        samples = [self.at(time_s - age) for age in ages]
        valid = np.stack([sample[0] == number for sample in samples], axis=1)
        position: Float64Array = np.stack([sample[1] for sample in samples], axis=1)
        velocity: Float64Array = np.stack([sample[2] for sample in samples], axis=1)
        yaw: Float64Array = np.stack([sample[3] for sample in samples], axis=1)
        missing = ~valid
        position[missing] = velocity[missing] = np.nan
        yaw[missing] = np.nan
        n = len(number)
        return HistoryWindow(
            stamp_ns=_stamp_ns(time_s),
            frame_id="map",
            key=keys_from_integers(number.tolist()),
            agent_class=np.full(n, AgentClass.CAR, dtype=np.uint8),
            z=np.zeros(n),
            size=np.tile([4.5, 1.8], (n, 1)),
            position=position,
            velocity=velocity,
            acceleration=np.zeros_like(velocity),
            yaw=yaw,
            valid=valid,
            covariance=np.full((n, 4, 4), np.nan),
        )


def _way(arm: int, turn: int) -> Float64Array:
    """Return points [k, 2], a metre apart, of a way that enters by an arm (m).

    Args:
        arm: 0 to 3.
        turn: -1 to the right, 0 straight on, 1 to the left.
    """
    entry, out = (_heading(arm), _heading(arm + turn))
    lane_in, lane_out = (LANE_M * np.array([h[1], -h[0]]) for h in (entry, out))
    begin, end = lane_in - ARM_M * entry, lane_out + ARM_M * out
    if turn == 0:
        corners = np.stack([begin, end])
    else:
        part = np.linspace(0.0, 1.0, 50)[:, None]
        before, after = lane_in - CORNER_M * entry, lane_out + CORNER_M * out
        middle = lane_in + lane_out  # where both lanes meet
        bend = (1 - part) ** 2 * before + 2 * part * (1 - part) * middle + part**2 * after
        corners = np.concatenate([begin[None], bend, end[None]])
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(corners, axis=0), axis=1).cumsum()])
    metres = np.arange(0.0, along[-1])
    return np.stack([np.interp(metres, along, corners[:, axis]) for axis in range(2)], axis=1)


def _directions(way: Float64Array) -> Float64Array:
    """Return unit vectors [k, 2] from each point of a way to the next."""
    step = np.diff(way, axis=0, append=2.0 * way[-1:] - way[-2:-1])
    return np.asarray(step / np.linalg.norm(step, axis=1, keepdims=True))


def _heading(arm: int) -> Float64Array:
    angle = 0.5 * np.pi * arm
    return np.array([np.cos(angle), np.sin(angle)])


def _stamp_ns(time_s: float) -> int:
    return _STAMP_NS + round(time_s * 1e9)


def full_memory(capacity: int = CAPACITY, dt_s: float = 0.2) -> tuple[TrailMemory, float]:
    """Return a memory in which the oldest points have been overwritten, and the time then (s).

    Args:
        capacity: points that it holds.
        dt_s: time between two instants (s).
    """
    memory, time_s = TrailMemory(capacity, reserved=True), 0.0
    many = JunctionTraffic(_FILLING, 0)
    while memory.points.oldest == 0:
        _observe(memory, many, time_s)
        time_s += dt_s
    usual = JunctionTraffic(_USUAL, 1, first=10**8)
    for _ in range(round(_USUAL_S / dt_s)):
        _observe(memory, usual, time_s)
        time_s += dt_s
    return memory, time_s


def _observe(memory: TrailMemory, traffic: JunctionTraffic, time_s: float) -> None:
    number, position, velocity, yaw = traffic.at(time_s)
    kinds = np.full(len(number), AgentClass.CAR, dtype=np.uint8)
    key = keys_from_integers(number.tolist())
    memory.add_instant(_stamp_ns(time_s), "map", key, kinds, position, velocity, yaw)


def trail_cost(agents: int, memory: TrailMemory, time_s: float, rounds: int) -> TrailCost:
    """Measure what a memory costs in the cycles after a time.

    Args:
        agents: road users in the scene.
        memory: takes in where they go.
        time_s: time after which it knows nothing (s).
        rounds: cycles.
    """
    task = TaskDescription()
    history, context = task.history, TrailContext(memory, task.horizon_steps, task.history.dt_s)
    traffic = JunctionTraffic(agents, 2, first=10**9)
    add_ms: list[float] = []
    features_ms: list[float] = []
    for cycle in range(rounds + 2):
        window = traffic.window(time_s + cycle * history.dt_s, history)
        add_ms.append(_processor_ms(lambda: memory.add(window, history.dt_s)))  # noqa: B023
        features_ms.append(_processor_ms(lambda: trail_features(window, context)))  # noqa: B023
    return TrailCost(
        agents=agents,
        points=len(memory),
        features_ms=float(np.median(features_ms[2:])),  # the first find cold caches
        add_ms=float(np.median(add_ms[2:])),
        memory_mb=memory.nbytes / 1e6,
    )


def _processor_ms(function: Callable[[], object]) -> float:
    begin_s = time.process_time()
    function()
    return 1e3 * (time.process_time() - begin_s)


def print_trails(
    agents: Sequence[int], rounds: int, command: str, output: Path | None
) -> list[TrailCost]:
    """Measure each size of scene with a full memory, print the table and write it.

    Args:
        agents: road users in the scene.
        rounds: cycles of each.
        command: command that repeats the measurement.
        output: JSON file, or None.

    Raises:
        ConfigurationError: the file cannot be written.
    """
    print_heading(command, output)
    memory, time_s = full_memory()
    rows = []
    for count in agents:
        rows.append(trail_cost(count, memory, time_s, rounds))
        time_s += 0.2 * (rounds + 10)
    print(table(rows, _COLUMNS))
    write_json(output, {"rows": [dataclasses.asdict(row) for row in rows]})
    return rows
