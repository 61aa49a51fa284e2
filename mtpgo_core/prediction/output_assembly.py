# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From the model's output in many scene frames to one prediction in the fixed frame.

Also the operations on whole predictions: merging, selecting agents, and shifting the time origin.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from mtpgo_core.prediction.constant_velocity import initial_states, motion_yaw
from mtpgo_core.prediction.finite_output import definite_in_float32, finite_in_float32
from mtpgo_core.prediction.paths.mode_spread import with_least_spread
from mtpgo_core.prediction.paths.path_smoothing import PathSmoother
from mtpgo_core.schema import (
    BoolArray,
    Float32Array,
    Float64Array,
    HistoryWindow,
    IndexArray,
    KeyArray,
    Prediction,
    SceneBatch,
    Source,
)


@dataclass(frozen=True)
class ModelOutput:
    """The model's output for p agents, each from its primary graph and in that scene frame.

    Attributes:
        log_weight: [p, M] logarithms of the mode weights.
        mean: [p, M, H, S] x, y (m) and, where S is 4, vx, vy (m/s).
        covariance: [p, M, H, 2, 2] of the position (m^2).
    """

    log_weight: Float32Array
    mean: Float32Array
    covariance: Float32Array


def assemble(
    window: HistoryWindow,
    batch: SceneBatch,
    output: ModelOutput,
    dt_s: float,
    smoother: PathSmoother | None = None,
    temperature: Float64Array | None = None,
    least_mode_spread: float = 0.0,
) -> Prediction:
    """Return the prediction in the fixed frame, modes sorted by weight, in the window's order.

    Args:
        window: the window of the scenes.
        batch: the scenes.
        output: of the model, one row for each true value of ``batch.primary``, in row-major order.
        dt_s: step of the horizon (s).
        smoother: of the paths from cycle to cycle, if any.
        temperature: [n] with which the weights of the window's agents will be calibrated, which a
            smoother needs; 1 by default.
        least_mode_spread: see :func:`~mtpgo_core.prediction.paths.mode_spread.with_least_spread`.

    Returns:
        One row for each agent of the window. Rows of agents without a prediction, or with one
        that is not finite or whose covariance is not positive definite, are NaN throughout.
    """
    agent = batch.agent[batch.primary]
    initial, initial_yaw = initial_states(window)
    mean, covariance = _in_fixed_frame(batch, output)
    if output.mean.shape[-1] == 2:
        mean[..., 2:] = _differences(mean[..., :2], initial[agent, :2], dt_s)
    weight = _weights(output.log_weight.astype(np.float64))
    usable = _usable(weight, mean, covariance)
    if smoother is not None:
        temperature = np.ones(len(window)) if temperature is None else temperature
        mean, weight = smoother.smooth(
            window, agent, mean, weight, covariance, usable, dt_s, temperature[agent]
        )

    order = np.argsort(-weight, axis=1, kind="stable")
    rows = np.arange(order.shape[0])[:, None]
    weight, mean, covariance = weight[rows, order], mean[rows, order], covariance[rows, order]
    # After the smoothing, which compares each mode with itself, whatever mode is the heaviest.
    mean = with_least_spread(mean, weight, covariance, least_mode_spread, dt_s)
    yaw = motion_yaw(mean, initial_yaw[agent])

    def in_window(values: Float64Array) -> Float64Array:
        full = np.full((len(window), *values.shape[1:]), np.nan)
        full[agent[usable]] = values[usable]
        return full

    return Prediction(
        stamp_ns=window.stamp_ns,
        frame_id=window.frame_id,
        key=window.key,
        agent_class=window.agent_class,
        z=window.z,
        size=window.size,
        initial=initial,
        initial_yaw=initial_yaw,
        time_s=dt_s * np.arange(1, mean.shape[2] + 1),
        weight=in_window(weight),
        mean=in_window(mean),
        yaw=in_window(yaw),
        covariance=in_window(covariance),
        source=np.full(len(window), Source.MODEL, dtype=np.uint8),
    )


