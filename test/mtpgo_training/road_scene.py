# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Four cars on both carriageways of a road, whose gaps and neighbours are known by hand."""

import numpy as np

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.recording import Recording

LINES = (-8.0, -12.0, -16.0), (-20.0, -24.0, -28.0)


def road(rows: list[tuple[int, int, float, float, float, float]]) -> Recording:
    """Cars of 4 m x 2 m from (frame, id, x, y, vx, vy)."""
    table = np.array(rows)
    track_id, track = np.unique(table[:, 1].astype(int), return_inverse=True)
    return Recording(
        name="03",
        layout="highd",
        location="1",
        frame_rate=25.0,
        frame=table[:, 0].astype(np.int64),
        track=track.astype(np.int64),
        position=table[:, 2:4],
        velocity=table[:, 4:6],
        acceleration=np.zeros((len(table), 2)),
        yaw=np.where(table[:, 4] < 0, np.pi, 0.0) + 0.0 * table[:, 0],
        track_id=track_id,
        agent_class=np.full(len(track_id), AgentClass.CAR, dtype=np.uint8),
        size=np.tile([4.0, 2.0], (len(track_id), 1)),
        lanes=tuple(
            np.array([[start, y], [end, y]])
            for side, (start, end) in zip(LINES, ((420.0, 0.0), (0.0, 420.0)), strict=True)
            for y in side
        ),
    )


# Lower carriageway, frame 1: 1 and 2 in the right lane (2 ahead), 3 alongside 1 in the left one.
# Upper: 4 alone in its left lane; it changes to the right lane in frame 2.
SCENE = road(
    [
        (1, 1, 100.0, -26.0, 20.0, 0.0),
        (1, 2, 130.0, -26.0, 15.0, 0.0),
        (1, 3, 102.0, -22.0, 30.0, 0.0),
        (1, 4, 300.0, -14.0, -25.0, 5.0),
        (2, 1, 100.8, -26.0, 20.0, 0.0),
        (2, 2, 130.6, -26.0, 15.0, 0.0),
        (2, 3, 103.2, -22.0, 30.0, 0.0),
        (2, 4, 299.0, -11.9, -25.0, 5.0),
    ]
)
