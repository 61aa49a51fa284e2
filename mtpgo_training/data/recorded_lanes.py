# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lanes of a file for a recording, with a warning where they do not fit its traffic."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Sequence

import numpy as np

from mtpgo_core.maps.lane_lines import LaneLines
from mtpgo_core.scene.lane_fit import LaneFit
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import Float64Array
from mtpgo_training.data.recording import Recording

_LOOKS = 20
"""Frames that the lanes are compared with; chosen: spread over the recording."""

_MARGIN_M = 100.0
"""Lines farther than this from the places of all road users are left out (m); chosen: the range of
the contexts."""

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
    return dataclasses.replace(recording, lanes=lines_near(lanes.lines, recording.position))


def lines_near(lines: Sequence[Float64Array], position: Float64Array) -> tuple[Float64Array, ...]:
    """Return the lines within the rectangle around [n, 2] positions (m), and a margin."""
    if not len(position):
        return ()
    low, high = position.min(axis=0) - _MARGIN_M, position.max(axis=0) + _MARGIN_M
    return tuple(
        line
        for line in lines
        if (line.max(axis=0) >= low).all() and (line.min(axis=0) <= high).all()
    )
