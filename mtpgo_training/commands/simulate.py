# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo simulate``: recordings of simulated traffic in a data set's layout, by Eclipse SUMO."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.writers.highd_writer import write_highd
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.simulate.drone_camera import FIRST_NUMBER
from mtpgo_training.simulate.highway import STATES, HighwayConfig, simulate_highway
from mtpgo_training.simulate.roundabout import RoundaboutConfig, simulate_roundabout
from mtpgo_training.simulate.street import StreetConfig, simulate_street


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add ``mtpgo simulate``."""
    parser = subparsers.add_parser(
        "simulate",
        help="recordings of simulated traffic (Eclipse SUMO)",
        description="Simulate traffic with Eclipse SUMO (extra 'simulation') and write it as "
        "recordings: a highway in highD layout, a roundabout or a street with traffic lights in "
        "inD layout. What is not given is drawn from the seed, so that recordings differ.",
    )
    parser.add_argument("site", choices=list(_SITES), help="what is simulated")
    parser.add_argument("-o", "--output", type=Path, required=True, help="directory to write to")
    parser.add_argument("--count", type=_positive_int, default=1, help="number of recordings")
    parser.add_argument(
        "--seconds", type=_positive, default=60.0, help="length of each (s, default: %(default)g)"
    )
    parser.add_argument(
        "--seed", type=int, default=1, help="of the first recording; the next have the next"
    )
    parser.add_argument(
        "--frame-rate", type=_positive, default=25.0, help="Hz (default: %(default)g)"
    )
    parser.add_argument(
        "--vehicles-per-hour",
        type=_positive,
        help="demand (highway: per direction; roundabout and street: in all)",
    )
    parser.add_argument(
        "--lanes", type=int, help="lanes (highway: 2 to 4; roundabout: 1 or 2; street: 1 to 3)"
    )
    parser.add_argument("--truck-share", type=_share, help="part of trucks, 0 to 0.9")
    parser.add_argument("--traffic", choices=STATES, help="highway: traffic state")
    parser.add_argument(
        "--speed-limit", type=_positive, help="highway and street: desired speed (m/s)"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do what the command line asks for."""
    simulate, write, first = _SITES[args.site]
    for number in range(args.count):
        started = time.monotonic()
        recording = simulate(args, args.seed + number, f"{first + number:02d}")
        write(recording, args.output)
        took_s = time.monotonic() - started
        print(
            f"{args.output}/{recording.name}: {recording.duration_s:.1f} s, "
            f"{len(recording.track_id)} road users, seed {args.seed + number} "
            f"({recording.duration_s / took_s:.1f} times real time)"
        )
        sys.stdout.flush()
    return 0


def _highway(args: argparse.Namespace, seed: int, name: str) -> Recording:
    config = HighwayConfig(
        **_common(args, seed), traffic=args.traffic, speed_limit_mps=args.speed_limit
    )
    return simulate_highway(config, name)


def _roundabout(args: argparse.Namespace, seed: int, name: str) -> Recording:
    _without(args, "traffic", "speed_limit")
    return simulate_roundabout(RoundaboutConfig(**_common(args, seed)), name)


def _street(args: argparse.Namespace, seed: int, name: str) -> Recording:
    _without(args, "traffic")
    config = StreetConfig(**_common(args, seed), speed_limit_mps=args.speed_limit)
    return simulate_street(config, name)


def _common(args: argparse.Namespace, seed: int) -> dict[str, Any]:
    """What every site is told, by its names in :class:`SimulationConfig`."""
    return {
        "seconds": args.seconds,
        "seed": seed,
        "frame_rate": args.frame_rate,
        "vehicles_per_hour": args.vehicles_per_hour,
        "lanes": args.lanes,
        "truck_share": args.truck_share,
    }


def _without(args: argparse.Namespace, *options: str) -> None:
    """Refuse options that the site does not have."""
    for option in options:
        if getattr(args, option) is not None:
            raise ConfigurationError(
                f"--{option.replace('_', '-')} is given for a {args.site}, which has no such "
                "option: see mtpgo simulate --help"
            )


_Simulate = Callable[[argparse.Namespace, int, str], Recording]
_Write = Callable[[Recording, Path], list[Path]]

_SITES: dict[str, tuple[_Simulate, _Write, int]] = {
    "highway": (_highway, write_highd, FIRST_NUMBER["highd"]),
    "roundabout": (_roundabout, write_ind, FIRST_NUMBER["ind"]),
    "street": (_street, write_ind, FIRST_NUMBER["ind"]),
}


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above zero")
    return value


def _positive_int(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not above zero")
    return value


def _share(text: str) -> float:
    value = float(text)
    if not 0 <= value <= 0.9:
        raise argparse.ArgumentTypeError(f"{text} is not between 0 and 0.9")
    return value
