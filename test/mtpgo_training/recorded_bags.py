# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions of a recording, written to a bag as the node does."""

import dataclasses

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.predictions import prediction_to_pointcloud2
from msg_adapters.registry import input_adapter
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.output_assembly import with_time_origin
from mtpgo_core.prediction.scene_predictor import ScenePredictor
from mtpgo_training.data.recording_bag import OBJECTS_TOPIC

CLOUD = "sensor_msgs/msg/PointCloud2"
TOPIC = "/predictor/predictions"


def play(recording, runner, path, *, shift_ns=0, every=2, observations=True, delay_ns=0):
    """Run the node's steps in one process; every message is serialised as CDR and read back.

    The node compensates a delay of ``delay_ns``.
    """
    adapter, store = input_adapter("pointcloud2"), bag_typestore()
    predictor, history = ScenePredictor(runner), TrackHistory(runner.task.history)
    with McapWriter(path) as bag:
        if observations:
            bag.add_topic(OBJECTS_TOPIC, adapter.message_type)
        bag.add_topic(TOPIC, CLOUD)
        for i, states in enumerate(recording.states()):
            stamp_ns = states.stamp_ns + shift_ns
            message = adapter.from_states(
                dataclasses.replace(states, stamp_ns=stamp_ns), bag.types
            )
            wire = store.serialize_cdr(message, adapter.message_type)
            received = store.deserialize_cdr(wire, adapter.message_type)
            history.update(adapter.to_states(received))
            if observations:
                bag.write(OBJECTS_TOPIC, stamp_ns, received)
            if i % every == 0:
                prediction = predictor.predict(history.window(stamp_ns + delay_ns))
                prediction = with_time_origin(prediction, stamp_ns)
                bag.write(TOPIC, stamp_ns, prediction_to_pointcloud2(prediction, bag.types))
    return path
