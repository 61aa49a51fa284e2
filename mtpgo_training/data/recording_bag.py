# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The topics of a recording in a bag, and how a recording is written to them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from msg_adapters.inputs.lane_markers import lanes_to_markers
from msg_adapters.registry import input_adapter
from mtpgo_core.identity import key_to_text
from mtpgo_training.data.recording import FRAME_ID, Recording

if TYPE_CHECKING:
    from msg_adapters.bags.mcap_writer import McapWriter

OBJECTS_TOPIC = "/objects"
LANES_TOPIC = "/lane_markings"
PREDICTIONS_TOPIC = "/predictor/predictions"
EGO_TOPIC = "/ego_id"

DEFAULT_KIND = "pointcloud2"
"""Short name of the message kind that carries everything, see :mod:`msg_adapters.registry`."""


def write_recording(
    bag: McapWriter,
    recording: Recording,
    *,
    kind: str = DEFAULT_KIND,
    shift_ns: int = 0,
) -> Iterator[int]:
    """Append a recording to a bag and yield the number of road users of each frame written.

    Topics that the bag lacks are added. Lane markings and the ego come first, latched.

    Args:
        bag: an open bag.
        recording: the recording.
        kind: short name of the tracked-object message.
        shift_ns: added to all stamps (ns).

    Raises:
        MessageError: the message cannot carry the recording, such as too large an identity.
        ConfigurationError: an unknown kind.
    """
    adapter = input_adapter(kind)
    if not len(recording):
        return
    start_ns = recording.stamp_ns(int(recording.frame[0])) + shift_ns
    if not bag.has_topic(OBJECTS_TOPIC):
        bag.add_topic(OBJECTS_TOPIC, adapter.message_type)
    if recording.lanes:
        if not bag.has_topic(LANES_TOPIC):
            bag.add_topic(LANES_TOPIC, "visualization_msgs/msg/MarkerArray", latched=True, depth=1)
        lanes = lanes_to_markers(recording.lanes, bag.types, stamp_ns=start_ns, frame_id=FRAME_ID)
        bag.write(LANES_TOPIC, start_ns, lanes)
    if recording.ego_id is not None:
        if not bag.has_topic(EGO_TOPIC):
            bag.add_topic(EGO_TOPIC, "std_msgs/msg/String", latched=True, depth=1)
        text = bag.types.make("std_msgs/msg/String", data=_name_of_ego(recording))
        bag.write(EGO_TOPIC, start_ns, text)
    for states in recording.states():
        stamp_ns = states.stamp_ns + shift_ns
        # A recording is seen from above: the ground is z = 0. Viewers hide points without a z.
        height = np.where(np.isnan(states.z), 0.0, states.z)
        states = dataclasses.replace(states, stamp_ns=stamp_ns, z=height)
        bag.write(OBJECTS_TOPIC, stamp_ns, adapter.from_states(states, bag.types))
        yield len(states)


def _name_of_ego(recording: Recording) -> str:
    """Return the ego's identity as the objects' messages have it, also where it is no number."""
    row = np.flatnonzero(recording.track_id == recording.ego_id)
    return key_to_text(recording.key[row[0]]) if len(row) else str(recording.ego_id)
