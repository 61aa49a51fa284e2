# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Input and output of Eclipse SUMO's programs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from simulated_traffic import needs_sumo

from mtpgo_training.simulate import sumo
from mtpgo_training.simulate.simulation_config import SimulationConfig

HEAD = "timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_speed;vehicle_type\n"


def load(path: Path, rows: list[str], *, frame_rate: float, step_s: float) -> sumo.FloatingCarData:
    """Write SUMO's output after a warm-up of 10 s and read it."""
    path.write_text(HEAD + "".join(row + "\n" for row in rows))
    return sumo._load(path, 10.0, frame_rate, step_s)


def test_a_vehicle_type_is_one_xml_element() -> None:
    kind = sumo.VehicleType("car0", "car", 4.567, 1.8, {"vClass": "passenger", "tau": "1.00"})
    assert kind.xml() == (
        '<vType id="car0" length="4.57" width="1.80" vClass="passenger" tau="1.00"/>'
    )


def test_rows_are_sorted_by_vehicle_and_time_counts_from_the_end_of_the_warm_up(tmp_path) -> None:
    rows = ["9.9;b;1;2;90;5;truck0", "10.0;b;1.5;2;90;5;truck0", "10.0;a;7;8;0;6;car1"]
    rows.append("10.1;b;2;2;90;5;truck0")
    seen = load(tmp_path / "seen.csv", rows, frame_rate=10.0, step_s=0.1)
    assert (seen.names, seen.types) == (["b", "a"], ["truck0", "car1"])
    assert seen.vehicle.tolist() == [0, 0, 0, 1]
    assert seen.step.tolist() == [-1, 0, 1, 0]
    np.testing.assert_allclose(seen.front, [[1, 2], [1.5, 2], [2, 2], [7, 8]])
    np.testing.assert_allclose(seen.speed, [5, 5, 5, 6])


def test_a_compass_bearing_becomes_a_heading(tmp_path) -> None:
    bearings = [0, 90, 180, 270]  # north, east, south, west
    rows = [f"{10 + k}.0;a;0;0;{bearing};1;car0" for k, bearing in enumerate(bearings)]
    seen = load(tmp_path / "seen.csv", rows, frame_rate=1.0, step_s=1.0)
    expected = [math.pi / 2, 0.0, -math.pi / 2, -math.pi]
    np.testing.assert_allclose(seen.heading, expected, atol=1e-12)


def test_only_the_simulation_steps_nearest_to_frames_are_kept(tmp_path) -> None:
    # At 30 Hz frames are at 0, 33.3 and 66.7 ms; SUMO's steps of 17 ms are at 34 and 68 ms.
    times = [10.0, 10.017, 10.034, 10.051, 10.068]
    rows = [f"{time};a;{k};0;90;1;car0" for k, time in enumerate(times)]
    seen = load(tmp_path / "seen.csv", rows, frame_rate=30.0, step_s=0.017)
    assert seen.step.tolist() == [0, 1, 2]
    assert seen.front[:, 0].tolist() == [0, 2, 4]


def test_no_vehicle_at_all_is_an_error(tmp_path) -> None:
    path = tmp_path / "seen.csv"
    for text in ("timestep_time\n10.0\n", HEAD + "10.0;;;;;;\n"):
        path.write_text(text)
        with pytest.raises(sumo.SimulationError, match="the simulation saw no vehicle"):
            sumo._load(path, 10.0, 10.0, 0.1)


def test_an_installation_named_by_sumo_home_comes_first(tmp_path, monkeypatch) -> None:
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "sumo").write_text("")
    monkeypatch.setenv("SUMO_HOME", str(tmp_path))
    assert sumo.program("sumo") == tmp_path / "bin" / "sumo"


@needs_sumo
def test_an_error_of_sumo_is_passed_on() -> None:
    network = sumo.RoadNetwork(['<node id="a" x="0" y="0"/>'], ['<edge id="e" from="a" to="b"/>'])
    with pytest.raises(sumo.SimulationError, match=r"SUMO's netconvert failed: Error.*'b'"):
        sumo.run_simulation(network, [], [], SimulationConfig())
