# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the correction of predicted paths is computed from: a few numbers of each road user."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from mtpgo_core.frames import along_and_across, rotate
from mtpgo_core.scene.leader_context import COLUMNS, LEADERS, leader_features
from mtpgo_core.scene.track_summary import velocity_changes
from mtpgo_core.schema import MOVING_MPS, Float64Array, HistoryWindow, IndexArray, Prediction
from mtpgo_core.task.task_description import CHANGE_STEPS

PARTS = (0.2, 0.6, 1.0)
"""Where along the horizon the departure from constant velocity is a feature; chosen: 1, 3 and 5 s
of 5 s, as in all tables of scores."""

_DEPARTURE = slice(0, len(PARTS))
MIXTURE = slice(_DEPARTURE.stop, _DEPARTURE.stop + len(PARTS))
"""Features that draw the heaviest mode to the mean of all modes; no other mode follows them."""

_CHANGES = slice(MIXTURE.stop, MIXTURE.stop + len(CHANGE_STEPS))
_LEADERS = slice(_CHANGES.stop, _CHANGES.stop + 3 * LEADERS)
_SPEED, _CONSTANT = _LEADERS.stop, _LEADERS.stop + 1

FEATURES = _CONSTANT + 1
"""F, the features of each of the two directions; those along the course alone are 0 across it."""

_NEAR_MPS = 3.0
"""The nearness of a leader is multiplied by this, so that it is as large as the other features
(m/s); chosen."""

_SPEED_MPS = 10.0
"""Speed that counts as 1 (m/s); chosen with the same aim."""

_LARGEST_VALUE = 100.0
"""Largest feature; chosen: beyond what moves, and what a tracker's slip cannot exceed."""

_ALONG = 0
_BY_SAMPLE = ("position", "velocity", "acceleration", "yaw", "valid")


@dataclass(frozen=True)
class PathFeatures:
    """Features of n road users that move at t, along their course at t and to its left.

    Attributes:
        course: [n] direction of the velocity at t (rad).
        share: [n] of a correction that is applied: 0 at ``MOVING_MPS``, 1 from twice that on, so
            that no path jumps where a road user starts or stops.
        values: [n, 2, F] for the correction along the course and across it.
        sigma: [n, H, 2] standard deviations of the heaviest mode, along and across (m).
    """

    course: Float64Array
    share: Float64Array
    values: Float64Array
    sigma: Float64Array


def part_steps(steps: int) -> list[int]:
    """Return the last step of each of ``PARTS`` of a horizon, from 0."""
    return [max(0, round(part * steps) - 1) for part in PARTS]


def path_features(prediction: Prediction, window: HistoryWindow, row: IndexArray) -> PathFeatures:
    """Return the features of road users that move at t.

    * How far the heaviest mode is from constant velocity at three parts of the horizon, and how
      far the mean of all modes is from it, divided by the time (m/s).
    * The changes of the velocity over the last steps, see
      :func:`~mtpgo_core.scene.track_summary.velocity_changes`.
    * Along only, of each of the next two agents ahead (see
      :func:`~mtpgo_core.scene.leader_context.leader_features`): its nearness, and its relative
      velocity (m/s) and its acceleration (m/s^2) times that.
    * Along only, the speed and 1. Across there is no constant: left and right are alike.

    Args:
        prediction: of agents whose speed at t is known and above ``MOVING_MPS``.
        window: of all agents.
        row: [n] the predicted agents' positions in the window.
    """
    velocity = prediction.initial[:, 2:]
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    steps = part_steps(len(prediction.time_s))
    mean, time_s = prediction.mean[:, :, steps, :2], prediction.time_s[steps, None]
    ahead_s = time_s - (window.stamp_ns - prediction.stamp_ns) * 1e-9
    departure = mean[:, 0] - (prediction.initial[:, None, :2] + velocity[:, None] * time_s)
    apart = np.einsum("nm,nmks->nks", prediction.weight, mean) - mean[:, 0]
    values = np.zeros((len(row), 2, FEATURES))
    for part, offset in ((_DEPARTURE, departure), (MIXTURE, apart)):
        values[..., part] = rotate(offset / ahead_s, -course[:, None]).transpose(0, 2, 1)
    values[..., _CHANGES] = velocity_changes(window.select(row))
    values[:, _ALONG, _LEADERS] = _leaders(window, row)
    values[:, _ALONG, _SPEED] = speed / _SPEED_MPS
    values[:, _ALONG, _CONSTANT] = 1.0
    values = np.clip(np.nan_to_num(values), -_LARGEST_VALUE, _LARGEST_VALUE)
    along, _, across = along_and_across(prediction.covariance[:, 0], course[:, None])
    return PathFeatures(
        course=course,
        share=np.clip(speed / MOVING_MPS - 1.0, 0.0, 1.0),
        values=values,
        sigma=np.sqrt(np.stack([along, across], axis=-1)),
    )


def _leaders(window: HistoryWindow, row: IndexArray) -> Float64Array:
    """Return [n, 6] nearness, relative velocity and acceleration of the two agents ahead."""
    now = dataclasses.replace(
        window,
        **{name: getattr(window, name)[:, -1:] for name in _BY_SAMPLE},
    )
    found = leader_features(now, row)[:, -1].reshape(len(row), LEADERS, len(COLUMNS))
    near = found[..., COLUMNS.index("near")]
    parts = [_NEAR_MPS * near]
    # NaN where the velocity of one of both was never known, which becomes 0 as in the network's
    # input.
    parts += [near * found[..., COLUMNS.index(name)] for name in ("dv", "ax")]
    return np.stack(parts, axis=-1).reshape(len(row), len(parts) * LEADERS)
