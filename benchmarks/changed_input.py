# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How soon the online calibration lets go of what is right no more.

All recordings but the last are played with velocities that are a factor too large, as of a sensor
that is calibrated badly, the last one as it is; one after the other, as a node sees them. Printed
is the ADE of moving road users as corrected, relative to the model's own, every some seconds of
the last two recordings.
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np
import torch

from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.prediction.model_runner import ModelRunner, find_model
from mtpgo_core.quality.metrics import ade
from mtpgo_core.schema import Float64Array
from mtpgo_training.commands.arguments.data_arguments import (
    add_cache_arguments,
    add_data_arguments,
    cache_from,
    data_sources,
)
from mtpgo_training.data.data_sources import read_sources
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.calibration_bars import served_predictions

STRIDE_S = 0.4
"""Time between two predictions (s)."""


def errors(
    runner: ModelRunner, live: LiveCalibration, recording: Recording, factor: float
) -> Float64Array:
    """Return [n, 3] seconds since the start, and the ADE as shipped and as corrected (m).

    Args:
        runner: the model.
        live: goes on from one recording to the next.
        recording: the truth.
        factor: of its velocities, as they are observed.
    """
    observed = dataclasses.replace(
        recording,
        velocity=factor * recording.velocity,
        acceleration=factor * recording.acceleration,
    )
    found = [np.empty((0, 3))]
    for one in served_predictions(runner, live, recording, observed, STRIDE_S):
        both = [
            ade(path.mean[..., :2], path.weight, one.truth.position, one.truth.mask)
            for path in (one.shipped, one.online)
        ]
        found.append(np.stack([np.full_like(both[0], one.time_s), *both], axis=1))
    return np.concatenate(found)


def ratios(found: Float64Array, every_s: float) -> str:
    """Return corrected / shipped, every some seconds."""
    part = (found[:, 0] // every_s).astype(int)
    means = [found[part == one].mean(axis=0) for one in range(part.max(initial=-1) + 1)]
    return " ".join(f"{corrected / shipped:.2f}" for _, shipped, corrected in means)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    add_data_arguments(parser)
    add_cache_arguments(parser)
    add = parser.add_argument
    add("--model", default="default", help="file or name of a shipped model (default)")
    add("--factor", type=float, default=1.1, help="of the velocities at first (1.1)")
    add("--every", type=float, default=15.0, help="seconds of each ratio (15)")
    args = parser.parse_args()
    torch.set_num_threads(1)  # as in the node
    runner = ModelRunner.load(find_model(args.model))
    sources = data_sources(args.data_options)
    recordings = [item.recording for item in read_sources(sources, cache_from(args))]
    live = LiveCalibration(LiveOptions(), runner.task.history, runner.task.horizon_steps)
    for place, recording in enumerate(recordings):
        last = place == len(recordings) - 1
        found = errors(runner, live, recording, 1.0 if last else args.factor)
        if place >= len(recordings) - 2:
            said = "as it is" if last else f"velocities times {args.factor:g}"
            print(f"{recording.name}, {said}: {ratios(found, args.every)}", flush=True)


if __name__ == "__main__":
    main()
