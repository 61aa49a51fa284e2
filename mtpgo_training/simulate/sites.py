# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The simulated sites by name, and the recordings that are made of one."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.writers.highd_writer import write_highd
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.simulate.drone_camera import FIRST_NUMBER
from mtpgo_training.simulate.highway import HighwayConfig, simulate_highway
from mtpgo_training.simulate.roundabout import RoundaboutConfig, simulate_roundabout
from mtpgo_training.simulate.simulation_config import SimulationConfig
from mtpgo_training.simulate.street import StreetConfig, simulate_street
from mtpgo_training.simulate.varied.crowd import CrowdConfig, simulate_crowd
from mtpgo_training.simulate.varied.curves import CurvesConfig, simulate_curves
from mtpgo_training.simulate.varied.junctions import JunctionsConfig, simulate_junctions
from mtpgo_training.simulate.varied.ramps import RampsConfig, simulate_ramps
from mtpgo_training.simulate.varied.roundabouts import RoundaboutsConfig, simulate_roundabouts
from mtpgo_training.simulate.varied.scenario import ScenarioConfig, simulate_scenario

WRITERS: dict[str, Callable[[Recording, Path], list[Path]]] = {
    "highd": write_highd,
    "ind": write_ind,
}
"""Layout -> function that writes a recording into a directory."""


@dataclass(frozen=True)
class Site:
    """A site that can be simulated.

    Attributes:
        config: class of its configuration.
        simulate: configuration and name -> recording.
        layout: layout in which its recordings are written.
    """

    config: type[SimulationConfig]
    simulate: Callable[[Any, str], Recording]
    layout: str


SITES = {
    "highway": Site(HighwayConfig, simulate_highway, "highd"),
    "roundabout": Site(RoundaboutConfig, simulate_roundabout, "ind"),
    "street": Site(StreetConfig, simulate_street, "ind"),
    "curves": Site(CurvesConfig, simulate_curves, "ind"),
    "ramps": Site(RampsConfig, simulate_ramps, "ind"),
    "junctions": Site(JunctionsConfig, simulate_junctions, "ind"),
    "roundabouts": Site(RoundaboutsConfig, simulate_roundabouts, "ind"),
    "crowd": Site(CrowdConfig, simulate_crowd, "ind"),
    "scenario": Site(ScenarioConfig, simulate_scenario, "ind"),
}
"""Name in ``SITE_NAMES`` -> site."""


@dataclass(frozen=True)
class SimulatedRecording:
    """A recording that was written.

    Attributes:
        recording: the recording.
        seed: seed of its simulation.
        took_s: time that simulating and writing it took (s).
    """

    recording: Recording
    seed: int
    took_s: float


def site_config(site: str, options: Mapping[str, Any]) -> SimulationConfig:
    """Return the configuration of a site.

    Args:
        site: name in ``SITES``.
        options: field -> value; None means the default, which for most is drawn from the seed,
            and is allowed for fields that the site does not have.

    Raises:
        ConfigurationError: a value is out of range, or the site does not have the field.
    """
    config = SITES[site].config
    fields = {field.name for field in dataclasses.fields(config)}
    for name, value in options.items():
        if name not in fields and value is not None:
            option = name.removesuffix("_mps").replace("_", "-")
            raise ConfigurationError(
                f"--{option} is given for a {site}, which has no such option: see mtpgo simulate "
                "--help"
            )
    return config(**{name: value for name, value in options.items() if value is not None})


def require_new(site: str, count: int, output: Path) -> None:
    """Check that recordings can be written without replacing others.

    Args:
        site: name in ``SITES``.
        count: number of recordings.
        output: directory to write to, may be missing.

    Raises:
        ConfigurationError: it has a file of a recording that would be written.
    """
    names = _names(site, count)
    found = sorted(path.name for name in names for path in output.glob(f"{name}_*"))
    if found:
        more = f" and {len(found) - 1} more of them" if len(found) > 1 else ""
        raise ConfigurationError(
            f"{output} has the file {found[0]}{more}, which the recordings to be written would "
            "replace, expected another directory, or --overwrite"
        )


def _names(site: str, count: int) -> list[str]:
    """Return the names of the recordings of one call."""
    first = FIRST_NUMBER[SITES[site].layout]
    return [f"{number:02d}" for number in range(first, first + count)]


def write_recordings(
    site: str, config: SimulationConfig, count: int, output: Path
) -> Iterator[SimulatedRecording]:
    """Simulate and write recordings, one each time the next is asked for; replace earlier ones.

    Args:
        site: name in ``SITES``.
        config: configuration of the first recording; each further one has the next seed.
        count: number of recordings.
        output: directory to write to.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    simulate, layout = SITES[site].simulate, SITES[site].layout
    for number, name in enumerate(_names(site, count)):
        begin = time.monotonic()
        numbered = dataclasses.replace(config, seed=config.seed + number)
        recording = simulate(numbered, name)
        WRITERS[layout](recording, output)
        yield SimulatedRecording(recording, numbered.seed, time.monotonic() - begin)
