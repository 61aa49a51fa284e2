# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MCAP files in forms that other recorders and tools write, channel by channel."""

import numpy as np
from mcap.writer import Writer

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.registry import INPUTS
from msg_adapters.types import TypestoreTypes
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states

EPOCH_NS = 1_700_000_000 * 10**9
S_NS = 10**9
OBJECTS = "/objects"


def states_at(time_s, ids=(1, 2, 3), frame="map", y=0.0):
    """Road users that drive along x at 10 m/s, 12 m apart."""
    number = np.asarray(ids, dtype=float)
    position = np.stack([12.0 * number + 10.0 * time_s, np.full(len(number), y)], axis=1)
    return tracked_states(
        EPOCH_NS + round(time_s * S_NS),
        frame,
        keys_from_integers(ids),
        position,
        agent_class=np.ones(len(number), dtype=np.uint8),
        velocity=np.tile([10.0, 0.0], (len(number), 1)),
        yaw=np.zeros(len(number)),
        z=np.zeros(len(number)),
        size=np.tile([4.5, 1.8], (len(number), 1)),
    )


def bytes_of(states, kind="pointcloud2"):
    """A message of tracked objects as CDR."""
    adapter, store = INPUTS[kind], bag_typestore()
    message = adapter.from_states(states, TypestoreTypes(store))
    return bytes(store.serialize_cdr(message, adapter.message_type))


def definition_of(message_type):
    return bag_typestore().generate_msgdef(message_type, ros_version=2)[0]


class OddBag:
    """An MCAP file whose channels are chosen freely; a context manager."""

    def __init__(self, path, *, profile="ros2", **options):
        self.path = path
        self._stream = path.open("wb")
        self.writer = Writer(self._stream, **options)
        self.writer.start(profile=profile, library="test")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.writer.finish()
        self._stream.close()

    def channel(
        self, topic, message_type, text=None, *, language="ros2msg", encoding="cdr", metadata=None
    ):
        """Add a channel; without a text the type's own definition is used."""
        text = definition_of(message_type) if text is None else text
        data = text if isinstance(text, bytes) else text.encode()
        schema = self.writer.register_schema(message_type, language, data)
        return self.writer.register_channel(topic, encoding, schema, metadata or {})

    def objects(self, topic=OBJECTS, kind="pointcloud2", **options):
        return self.channel(topic, INPUTS[kind].message_type, **options)

    def add(self, channel, data, log_s):
        log_ns = EPOCH_NS + round(log_s * S_NS)
        self.writer.add_message(channel, log_ns, data, log_ns)


def write_stream(path, messages, kind="pointcloud2"):
    """Write (log time in s, states) on /objects."""
    with OddBag(path) as bag:
        channel = bag.objects(kind=kind)
        for log_s, states in messages:
            bag.add(channel, bytes_of(states, kind), log_s)
    return path
