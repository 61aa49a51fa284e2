# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The memory of trails of a whole recording, as the node would have filled it."""

from __future__ import annotations

from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_training.data.recording import FRAME_ID, Recording
from mtpgo_training.scenes.track_samples import SampleTable
from mtpgo_training.scenes.windows import windows_of


def recorded_trails(recording: Recording, table: SampleTable) -> TrailMemory:
    """Return the memory after one cycle of the node per grid step of the recording.

    A point's time is that of the cycle in which it became known, so the memory answers for any
    instant of the recording as the node's would at that instant (test).

    Args:
        recording: the recording.
        table: its samples.
    """
    memory = TrailMemory()
    instants = windows_of(recording, table, table.history.dt_s).instants
    key, agent_class = recording.key[instants.track], recording.agent_class[instants.track]
    for window, stamp_ns in enumerate(instants.stamp_ns.tolist()):
        first, end = int(instants.offset[window]), int(instants.offset[window + 1])
        rows = first + instants.present[first:end].nonzero()[0]
        memory.add_instant(
            stamp_ns,
            FRAME_ID,
            key[rows],
            agent_class[rows],
            instants.position[rows],
            instants.velocity[rows],
            instants.yaw[rows],
        )
    return memory
