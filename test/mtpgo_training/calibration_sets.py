# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples for a calibration whose distances and weights are known."""

import dataclasses

import numpy as np

from mtpgo_core.quality.metrics import scored_steps
from mtpgo_core.task.calibration import GROUPS
from mtpgo_training.calibration.calibration_samples import CalibrationSamples

VEHICLE, PEDESTRIAN = GROUPS.index("vehicle_moving"), GROUPS.index("pedestrian_moving")


def random_samples(
    seed, *, sites=("a",), n=400, growth=1.0, group=VEHICLE, steps=25, modes=3, temperature=1.0
):
    """Samples of ``n`` agents of each site, whose covariances are too small by a factor.

    Args:
        seed: of the draw.
        sites: names.
        n: agents of each site, or one number for each.
        growth: the factor that would be right at the last step; it rises from 1 linearly.
        group: of all agents.
        steps: H.
        modes: M.
        temperature: at which the weights would be probabilities.
    """
    draw = np.random.default_rng(seed)
    counts = np.broadcast_to(n, len(sites))
    total = int(counts.sum())
    factor = np.linspace(1.0, growth, steps)
    right = draw.normal(0.0, 1.5, (total, modes))
    probability = np.exp(right) / np.exp(right).sum(axis=1, keepdims=True)
    nearest = (draw.random((total, 1)) > probability.cumsum(axis=1)).sum(axis=1)
    log_weight = temperature * np.log(probability)
    error = np.full((total, modes), 5.0)
    error[np.arange(total), nearest] = 1.0
    distance = (factor * draw.chisquare(2, (total, steps))).astype(np.float32)
    return CalibrationSamples(
        step_s=0.2,
        sites=tuple(sites),
        site=np.repeat(np.arange(len(sites)), counts).astype(np.int32),
        group=np.full(total, group, dtype=np.uint8),
        distance=distance,
        log_determinant=np.zeros((total, steps), np.float32),
        log_weight=(log_weight - np.logaddexp.reduce(log_weight, axis=1, keepdims=True)).astype(
            np.float32
        ),
        mode_error=error.astype(np.float32),
        mode_distance=_of_modes(distance, modes, 0.2),
        mode_log_determinant=_of_modes(np.zeros_like(distance), modes, 0.2),
    )


def with_distance(samples, distance):
    """The same agents at other distances [n, H], from each of the modes."""
    distance = np.asarray(distance, dtype=np.float32)
    of_modes = _of_modes(distance, samples.log_weight.shape[1], samples.step_s)
    return dataclasses.replace(samples, distance=distance, mode_distance=of_modes)


def _of_modes(values, modes, step_s):
    """Return [n, M, K] the same for each mode at the scored steps, so that the mixture is one."""
    steps = list(scored_steps(values.shape[1], step_s).values())
    return np.repeat(values[:, None, steps], modes, axis=1)
