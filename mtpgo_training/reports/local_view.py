# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The content of a picture of a moment, in the frame of the road user in focus."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.frames import rotate, rotate_covariance
from mtpgo_core.schema import Float64Array
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.moments import Moment


@dataclass(frozen=True)
class LocalView:
    """A moment in the frame in which the focal road user is at the origin and heads along +x.

    Attributes:
        origin: [2] position of the focal road user in the recording's frame (m).
        angle: its heading there (rad).
        position: [n, 2] of the predicted road users (m). velocity: [n, 2] (m/s). yaw: [n] (rad).
        size: [n, 2] length, width (m), NaN where unknown.
        past: n paths [k, 2] up to now (m).
        future: n paths [k, 2] from now on, as they were observed (m).
        lanes: lane markings, [k, 2] each (m).
        paths: all paths of the recording, [k, 2] each (m).
    """

    origin: Float64Array
    angle: float
    position: Float64Array
    velocity: Float64Array
    yaw: Float64Array
    size: Float64Array
    past: list[Float64Array]
    future: list[Float64Array]
    lanes: list[Float64Array]
    paths: list[Float64Array]

    def turn(self, points: Float64Array) -> Float64Array:
        """Return points [..., 2] of the recording's frame in this one (m)."""
        return _turn(points - self.origin, self.angle)

    def turn_covariance(self, covariance: Float64Array) -> Float64Array:
        """Return a covariance [2, 2] of the recording's frame in this one (m^2)."""
        return rotate_covariance(covariance, -self.angle)


def surroundings(moment: Moment, past_s: float) -> LocalView:
    """Return the view of a moment, with the past of the last ``past_s`` seconds."""
    recording, prediction = moment.recording, moment.prediction
    now = (prediction.stamp_ns - recording.start_time_ns) * 1e-9 * recording.frame_rate
    horizon = float(prediction.time_s[-1]) * recording.frame_rate
    track = recording.find_tracks(prediction.key)
    paths = _paths(recording)
    slack = 1e-3
    past, future, state = [], [], np.full((len(track), 5), np.nan)
    for i, t in enumerate(track.tolist()):
        rows = paths[t]
        frame = recording.frame[rows]
        before = (frame <= now + slack) & (frame >= now - past_s * recording.frame_rate - slack)
        after = (frame >= now - slack) & (frame <= now + horizon + slack)
        past.append(recording.position[rows[before]])
        future.append(recording.position[rows[after]])
        if before.any():
            row = rows[before][-1]
            state[i] = [*recording.position[row], *recording.velocity[row], recording.yaw[row]]
    course = np.arctan2(state[:, 3], state[:, 2])
    yaw = np.where(np.isfinite(state[:, 4]), state[:, 4], course)
    origin, angle = state[moment.agent, :2], float(yaw[moment.agent])
    return LocalView(
        origin=origin,
        angle=angle,
        position=_turn(state[:, :2] - origin, angle),
        velocity=_turn(state[:, 2:4], angle),
        yaw=yaw - angle,
        size=recording.size[track],
        past=[_turn(path - origin, angle) for path in past],
        future=[_turn(path - origin, angle) for path in future],
        lanes=[_turn(lane - origin, angle) for lane in recording.lanes],
        paths=[_turn(recording.position[rows] - origin, angle) for rows in paths],
    )


def _paths(recording: Recording) -> list[np.ndarray]:
    """Return the rows of every track, in time."""
    order = np.lexsort((recording.frame, recording.track))
    starts = np.searchsorted(recording.track[order], np.arange(1, len(recording.track_id)))
    return np.split(order, starts)


def _turn(vectors: Float64Array, angle: float) -> Float64Array:
    """[..., 2] vectors in axes that are turned by ``angle``."""
    return rotate(vectors, -angle)
