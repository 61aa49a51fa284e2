# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Makes a recording of a simulation as a drone would have made it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mtpgo_core.schema import AgentClass, BoolArray, Float64Array
from mtpgo_training.data.recorded_lanes import lines_near
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate.simulation_config import SimulationConfig
from mtpgo_training.simulate.sumo import FloatingCarData, SimulationError, VehicleType
from mtpgo_training.simulate.vehicle_motion import centre_motion

InView = Callable[[Float64Array, Float64Array], BoolArray]
"""[rows, 2] centres and [rows, 2] sizes (m) -> [rows] whether the vehicle is in the image."""


FIRST_NUMBER = {"highd": 1, "ind": 0}
"""Layout -> first number of its recordings, frames and tracks."""


def make_recording(
    seen: FloatingCarData,
    types: Sequence[VehicleType],
    in_view: InView,
    config: SimulationConfig,
    *,
    name: str,
    layout: str,
    lanes: tuple[Float64Array, ...] = (),
) -> Recording:
    """Return the recording of all vehicles in view, numbered in order of appearance.

    Args:
        seen: front bumpers from SUMO.
        types: all vehicle types.
        in_view: which vehicles the image shows.
        config: length, frame rate, and seed of the wander.
        name: name of the recording.
        layout: layout whose numbering it follows.
        lanes: lane markings, each [points, 2] (m); by default those of the network near the
            vehicles in view.

    Raises:
        SimulationError: no vehicle was in view.
    """
    none = SimulationError("no vehicle came into view, expected a longer recording")
    if not len(seen.vehicle):
        raise none
    kinds = {kind.name: kind for kind in types}
    own = [kinds[type_name] for type_name in seen.types]
    size = np.array([[kind.length, kind.width] for kind in own])
    frame_rate, first_number = config.frame_rate, FIRST_NUMBER[layout]
    motions = [kind.motion for kind in own]
    moved = centre_motion(seen, size[:, 0], frame_rate, motions, config.seed)
    vehicle, step = seen.vehicle[moved.rows], seen.step[moved.rows]
    filmed = (step >= 0) & (step < round(config.seconds * frame_rate))
    if len(filmed):  # the size of the largest vehicle counts, and there may be none
        filmed &= in_view(moved.position, size[vehicle])
    rows = np.flatnonzero(filmed)
    if not len(rows):
        raise none
    vehicle, frame = vehicle[rows], step[rows] + first_number
    first = np.full(len(own), np.iinfo(np.int64).max)
    np.minimum.at(first, vehicle, frame)
    present = np.unique(vehicle)
    present = present[np.argsort(first[present], kind="stable")]
    number = np.zeros(len(own), dtype=np.int64)
    number[present] = np.arange(len(present))
    track = number[vehicle]
    order = np.lexsort((track, frame))
    rows = rows[order]
    return Recording(
        name=name,
        layout=layout,
        location="1",
        frame_rate=frame_rate,
        frame=frame[order],
        track=track[order],
        position=moved.position[rows],
        velocity=moved.velocity[rows],
        acceleration=moved.acceleration[rows],
        yaw=np.pi - np.mod(np.pi - moved.yaw[rows], 2 * np.pi),
        track_id=np.arange(len(present)) + first_number,
        agent_class=np.array(
            [AgentClass.from_name(own[i].label) for i in present], dtype=np.uint8
        ),
        size=size[present],
        lanes=lanes or lines_near(seen.lanes, moved.position[rows]),
    )