def _in_fixed_frame(batch: SceneBatch, output: ModelOutput) -> tuple[Float64Array, Float64Array]:
    """Return means [p, M, H, 4] and covariances [p, M, H, 2, 2] in the fixed frame.

    The velocities of a first-order model, which predicts positions only, are not set.
    """
    graph, _ = np.nonzero(batch.primary)
    cos, sin = np.cos(batch.rotation[graph]), np.sin(batch.rotation[graph])
    cos, sin = cos[:, None, None], sin[:, None, None]
    scene = output.mean.astype(np.float64)
    mean = np.empty((*scene.shape[:3], 4))
    for first in range(0, scene.shape[-1], 2):
        x, y = scene[..., first], scene[..., first + 1]
        mean[..., first] = cos * x - sin * y
        mean[..., first + 1] = sin * x + cos * y
    mean[..., :2] += batch.origin[graph][:, None, None]
    with np.errstate(invalid="ignore"):  # infinite covariances are rejected later
        return mean, _rotated(output.covariance.astype(np.float64), cos, sin)


def merge(first: Prediction, other: Prediction, take_other: BoolArray) -> Prediction:
    """Return ``first`` with the rows where ``take_other`` [n] is true taken from ``other``."""
    return replace_rows(first, np.flatnonzero(take_other), select(other, take_other))


def replace_rows(first: Prediction, row: IndexArray, other: Prediction) -> Prediction:
    """Return ``first`` with its rows ``row`` [k] taken from the k rows of ``other``."""
    fields = (
        "initial",
        "initial_yaw",
        "weight",
        "mean",
        "yaw",
        "covariance",
        "source",
        "sigma_factor_50",
        "calibration",
    )
    replaced = {}
    for name in fields:
        value = getattr(first, name).copy()
        value[row] = getattr(other, name)
        replaced[name] = value
    return dataclasses.replace(first, **replaced)


def spread(prediction: Prediction, row: IndexArray, window: HistoryWindow) -> Prediction:
    """Return one row for each agent of the window, NaN except for its rows ``row`` [k].

    Args:
        prediction: of k agents of the window.
        row: [k] their positions in it, ascending.
        window: all agents.
    """
    if len(prediction) == len(window):
        return prediction

    def full(values: Float64Array) -> Float64Array:
        out = np.full((len(window), *values.shape[1:]), np.nan)
        out[row] = values
        return out

    initial, initial_yaw = initial_states(window)
    factor = np.ones((len(window), prediction.mean.shape[2]))
    factor[row] = prediction.sigma_factor_50
    stage = np.zeros(len(window), dtype=np.uint8)
    stage[row] = prediction.calibration
    return dataclasses.replace(
        prediction,
        key=window.key,
        agent_class=window.agent_class,
        z=window.z,
        size=window.size,
        initial=initial,
        initial_yaw=initial_yaw,
        weight=full(prediction.weight),
        mean=full(prediction.mean),
        yaw=full(prediction.yaw),
        covariance=full(prediction.covariance),
        source=np.full(len(window), Source.MODEL, dtype=np.uint8),
        sigma_factor_50=factor,
        calibration=stage,
    )


def with_heaviest_modes(prediction: Prediction, modes: int) -> Prediction:
    """Return the first ``modes`` modes of each agent, with weights that sum to one."""
    weight, kept = heaviest_modes(prediction, modes)
    if kept == prediction.weight.shape[1]:
        return prediction
    return dataclasses.replace(
        prediction,
        weight=weight,
        mean=prediction.mean[:, :modes],
        yaw=prediction.yaw[:, :modes],
        covariance=prediction.covariance[:, :modes],
    )


def select(prediction: Prediction, index: IndexArray | BoolArray) -> Prediction:
    """Return the prediction of the agents at ``index`` (integer positions or a mask)."""
    whole = {"stamp_ns", "frame_id", "time_s"}
    rows = {
        f.name: getattr(prediction, f.name)[index]
        for f in dataclasses.fields(prediction)
        if f.name not in whole
    }
    return dataclasses.replace(prediction, **rows)


def without_agent(prediction: Prediction, key: KeyArray | None) -> Prediction:
    """Return the prediction without the agent of a key [4]; unchanged if it is None or absent."""
    if key is None:
        return prediction
    kept = (prediction.key != key).any(axis=1)
    return prediction if kept.all() else select(prediction, kept)


