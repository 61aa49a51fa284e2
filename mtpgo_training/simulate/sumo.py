# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs Eclipse SUMO's programs: ``netconvert`` builds the network, ``sumo`` simulates the traffic.

The programs come with the package ``eclipse-sumo`` (extra ``simulation``) or from an installation
that ``SUMO_HOME`` or ``PATH`` points to.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.errors import MtpgoError
from mtpgo_core.processes.parent_process import ending_with_this_process
from mtpgo_core.schema import Float64Array
from mtpgo_training.simulate.motion_config import MotionConfig
from mtpgo_training.simulate.network_lanes import network_lanes
from mtpgo_training.simulate.simulation_config import SimulationConfig

EXTRA_S = 1.5
"""Observed time before and after the recording (s), so that smoothing has no edges in it. Chosen:
five standard deviations of the smoothing, ``MotionConfig.smoothing_s``."""


class SimulationError(MtpgoError):
    """SUMO is not installed or fails."""


@dataclass(frozen=True)
class VehicleType:
    """One type of vehicle and driver.

    Attributes:
        name: identifier, unique in a simulation.
        label: class as in the data sets (car, van, truck, bus, bicycle, motorcycle, pedestrian).
        length: length of the vehicle (m).
        width: width of the vehicle (m).
        attributes: further attributes of SUMO's ``vType``.
        motion: how its path is smoothed and wanders.
    """

    name: str
    label: str
    length: float
    width: float
    attributes: dict[str, str]
    motion: MotionConfig = field(default_factory=MotionConfig)

    def xml(self) -> str:
        """Return the ``vType`` element."""
        extra = " ".join(f'{key}="{value}"' for key, value in self.attributes.items())
        box = f'length="{self.length:.2f}" width="{self.width:.2f}"'
        return f'<vType id="{self.name}" {box} {extra}/>'


@dataclass(frozen=True)
class RoadNetwork:
    """A road network as the input of ``netconvert``.

    Attributes:
        nodes: XML elements of the nodes.
        edges: XML elements of the edges.
        connections: XML elements of the connections; all that fit the lanes by default.
        options: further arguments of ``netconvert``.
    """

    nodes: Sequence[str]
    edges: Sequence[str]
    connections: Sequence[str] = ()
    options: Sequence[str] = ()


@dataclass(frozen=True)
class FloatingCarData:
    """Output of SUMO, rows sorted by vehicle and time.

    Attributes:
        vehicle: [rows] index into ``names``.
        step: [rows] frame number at the recording's frame rate, 0 at the end of the warm-up;
            includes ``EXTRA_S`` before and after the recording.
        front: [rows, 2] middle of the front bumper, x east, y north (m).
        speed: [rows] speed (m/s).
        heading: [rows] heading, counter-clockwise from x (rad).
        names: [vehicles] SUMO's names.
        types: [vehicles] names of their types.
        lanes: edges of the lanes, [k, 2] each (m), along the direction of travel.
    """

    vehicle: np.ndarray
    step: np.ndarray
    front: Float64Array
    speed: Float64Array
    heading: Float64Array
    names: list[str]
    types: list[str]
    lanes: tuple[Float64Array, ...] = ()


def program(name: str) -> Path:
    """Return the path of one of SUMO's programs.

    Raises:
        SimulationError: it is not installed.
    """
    homes = [Path(os.environ["SUMO_HOME"])] if os.environ.get("SUMO_HOME") else []
    spec = importlib.util.find_spec("sumo")
    homes += [Path(place) for place in (spec.submodule_search_locations if spec else None) or ()]
    for home in homes:
        for candidate in (home / "bin" / name, home / "bin" / f"{name}.exe"):
            if candidate.is_file():
                return candidate
    found = shutil.which(name)
    if found is None:
        raise SimulationError(
            f"Eclipse SUMO's program {name!r} was not found: install the extra 'simulation' "
            "(pip install 'mtpgo_ros[simulation]', or pip install eclipse-sumo)"
        )
    return Path(found)


def run_simulation(
    network: RoadNetwork,
    types: Iterable[VehicleType],
    demand: Iterable[str],
    config: SimulationConfig,
    *,
    observed_edges: Sequence[str] = (),
    additional: Iterable[str] = (),
) -> FloatingCarData:
    """Simulate and return the vehicles on the observed edges after the warm-up.

    Args:
        network: road network.
        types: vehicle types.
        demand: XML elements of the routes and vehicles, or of the trips.
        config: times, with a warm-up of at least ``EXTRA_S``, frame rate, and seed of SUMO's
            random numbers.
        observed_edges: edges whose vehicles are returned, all edges by default.
        additional: XML elements of the additional file, such as speed signs.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    with tempfile.TemporaryDirectory(prefix="mtpgo_sumo_") as name:
        folder = Path(name)
        _build_network(network, folder)
        _write_xml(folder / "traffic.rou.xml", "routes", [*(t.xml() for t in types), *demand])
        _write_xml(folder / "signs.add.xml", "additional", additional)
        seen = _simulate(folder, config, observed_edges)
        return dataclasses.replace(seen, lanes=network_lanes(folder / "road.net.xml"))


def _build_network(network: RoadNetwork, folder: Path) -> None:
    _write_xml(folder / "plain.nod.xml", "nodes", network.nodes)
    _write_xml(folder / "plain.edg.xml", "edges", network.edges)
    _write_xml(folder / "plain.con.xml", "connections", network.connections)
    _run(
        "netconvert",
        *("--node-files", folder / "plain.nod.xml"),
        *("--edge-files", folder / "plain.edg.xml"),
        *("--connection-files", folder / "plain.con.xml"),
        *("--output-file", folder / "road.net.xml"),
        *("--precision", "4"),
        *("--junctions.internal-link-detail", "20"),
        "--no-turnarounds",
        "--offset.disable-normalization",
        *network.options,
    )


def run_scenario(sumocfg: Path, begin_s: float, config: SimulationConfig) -> FloatingCarData:
    """Simulate a configuration of SUMO's and return all road users after the warm-up.

    Args:
        sumocfg: the configuration, with the files that it names.
        begin_s: time at which its simulation begins (s).
        config: times, frame rate, and seed of SUMO's random numbers.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    with tempfile.TemporaryDirectory(prefix="mtpgo_sumo_") as name:
        arguments = ("--configuration-file", sumocfg, "--begin", f"{begin_s:g}")
        return _observe(arguments, Path(name), config, begin_s + config.warm_up_s)


