# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The recording of vehicles that drive straight on through the image."""

from __future__ import annotations

import numpy as np
import pytest

from mtpgo_core.schema import AgentClass
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.simulation_config import SimulationConfig
from mtpgo_training.simulate.sumo import FloatingCarData, SimulationError, VehicleType

TYPES = [VehicleType("t0", "truck", 10.0, 2.5, {}), VehicleType("c0", "car", 4.0, 1.8, {})]
CONFIG = SimulationConfig(seconds=2.0, frame_rate=10.0)


def seen(*starts_m: float) -> FloatingCarData:
    """Return vehicles at 10 m/s along x, from 1 s before the recording to 1 s after it.

    Args:
        starts_m: front of each when the recording begins (m); every second one is a car.
    """
    step = np.tile(np.arange(-10, 31), len(starts_m))
    vehicle = np.repeat(np.arange(len(starts_m)), 41)
    front = np.stack([np.array(starts_m)[vehicle] + step, 4.0 * vehicle], axis=1)
    return FloatingCarData(
        vehicle=vehicle,
        step=step,
        front=front.astype(float),
        speed=np.full(len(step), 10.0),
        heading=np.full(len(step), 2.0 * np.pi),
        names=[f"v{i}" for i in range(len(starts_m))],
        types=["t0" if i % 2 == 0 else "c0" for i in range(len(starts_m))],
    )


def film(data: FloatingCarData, layout: str = "ind", right_m: float = 1000.0):
    return make_recording(
        data,
        TYPES,
        lambda centre, size: (centre[:, 0] >= 0.0) & (centre[:, 0] <= right_m),
        CONFIG,
        name="00",
        layout=layout,
    )


@pytest.mark.parametrize(("layout", "first"), [("ind", 0), ("highd", 1)])
def test_frames_and_tracks_begin_with_the_first_number_of_the_layout(layout, first) -> None:
    recording = film(seen(100.0, 200.0), layout)
    assert recording.frames.tolist() == list(range(first, first + 20))
    assert recording.track_id.tolist() == [first, first + 1]


def test_no_row_at_a_frame_is_no_vehicle_in_view() -> None:
    """As of a frame rate so low that SUMO has no step at a frame."""
    data = seen()
    assert not len(data.vehicle)
    with pytest.raises(SimulationError, match="no vehicle came into view"):
        make_recording(
            data,
            TYPES,
            lambda centre, size: centre[:, 0] > size.max(),
            CONFIG,
            name="00",
            layout="ind",
        )


def test_vehicles_are_numbered_in_the_order_in_which_they_appear() -> None:
    # The truck v0 comes into view later than the car v1, v2 never does.
    recording = film(seen(-5.0, 0.0, -900.0))
    assert recording.agent_class.tolist() == [AgentClass.CAR, AgentClass.TRUCK]
    np.testing.assert_allclose(recording.size, [[4.0, 1.8], [10.0, 2.5]])
    first = [recording.frame[recording.track == index].min() for index in (0, 1)]
    # Centres are half a length behind the front: at 1 m a frame, 2 m and 10 m are missing.
    assert abs(first[0] - 2) <= 1
    assert abs(first[1] - 10) <= 1
    # By frame, then by track.
    assert np.lexsort((recording.track, recording.frame)).tolist() == list(range(len(recording)))


def test_headings_lie_above_minus_pi_and_up_to_pi() -> None:
    recording = film(seen(100.0))
    np.testing.assert_allclose(recording.yaw, 0.0, atol=0.05)  # 2 pi in the simulation
    turned = seen(100.0)
    turned.front[:, 0] *= -1.0
    turned.front[:, 0] += 400.0
    turned.heading[:] = -np.pi
    back = film(turned)
    assert (np.abs(np.abs(back.yaw) - np.pi) < 0.05).all()
    assert ((back.yaw > -np.pi) & (back.yaw <= np.pi)).all()


def test_no_vehicle_in_view_is_an_error() -> None:
    with pytest.raises(SimulationError, match="no vehicle came into view"):
        film(seen(100.0), right_m=50.0)
