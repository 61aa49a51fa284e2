# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The live calibration: what it is worth on recordings (``--data``), else its processor time.

With recordings each ``--data`` is a site: shares of moving road users in the 90 and 50 % ellipses
at 1, 3 and 5 s, the negative log-likelihood and the displacement errors (ADE, minADE), with the
shipped calibration and with the online one after its first minute, and which of the bars are
missed. Without, observations come at 25 Hz
and predictions at 5 Hz.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time

import numpy as np
import torch

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import ONLINE, PREFERENCES, SHIPPED, LiveOptions
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.model_runner import ModelRunner, find_model
from mtpgo_core.schema import AgentClass, Float64Array, Source, tracked_states
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.commands.arguments.data_arguments import (
    add_cache_arguments,
    add_data_arguments,
    cache_from,
    data_sources,
)
from mtpgo_training.data.data_sources import read_sources
from mtpgo_training.evaluation.calibration_bars import (
    AFTER_S,
    CONSTANT,
    LEAST_AGENTS,
    SiteCalibration,
    measure_calibration,
)
from mtpgo_training.evaluation.training_overlap import is_known
from mtpgo_training.scenes.tracker.tracker_config import OBSERVATIONS, RECORDED, SIMULATED
from mtpgo_training.table_format import Row, Table, to_text

FRAME_HZ, EVERY, WARM_S, MODES, STEPS = 25, 5, 10.0, 8, 25


def measure(agents: int, seconds: float, prefer: str, correct_paths: bool) -> str:
    """Return the shares of a core that observing and serving need, as text."""
    config, rng = HistoryConfig(), np.random.default_rng(0)
    history, live = (
        TrackHistory(config),
        LiveCalibration(LiveOptions(prefer=prefer, correct_paths=correct_paths), config, STEPS),
    )
    key, row = keys_from_integers(range(1, agents + 1)), np.arange(agents)
    observe_s = serve_s = 0.0
    for frame in range(round(seconds * FRAME_HZ)):
        time_s = frame / FRAME_HZ
        position = np.stack([12.0 * row + 10.0 * time_s, 3.5 * (row % 4)], axis=1)
        states = tracked_states(
            10**18 + round(time_s * 1e9),
            "map",
            key,
            position + rng.normal(scale=0.3, size=(agents, 2)),
            agent_class=np.full(agents, AgentClass.CAR, dtype=np.uint8),
            velocity=np.tile([10.0, 0.0], (agents, 1)),
        )
        report = history.update(states)
        start = time.process_time()
        live.observe(history, report)
        middle = time.process_time()
        observe_s += (middle - start) * (time_s >= WARM_S)
        if frame % EVERY:
            continue
        window = history.window()
        constant = predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2, modes=MODES)
        source = np.full(agents, Source.MODEL, dtype=np.uint8)
        start = time.process_time()
        live.serve(dataclasses.replace(constant, source=source), window)
        serve_s += (time.process_time() - start) * (time_s >= WARM_S)
    measured_s = seconds - WARM_S
    cycle_ms = 1e3 * serve_s * EVERY / (measured_s * FRAME_HZ)
    return (
        f"{agents} road users, prefer {prefer}: observing {100 * observe_s / measured_s:.1f} % of"
        f" a core, serving {100 * serve_s / measured_s:.1f} % ({cycle_ms:.2f} ms a prediction)"
    )


def share_text(shares: Float64Array) -> str:
    """Return shares without the zero before the point."""
    return " ".join(f"{share:.3f}".removeprefix("0") for share in shares)


def site_row(name: str, seen: int, found: SiteCalibration) -> Row:
    """Return the row of a site."""
    shares = [
        share_text(found.shares(calibration, level))
        for level in (0.9, 0.5)
        for calibration in (SHIPPED, ONLINE)
    ]
    means = [
        f"{mean(calibration):.3f}"
        for mean in (found.nll, found.ade, found.min_ade)
        for calibration in (SHIPPED, ONLINE)
    ]
    means.append(f"{found.ade(CONSTANT):.3f}")
    if found.agents < LEAST_AGENTS:
        verdict = "too few"
    else:
        verdict = f"misses {len(found.misses)}" if found.misses else "met"
    return Row(
        name, [str(found.agents), str(found.predictions), *shares, *means, str(seen), verdict]
    )


def measure_sites(args: argparse.Namespace) -> None:
    """Print the table of all sites, and the bars that are missed."""
    runner = ModelRunner.load(find_model(args.model))
    rows, misses = [], []
    for source in data_sources(args.data_options):
        recordings = [item.recording for item in read_sources([source], cache_from(args))]
        seen = sum(is_known(runner.task.training, r.sha256, r.name) for r in recordings)
        for tracker, seed in ((RECORDED, None), (SIMULATED, args.tracker_seed)):
            if tracker not in args.trackers:
                continue
            start_s = time.monotonic()
            found = measure_calibration(
                runner,
                recordings,
                tracker_seed=seed,
                stride_s=args.stride,
                after_s=args.after,
                options=LiveOptions(correct_paths=args.correct_paths),
            )
            name = " ".join([source.folder, *(source.names or ()), tracker])
            rows.append(site_row(name, seen, found))
            misses += [f"{name}: {sentence}" for sentence in found.misses]
            print(f"{name}: {time.monotonic() - start_s:.0f} s", file=sys.stderr, flush=True)
    heads = ["site, observations", "road users", "predictions (5 s)", "90 % shipped", "online"]
    heads += ["50 % shipped", "online", "NLL shipped", "online", "ADE shipped", "online"]
    heads += ["minADE shipped", "online", "CV: ADE", "trained on", "bars"]
    print(to_text(Table(heads, rows)))
    print("\n".join(["", *misses]) if misses else "\nAll bars are met.")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    add_data_arguments(parser)
    add_cache_arguments(parser)
    add = parser.add_argument
    add("--model", default="default", help="file or name of a shipped model (default)")
    add("--trackers", nargs="+", choices=OBSERVATIONS, default=list(OBSERVATIONS))
    add("--tracker-seed", type=int, default=7, metavar="N", help="of the simulated tracker (7)")
    add("--stride", type=float, default=0.4, help="time between two predictions (0.4 s)")
    add("--after", type=float, default=AFTER_S, help="time in which nothing counts (60 s)")
    add(
        "--correct-paths",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="whether the online calibration corrects paths, too",
    )
    add("--agents", type=int, default=64, help="road users, without --data (64)")
    add("--seconds", type=float, default=40.0, help="simulated time, without --data (40)")
    args = parser.parse_args()
    torch.set_num_threads(1)  # as in the node
    if args.data_options:
        measure_sites(args)
        return
    for prefer in PREFERENCES:
        print(measure(args.agents, args.seconds, prefer, args.correct_paths))


if __name__ == "__main__":
    main()
