# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Road users that drive along given lines, observed at instants."""

import numpy as np

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass, HistoryWindow

DT_S = 0.2
S_NS = 1_000_000_000


def window_at(time_s, ids, position, velocity, *, yaw=None, kind=AgentClass.CAR, frame="map"):
    """A window of one sample, all agents present."""
    position = np.asarray(position, dtype=float).reshape(-1, 2)
    velocity = np.asarray(velocity, dtype=float).reshape(-1, 2)
    n = len(position)
    kinds = np.broadcast_to(np.asarray(kind, dtype=np.uint8), n).copy()
    heading = np.arctan2(velocity[:, 1], velocity[:, 0]) if yaw is None else np.asarray(yaw, float)
    return HistoryWindow(
        stamp_ns=round(time_s * S_NS),
        frame_id=frame,
        key=keys_from_integers(ids),
        agent_class=kinds,
        z=np.zeros(n),
        size=np.full((n, 2), np.nan),
        position=position[:, None],
        velocity=velocity[:, None],
        acceleration=np.zeros((n, 1, 2)),
        yaw=heading[:, None],
        valid=np.ones((n, 1), dtype=bool),
        covariance=np.full((n, 4, 4), np.nan),
    )


def along(line, distance):
    """[..., 2] places and directions at distances along a polyline [k, 2]."""
    line = np.asarray(line, dtype=float)
    step = np.diff(line, axis=0)
    reach = np.append(0.0, np.cumsum(np.hypot(*step.T)))
    place = np.stack([np.interp(distance, reach, line[:, i]) for i in (0, 1)], axis=-1)
    part = np.clip(np.searchsorted(reach, distance, "right") - 1, 0, len(step) - 1)
    return place, step[part] / np.hypot(*step[part].T)[..., None]


def drive(memory, line, *, ident, start_s=0.0, speed=8.0, kind=AgentClass.CAR, aside_m=0.0):
    """Let one road user drive along a line, ``aside_m`` to its left; return its last time (s)."""
    length = np.hypot(*np.diff(np.asarray(line, float), axis=0).T).sum()
    steps = int(length / (speed * DT_S))
    for k in range(steps + 1):
        place, course = along(line, speed * DT_S * k)
        place = place + aside_m * np.array([-course[1], course[0]])
        memory.add(window_at(start_s + DT_S * k, [ident], place, speed * course, kind=kind), DT_S)
    return start_s + DT_S * steps


def bend(turn, *, before=40.0, after=60.0, radius=15.0):
    """A line along +x through the origin, then a quarter turn: 1 left, -1 right, 0 none."""
    angle = np.linspace(0.0, np.pi / 2, 40)
    arc = radius * np.stack([np.sin(angle), turn * (1.0 - np.cos(angle))], axis=1)
    if turn == 0:
        return np.array([[-before, 0.0], [after, 0.0]])
    end = arc[-1] + np.array([0.0, turn * after])
    return np.concatenate([[[-before, 0.0]], arc, [end]])
