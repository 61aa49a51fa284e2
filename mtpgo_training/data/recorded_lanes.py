# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lanes of a file for a recording, with a warning where they do not fit its traffic."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np

from mtpgo_core.maps.lane_lines import LaneLines
from mtpgo_core.scene.lane_fit import LaneFit
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_training.data.recording import Recording

_LOOKS = 20
"""Frames that the lanes are compared with; chosen: spread over the recording."""

_log = logging.getLogger("mtpgo")


def with_lanes(recording: Recording, lanes: LaneLines) -> Recording:
    """Return the recording with the lanes of a file in place of its own."""
    fit, road = LaneFit(), LaneMap(lanes.lines)
    frames = recording.frames
    for frame in frames[:: max(1, len(frames) // _LOOKS)]:
        begin, end = np.searchsorted(recording.frame, (frame, frame + 1))
        rows = slice(int(begin), int(end))
        classes = recording.agent_class[recording.track[rows]]
        fit.look(road, recording.position[rows], recording.velocity[rows], classes)
    if fit.problem:
        _log.warning(
            "mtpgo: recording %s: %s: %s, expected another --lane-projection, --lane-origin or"
            " --lane-offset",
            recording.name,
            lanes.path,
            fit.problem,
        )
    return dataclasses.replace(recording, lanes=lanes.lines)
