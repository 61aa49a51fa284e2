# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A short recording and perfect predictions of it."""

import numpy as np

from mtpgo_core.schema import AgentClass, Prediction, Source
from mtpgo_training.data.recording import Recording

RATE_HZ = 10.0


def make_recording(name="made", duration_s=12.0, location="site", sha256="", start_frame=0):
    """Return two vehicles at 10 m/s: 7 straight on, 8 on a circle to the left after 4 s."""
    steps = round(duration_s * RATE_HZ) + 1
    time = np.arange(steps) / RATE_HZ
    straight = np.stack([10.0 * time, np.full(steps, -10.0)], axis=1)
    turned = 0.3 * np.maximum(time - 4.0, 0.0)
    radius = 10.0 / 0.3
    curved = np.stack(
        [10.0 * np.minimum(time, 4.0) + radius * np.sin(turned), radius * (1.0 - np.cos(turned))],
        axis=1,
    )
    heading = np.stack([np.zeros(steps), turned], axis=1)
    frame = np.repeat(np.arange(steps) + start_frame, 2)
    yaw = (heading.reshape(-1) + np.pi) % (2 * np.pi) - np.pi
    return Recording(
        name=name,
        layout="made",
        location=location,
        frame_rate=RATE_HZ,
        frame=frame.astype(np.int64),
        track=np.tile(np.array([0, 1]), steps),
        position=np.stack([straight, curved], axis=1).reshape(-1, 2),
        velocity=10.0 * np.stack([np.cos(yaw), np.sin(yaw)], axis=1),
        acceleration=np.full((2 * steps, 2), np.nan),
        yaw=yaw,
        track_id=np.array([7, 8]),
        agent_class=np.array([AgentClass.CAR, AgentClass.TRUCK], dtype=np.uint8),
        size=np.array([[4.5, 1.9], [np.nan, np.nan]]),
        sha256=sha256,
    )


def perfect_prediction(recording, frame, modes=2, horizon=25, dt_s=0.2):
    """Return the recorded future as mode 0, and the same one metre to the left as mode 1."""
    stamp_ns = recording.stamp_ns(frame)
    states = next(s for s in recording.states() if s.stamp_ns == stamp_ns)
    n = len(states)
    ahead = np.arange(1, horizon + 1) * round(dt_s * recording.frame_rate)
    mean = np.zeros((n, modes, horizon, 4))
    for i in range(n):
        own = recording.position[recording.track == i]
        rows = np.minimum(frame - recording.frame[0] + ahead, len(own) - 1)
        mean[i, :, :, :2] = own[rows]
    mean[:, 1, :, 1] += 1.0
    return Prediction(
        stamp_ns=states.stamp_ns,
        frame_id="map",
        key=states.key,
        agent_class=states.agent_class,
        z=states.z,
        size=states.size,
        initial=np.concatenate([states.position, states.velocity], axis=1),
        initial_yaw=states.yaw,
        time_s=np.arange(1, horizon + 1) * dt_s,
        weight=np.tile([0.75, 0.25], (n, 1)),
        mean=mean,
        yaw=np.zeros((n, modes, horizon)),
        covariance=np.tile(np.diag([4.0, 1.0]), (n, modes, horizon, 1, 1)),
        source=np.full(n, Source.MODEL, dtype=np.uint8),
    )
