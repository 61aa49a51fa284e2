# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Configurations of the simulated sites, and the recordings written of one."""

from __future__ import annotations

from pathlib import Path

import pytest
from simulated_traffic import needs_sumo

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.simulate.roundabout import RoundaboutConfig
from mtpgo_training.simulate.simulation_config import SITE_NAMES
from mtpgo_training.simulate.sites import SITES, site_config, write_recordings
from mtpgo_training.simulate.street import StreetConfig


def test_every_site_has_its_name() -> None:
    assert tuple(SITES) == SITE_NAMES


def test_options_without_a_value_are_ignored_where_the_site_does_not_have_them() -> None:
    options = {"seconds": 5.0, "traffic": None, "speed_limit_mps": None, "lanes": None}
    assert site_config("roundabout", options) == RoundaboutConfig(seconds=5.0)
    options["speed_limit_mps"] = 11.0
    assert site_config("street", options) == StreetConfig(seconds=5.0, speed_limit_mps=11.0)


def test_an_option_of_another_site_is_named_as_on_the_command_line() -> None:
    with pytest.raises(ConfigurationError, match=r"^--speed-limit is given for a roundabout"):
        site_config("roundabout", {"speed_limit_mps": 11.0})


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"frame_rate": 0.001}, "frame_rate is 0.001, expected 1 to 1000"),
        ({"frame_rate": 1e9}, r"frame_rate is 1000000000\.0, expected 1 to 1000"),
        ({"vehicles_per_hour": 1e9}, "vehicles_per_hour is .*, expected more than 0"),
    ],
)
def test_what_cannot_be_simulated_is_refused(options, sentence) -> None:
    for site in ("roundabout", "curves"):
        with pytest.raises(ConfigurationError, match=sentence):
            site_config(site, options)


@needs_sumo
def test_recordings_have_consecutive_numbers_and_seeds(tmp_path: Path) -> None:
    config = RoundaboutConfig(
        seconds=1.0, frame_rate=10.0, warm_up_s=20.0, seed=7, lanes=1, vehicles_per_hour=1800.0
    )
    written = list(write_recordings("roundabout", config, 2, tmp_path))
    assert [(one.recording.name, one.seed) for one in written] == [("00", 7), ("01", 8)]
    back = load_recordings(tmp_path, "ind")
    assert [recording.name for recording in back] == ["00", "01"]
    assert [len(recording) for recording in back] == [len(one.recording) for one in written]
    assert back[0].position.tolist() != back[1].position.tolist()
