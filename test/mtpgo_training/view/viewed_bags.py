# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of a recording and its perfect predictions, as the node writes them."""

import numpy as np
from demo_traffic import perfect_prediction

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.predictions import prediction_to_pointcloud2
from msg_adapters.wire.cloud import cloud_to_records, records_to_cloud
from mtpgo_training.data.recording_bag import write_recording

PREDICTIONS = "/predictor/predictions"


def write_bag(
    path, recording, *, predictions=True, topic=PREDICTIONS, model="perfect", **filtered
):
    """Write tracked objects, predictions every 0.2 s up to 10 s, and a diagnosis.

    ``filtered``: values of a field of the points that are kept, all by default.
    """
    with McapWriter(path) as bag:
        for _ in write_recording(bag, recording):
            pass
        if not predictions:
            return path
        bag.add_topic(topic, "sensor_msgs/msg/PointCloud2")
        for frame in range(0, 101, 2):
            message = prediction_to_pointcloud2(perfect_prediction(recording, frame), bag.types)
            message = only(message, bag.types, filtered) if filtered else message
            bag.write(topic, recording.stamp_ns(frame), message)
        bag.add_topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        values = [bag.types.make("diagnostic_msgs/msg/KeyValue", key="model", value=model)]
        status = bag.types.make(
            "diagnostic_msgs/msg/DiagnosticStatus", name="predictor: model", values=values
        )
        array = bag.types.make("diagnostic_msgs/msg/DiagnosticArray", status=[status])
        bag.write("/diagnostics", recording.stamp_ns(0), array)
    return path


def only(message, types, kept):
    """Return the cloud of the points whose fields have one of the values given by name."""
    points = cloud_to_records(message)
    for field, values in kept.items():
        points = points[np.isin(points[field], values)]
    stamp, frame_id = message.header.stamp, message.header.frame_id
    stamp_ns = stamp.sec * 10**9 + stamp.nanosec
    return records_to_cloud(points, types, stamp_ns=stamp_ns, frame_id=frame_id, is_dense=True)
