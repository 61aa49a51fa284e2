# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of a vehicle that drives past others, with TF, and with predictions in a fixed frame."""

import dataclasses

import numpy as np
from demo_traffic import perfect_prediction

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.conversions import make_header, make_quaternion, make_vector
from msg_adapters.predictions import prediction_to_pointcloud2
from msg_adapters.registry import INPUTS
from mtpgo_training.data.readers.bags.bag_transforms import TRANSFORMS

MAP_SHIFT_M = np.array([7.0, -14.0])
"""The odometry's origin in the map."""


def transforms(types, stamp_ns, vehicle_x):
    """map -> odom -> base_link."""

    def link(parent, child, x, y):
        return types.make(
            "geometry_msgs/msg/TransformStamped",
            header=make_header(types, stamp_ns, parent),
            child_frame_id=child,
            transform=types.make(
                "geometry_msgs/msg/Transform",
                translation=make_vector(types, x, y),
                rotation=make_quaternion(types, 0.0),
            ),
        )

    links = [link("map", "odom", *MAP_SHIFT_M), link("odom", "base_link", vehicle_x, 0.0)]
    return types.make(TRANSFORMS, transforms=links)


def driven_past(path, recording, fixed_frame, *, with_transforms=True):
    """Write objects in the frame of a vehicle, and perfect predictions in a fixed frame."""
    adapter = INPUTS["pointcloud2"]
    shift = MAP_SHIFT_M if fixed_frame == "odom" else np.zeros(2)
    with McapWriter(path) as out:
        out.add_topic("/objects", adapter.message_type)
        out.add_topic("/predictions", "sensor_msgs/msg/PointCloud2")
        out.add_topic("/tf", TRANSFORMS)
        for number, states in enumerate(recording.states()):
            stamp_ns, vehicle_x = states.stamp_ns, 0.5 * number
            if with_transforms:
                out.write("/tf", stamp_ns, transforms(out.types, stamp_ns, vehicle_x))
                seen = states.position - MAP_SHIFT_M - (vehicle_x, 0.0)
                states = dataclasses.replace(states, position=seen, frame_id="base_link")
            out.write("/objects", stamp_ns, adapter.from_states(states, out.types))
            one = perfect_prediction(recording, number)
            mean = one.mean.copy()
            mean[..., :2] -= shift
            one = dataclasses.replace(one, mean=mean, frame_id=fixed_frame)
            out.write("/predictions", stamp_ns, prediction_to_pointcloud2(one, out.types))
    return path
