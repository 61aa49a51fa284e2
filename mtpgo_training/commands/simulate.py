# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo simulate``: simulate traffic with Eclipse SUMO and write it as recordings."""

from __future__ import annotations

import argparse
from pathlib import Path

from mtpgo_core.errors import RecordingError
from mtpgo_training.commands.arguments.argument_types import (
    positive_integer,
    positive_number,
    share,
)
from mtpgo_training.commands.arguments.early_checks import require_folder
from mtpgo_training.simulate.simulation_config import SITE_NAMES, TRAFFIC_STATES


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add ``mtpgo simulate`` to the command line."""
    parser = subparsers.add_parser(
        "simulate",
        help="simulate traffic as recordings (Eclipse SUMO)",
        description="Simulate traffic with Eclipse SUMO (extra 'simulation') and write it as "
        "recordings: a highway in highD layout; a roundabout or a street with traffic lights in "
        "inD layout; curves, ramps, junctions, roundabouts and crowds whose roads are drawn for "
        "every recording, and busy places of your own scenario, in inD layout. Options "
        "that are not given are drawn from the seed, so that recordings differ.",
    )
    add = parser.add_argument
    add("site", choices=SITE_NAMES, help="what is simulated")
    add("-o", "--output", type=Path, required=True, help="directory to write to")
    add("--count", type=positive_integer, default=1, help="number of recordings")
    add(
        "--seconds",
        type=positive_number,
        default=60.0,
        help="length of each (s, default: %(default)g)",
    )
    add("--seed", type=int, default=1, help="seed of the first recording, then counting up")
    add(
        "--frame-rate",
        type=positive_number,
        help="Hz (default: highway, roundabout and street 25; all others 10)",
    )
    add(
        "--vehicles-per-hour",
        type=positive_number,
        help="demand (highway, curves and ramps: per direction; others: in total; not of a crowd)",
    )
    add(
        "--lanes",
        type=int,
        help="lanes (highway: 2 to 4; roundabout and roundabouts: 1 or 2; street and junctions: "
        "1 to 3; curves and ramps: 1 to 4)",
    )
    add("--truck-share", type=share, help="share of trucks, 0 to 0.9")
    add("--traffic", choices=TRAFFIC_STATES, help="highway: traffic state")
    add(
        "--speed-limit",
        type=positive_number,
        help="highway, street, curves and ramps: desired speed (m/s)",
    )
    add("--sumocfg", type=Path, metavar="FILE", help="scenario: configuration of Eclipse SUMO")
    add(
        "--overwrite",
        action="store_true",
        help="replace recordings of an earlier call in the directory",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo simulate``."""
    # Imported late: the sites read SUMO's output with pandas, which --help does not need.
    from mtpgo_training.simulate.sites import require_new, site_config, write_recordings

    options = {
        "seconds": args.seconds,
        "seed": args.seed,
        "frame_rate": args.frame_rate,
        "vehicles_per_hour": args.vehicles_per_hour,
        "lanes": args.lanes,
        "truck_share": args.truck_share,
        "traffic": args.traffic,
        "speed_limit_mps": args.speed_limit,
        "sumocfg": args.sumocfg,
    }
    config = site_config(args.site, options)
    require_folder(args.output)
    if not args.overwrite:
        require_new(args.site, args.count, args.output)
    road_users = 0
    for written in write_recordings(args.site, config, args.count, args.output):
        recording = written.recording
        print(
            f"{args.output}/{recording.name}: {recording.duration_s:.1f} s, "
            f"{len(recording.track_id)} road users, seed {written.seed} "
            f"({recording.duration_s / written.took_s:.1f} times real time)",
            flush=True,
        )
        road_users += len(recording.track_id)
    if not road_users:
        raise RecordingError(
            f"no recording in {args.output} has a road user, expected more --seconds or a larger "
            "--vehicles-per-hour"
        )
    return 0
