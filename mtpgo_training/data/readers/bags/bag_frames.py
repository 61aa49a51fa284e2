# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The frames of a bag: that in which its objects are read, and that of its predictions."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
from pathlib import Path

from msg_adapters.bags.bag_reader import DecodingBagReader, bag_name
from msg_adapters.predictions import predictions_in_bag
from mtpgo_core.errors import FrameError, MessageError, RecordingError
from mtpgo_training.data.readers.bags.bag_poses import BagPoses
from mtpgo_training.data.readers.bags.bag_topics import objects_topic
from mtpgo_training.data.readers.reading_options import ReadingOptions

_LOOKED_AT = 20
"""Messages read to find the frame; chosen: the first ones may be empty, or without a pose."""


def observed_frame(bag: Path, options: ReadingOptions) -> str:
    """Return the frame of a bag's tracked objects, as the node would have them; else empty.

    Raises:
        RecordingError: the bag has no tracked objects, or is damaged.
    """
    with DecodingBagReader(bag) as reader:
        topic = objects_topic(reader, options.bags.topic_of(bag_name(bag)))
        poses = BagPoses(reader, topic.name, options.bags.fixed_frame)
        messages = reader.messages(topic.connections)
        for _, received_ns, message in itertools.islice(messages, _LOOKED_AT):
            try:
                states = topic.adapter.to_states(message, fallback_stamp_ns=received_ns)
                if len(states):
                    return poses.lift(states).frame_id
            except (MessageError, FrameError):
                continue
    return ""


def in_frame_of_predictions(
    bag: Path, options: ReadingOptions, topic: str | None = None
) -> ReadingOptions:
    """Return options with which a bag's objects are read in the frame of its predictions.

    That is the node's ``fixed_frame``, which need not be the usual one. Where the bag holds no
    predictions, the options are as they were.

    Args:
        bag: the bag.
        options: how it is read otherwise.
        topic: of the predictions; by default the one that holds some.
    """
    frame = ""
    with contextlib.suppress(RecordingError):
        frame = next((one.frame_id for one in predictions_in_bag(bag, topic) if len(one)), "")
    return dataclasses.replace(options, bags=dataclasses.replace(options.bags, fixed_frame=frame))
