# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a scenario of the user's."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from simulated_traffic import needs_sumo

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import AgentClass
from mtpgo_training.simulate import sumo
from mtpgo_training.simulate.varied import scenario
from mtpgo_training.simulate.varied.scenario import ScenarioConfig, simulate_scenario


def write_scenario(folder: Path) -> Path:
    """Write a straight road with two buses that starts at 100 s, and return its configuration."""
    (folder / "a.nod.xml").write_text(
        '<nodes><node id="a" x="0" y="0"/><node id="b" x="900" y="0"/></nodes>'
    )
    (folder / "a.edg.xml").write_text(
        '<edges><edge id="ab" from="a" to="b" numLanes="1" speed="10"/></edges>'
    )
    command = [str(sumo.program("netconvert")), "-n", "a.nod.xml", "-e", "a.edg.xml"]
    subprocess.run(
        [*command, "-o", "a.net.xml", "--offset.disable-normalization"], cwd=folder, check=True
    )
    trips = "".join(
        f'<trip id="{i}" type="k" depart="{100 + 4 * i}" from="ab" to="ab"/>' for i in range(2)
    )
    (folder / "a.rou.xml").write_text(
        f'<routes><vType id="k" vClass="bus" length="11.5"/>{trips}</routes>'
    )
    path = folder / "a.sumocfg"
    path.write_text(
        '<configuration><input><net-file value="a.net.xml"/><route-files value="a.rou.xml"/>'
        '</input><time><begin value="100"/></time></configuration>'
    )
    return path


@needs_sumo
def test_a_busy_place_is_recorded_with_the_classes_of_the_scenario(tmp_path: Path) -> None:
    path = write_scenario(tmp_path)
    recording = simulate_scenario(
        ScenarioConfig(seconds=10.0, warm_up_s=20.0, sumocfg=path, places=1)
    )
    assert recording.agent_class.tolist() == [AgentClass.BUS] * 2
    np.testing.assert_allclose(recording.size, [[11.5, 2.5]] * 2)
    assert 5.0 < np.median(recording.velocity[:, 0]) < 12.0


def test_a_missing_configuration_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="--sumocfg is not given"):
        simulate_scenario(ScenarioConfig())
    with pytest.raises(ConfigurationError, match=r"none\.sumocfg cannot be read"):
        simulate_scenario(ScenarioConfig(sumocfg=tmp_path / "none.sumocfg"))


def test_times_of_the_day_are_read() -> None:
    assert scenario._seconds("25200") == scenario._seconds("7:00:00") == 25200.0
