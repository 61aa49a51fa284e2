# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Origins of sites found in traffic whose centre is known."""

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.recording import Recording
from mtpgo_training.scenes.site_origins import find_origin

RATE = 10.0


def recording_of(paths):
    """A recording of road users on [n, 2] positions, one each frame."""
    tracks, frames, places, speeds = [], [], [], []
    for number, path in enumerate(paths):
        velocity = np.gradient(path, axis=0) * RATE
        tracks += [number] * len(path)
        frames += list(range(len(path)))
        places.append(path)
        speeds.append(velocity)
    order = np.lexsort((tracks, frames))
    velocity = np.concatenate(speeds)[order]
    rows, count = len(order), len(paths)
    return Recording(
        name="01",
        layout="ind",
        location="3",
        frame_rate=RATE,
        frame=np.array(frames)[order],
        track=np.array(tracks)[order],
        position=np.concatenate(places)[order],
        velocity=velocity,
        acceleration=np.zeros((rows, 2)),
        yaw=np.arctan2(velocity[:, 1], velocity[:, 0]),
        track_id=np.arange(count),
        agent_class=np.full(count, AgentClass.CAR, dtype=np.uint8),
        size=np.full((count, 2), 2.0),
    )


def along(corners, step=0.6):
    """Points every ``step`` along a polyline (m)."""
    corners = np.asarray(corners, dtype=float)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    where = np.arange(0.0, length[-1], step)
    return np.stack([np.interp(where, length, corners[:, i]) for i in (0, 1)], axis=1)


def around(centre, radius, entry, leave):
    """In from the right, counter-clockwise around, out to the right."""
    angle = np.linspace(entry, leave, 60)
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    first, last = ring[0], ring[-1]
    out = np.array([np.sin(leave), -np.cos(leave)])
    into = np.array([np.sin(entry), -np.cos(entry)])
    start = first + 40.0 * first / radius + 10.0 * into
    end = last + 40.0 * last / radius - 10.0 * out
    return along(np.concatenate([start[None], ring, end[None]])) + centre


def test_a_junction_is_where_its_roads_meet():
    centre = np.array([41.0, -17.0])
    roads = []
    for side in (-1.75, 1.75):  # a lane for each direction on both roads
        for bearing in (0.3, 0.3 + 1.4):
            d = np.array([np.cos(bearing), np.sin(bearing)])
            n = np.array([-d[1], d[0]])
            ends = [centre - 40 * d + side * n, centre + 40 * d + side * n]
            roads.append(along(ends if side < 0 else ends[::-1]))
    origin = find_origin([recording_of(roads)], "junction")
    np.testing.assert_allclose(origin, centre, atol=0.3)


def test_a_roundabout_is_what_its_traffic_drives_around():
    centre = np.array([-5.0, 80.0])
    paths = [around(centre, r, a, a + b) for r, a, b in ((14, 0, 3.1), (16, 1.6, 1.7), (14, 4, 4))]
    origin = find_origin([recording_of(paths)], "roundabout")
    np.testing.assert_allclose(origin, centre, atol=0.5)


def test_parallel_traffic_has_no_origin():
    lanes = [along([[0, y], [100, y]]) for y in (0.0, 4.0)]
    for kind in ("junction", "roundabout"):
        with pytest.raises(ConfigurationError, match="no origin is found for the site '3'"):
            find_origin([recording_of(lanes)], kind)