def _simulate(
    folder: Path, config: SimulationConfig, observed_edges: Sequence[str]
) -> FloatingCarData:
    observed = folder / "observed.txt"
    lines = "".join(f"edge:{edge}\n" for edge in observed_edges)
    observed.write_text(lines, encoding="utf-8")
    arguments = (
        *("--net-file", folder / "road.net.xml"),
        *("--route-files", folder / "traffic.rou.xml"),
        *("--additional-files", folder / "signs.add.xml"),
        *("--lateral-resolution", f"{config.lateral_resolution_m:g}"),
        *(("--fcd-output.filter-edges.input-file", observed) if observed_edges else ()),
        *("--time-to-teleport", "-1"),
        *("--collision.action", "none"),
    )
    return _observe(arguments, folder, config, config.warm_up_s)


def _observe(
    arguments: Sequence[str | Path], folder: Path, config: SimulationConfig, start_s: float
) -> FloatingCarData:
    """Run SUMO and return what it writes around a recording that starts at ``start_s``."""
    seen = folder / "seen.csv"
    frame_rate = config.frame_rate
    steps_per_frame = max(1, math.ceil(1.0 / (frame_rate * config.max_step_s) - 1e-9))
    # SUMO's time step is a multiple of 1 ms; _load selects the steps nearest to the frames.
    step_s = max(1, round(1000.0 / (frame_rate * steps_per_frame))) / 1000.0
    _run(
        "sumo",
        *arguments,
        *("--step-length", f"{step_s:g}"),
        *("--precision", "4"),
        "--step-method.ballistic",
        *("--fcd-output", seen),
        *("--fcd-output.attributes", "x,y,angle,speed,type"),
        *("--device.fcd.begin", f"{start_s - EXTRA_S:.3f}"),
        *("--end", f"{start_s + config.seconds + EXTRA_S:.3f}"),
        *("--seed", str(config.seed)),
        "--no-step-log",
        "--no-warnings",
    )
    return _load(seen, start_s, frame_rate, step_s)


def _load(path: Path, start_s: float, frame_rate: float, step_s: float) -> FloatingCarData:
    table = pd.read_csv(path, sep=";", low_memory=False)
    table.columns = [name.split("_", 1)[1] for name in table.columns]
    # Without any vehicle the file has no column for them.
    table = table.dropna(subset=["id"]) if "id" in table else table.iloc[:0]
    if table.empty:
        raise SimulationError(
            "the simulation saw no vehicle, expected more traffic or a longer recording"
        )
    time = table["time"].to_numpy(np.float64) - start_s
    frame = np.round(time * frame_rate).astype(np.int64)
    # The simulation steps nearest to the frames.
    kept = np.abs(time - frame / frame_rate) < step_s / 2
    table, frame = table[kept], frame[kept]
    vehicle, names = pd.factorize(table["id"])
    order = np.lexsort((frame, vehicle))
    table, frame, vehicle = table.iloc[order], frame[order], vehicle[order]
    first = np.unique(vehicle, return_index=True)[1]
    return FloatingCarData(
        vehicle=vehicle.astype(np.int64),
        step=frame,
        front=table[["x", "y"]].to_numpy(np.float64),
        speed=table["speed"].to_numpy(np.float64),
        # SUMO's angle is a compass bearing: 0 north, clockwise, degrees.
        heading=np.radians(90.0 - table["angle"].to_numpy(np.float64)),
        names=[str(name) for name in names],
        types=[str(name) for name in table["type"].to_numpy()[first]],
    )


def _write_xml(path: Path, root: str, elements: Iterable[str]) -> None:
    path.write_text("\n".join([f"<{root}>", *elements, f"</{root}>"]) + "\n", encoding="utf-8")


def _run(name: str, *arguments: str | Path) -> None:
    executable = program(name)
    environment = dict(os.environ)
    environment.setdefault("SUMO_HOME", str(executable.parent.parent))
    done = subprocess.run(
        ending_with_this_process([executable, *arguments, "--xml-validation", "never"]),
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    if done.returncode != 0:
        errors = [line for line in done.stderr.splitlines() if line.startswith("Error")]
        raise SimulationError(f"Eclipse SUMO's {name} failed: {' '.join(errors) or done.stderr}")