def heaviest_modes(prediction: Prediction, max_modes: int | None) -> tuple[Float64Array, int]:
    """Return the weights of the first ``max_modes`` modes, with sum one, and their number.

    Args:
        prediction: modes sorted by falling weight.
        max_modes: most modes kept; None keeps all.
    """
    modes = prediction.weight.shape[1]
    kept = modes if max_modes is None else max(1, min(max_modes, modes))
    weight = prediction.weight[:, :kept]
    if kept < modes:
        weight = weight / weight.sum(axis=1, keepdims=True)
    return weight, kept


def with_time_origin(prediction: Prediction, stamp_ns: int) -> Prediction:
    """Return the same prediction with its times counted from ``stamp_ns`` (ns).

    The states at the stamp are carried there at constant velocity, as the history carries them.
    """
    if stamp_ns == prediction.stamp_ns:
        return prediction
    shift_s = (prediction.stamp_ns - stamp_ns) * 1e-9
    initial = prediction.initial.copy()
    initial[:, :2] -= shift_s * initial[:, 2:]
    return dataclasses.replace(
        prediction, stamp_ns=stamp_ns, time_s=prediction.time_s + shift_s, initial=initial
    )


def time_grid(time_s: Float64Array) -> tuple[float, float]:
    """Return when the horizon of a prediction begins after its stamp, and its step (s).

    It begins after the stamp where the node compensated its delay: the first time is then the
    delay plus one step. With a single step, the delay cannot be determined and is taken as 0.

    Args:
        time_s: [H] as in a prediction (s); float32 if it comes from a message, NaN where all
            points of a step are missing.
    """
    known = np.flatnonzero(np.isfinite(time_s))
    if not len(known):
        return 0.0, float("nan")
    first, last = int(known[0]), int(known[-1])
    if first == last:
        return 0.0, float(time_s[first]) / (first + 1)
    # Rounded below what float32 resolves.
    step_s = round(float(time_s[last] - time_s[first]) / (last - first), 9)
    return max(0.0, round(float(time_s[first]) - (first + 1) * step_s, 6)), step_s


def delay_ns(prediction: Prediction) -> int:
    """Return how long after its stamp the horizon of a prediction begins (ns)."""
    return round(1e9 * time_grid(prediction.time_s)[0])


def from_horizon_start(prediction: Prediction) -> Prediction:
    """Return the same prediction stamped with the time at which its horizon begins."""
    return with_time_origin(prediction, prediction.stamp_ns + delay_ns(prediction))


def _differences(position: Float64Array, initial: Float64Array, dt_s: float) -> Float64Array:
    """Return velocities [p, M, H, 2] of a first-order model, which predicts positions only."""
    start = np.broadcast_to(initial[:, None, None], (*position.shape[:2], 1, 2))
    return np.diff(np.concatenate([start, position], axis=2), axis=2) / dt_s


def _rotated(covariance: Float64Array, cos: Float64Array, sin: Float64Array) -> Float64Array:
    """Return R C R^T of covariances [p, M, H, 2, 2], written out and therefore symmetric."""
    xx, yy = covariance[..., 0, 0], covariance[..., 1, 1]
    xy = 0.5 * (covariance[..., 0, 1] + covariance[..., 1, 0])
    rotated = np.empty(covariance.shape)
    rotated[..., 0, 0] = cos * cos * xx - 2.0 * cos * sin * xy + sin * sin * yy
    rotated[..., 1, 1] = sin * sin * xx + 2.0 * cos * sin * xy + cos * cos * yy
    rotated[..., 0, 1] = rotated[..., 1, 0] = cos * sin * (xx - yy) + (cos * cos - sin * sin) * xy
    return rotated


def _weights(log_weight: Float64Array) -> Float64Array:
    """Return weights [p, M] that sum to 1 in float64."""
    with np.errstate(invalid="ignore"):
        weight = np.exp(log_weight - log_weight.max(axis=1, keepdims=True))
        return weight / weight.sum(axis=1, keepdims=True)


def _usable(weight: Float64Array, mean: Float64Array, covariance: Float64Array) -> BoolArray:
    """Return [p] which predictions are finite and have positive definite covariances."""
    finite = np.isfinite(weight).all(axis=1) & finite_in_float32(mean)
    return np.asarray(finite & definite_in_float32(covariance).all(axis=(1, 2)))
