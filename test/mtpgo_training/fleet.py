# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags as a fleet records them: other rates, jitter, gaps, frames and further topics."""

import dataclasses

import numpy as np

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.registry import INPUTS
from mtpgo_core.frames import Pose2, rotate
from mtpgo_training.data.recording import Recording

EPOCH_NS = 1_700_000_000 * 10**9


def stamps_of(recording, *, jitter_s=0.0, seed=0):
    """Stamps (ns) of the frames, moved by up to ``jitter_s``; no two are the same."""
    rng = np.random.default_rng(seed)
    elapsed = recording.frames / recording.frame_rate
    moved = np.sort(elapsed + rng.uniform(-jitter_s, jitter_s, len(elapsed)))
    return EPOCH_NS + np.round(moved * 1e3).astype(np.int64) * 10**6 + np.arange(len(moved))


def write_bag(
    path,
    recording: Recording,
    *,
    kind="pointcloud2",
    topic="/objects",
    jitter_s=0.0,
    frame="map",
    seed=0,
    missing=(),
    pose=None,
    until_s=np.inf,
    shift_s=0.0,
    extra=None,
):
    """Write one message per frame, except in the time spans ``missing`` (s).

    With ``pose`` (time in s -> :class:`Pose2`) the objects come in the vehicle's frame, and its
    odometry is written too, up to ``until_s`` and with stamps moved by ``shift_s``.
    ``extra(bag, stamp_ns)`` writes further messages.
    """
    adapter = INPUTS[kind]
    stamps = stamps_of(recording, jitter_s=jitter_s, seed=seed)
    with McapWriter(path) as bag:
        bag.add_topic(topic, adapter.message_type)
        if pose is not None:
            bag.add_topic("/localization/odometry", "nav_msgs/msg/Odometry")
        for stamp_ns, states in zip(stamps.tolist(), recording.states(), strict=True):
            time_s = (stamp_ns - EPOCH_NS) * 1e-9
            if pose is not None:
                if time_s <= until_s:
                    moved_ns = stamp_ns + round(shift_s * 1e9)
                    odometry = odometry_message(moved_ns, pose(time_s))
                    bag.write("/localization/odometry", stamp_ns, odometry)
                states = into_vehicle(states, pose(time_s))
            if any(start <= time_s < end for start, end in missing):
                continue
            states = dataclasses.replace(
                states, stamp_ns=stamp_ns, frame_id=frame, z=np.zeros(len(states))
            )
            bag.write(topic, stamp_ns, adapter.from_states(states, bag.types))
            if extra is not None:
                extra(bag, stamp_ns)
    return path


def into_vehicle(states, pose: Pose2):
    """The states seen from a vehicle at ``pose``, velocities over ground."""
    return dataclasses.replace(
        states,
        position=pose.inverse_point(states.position),
        velocity=rotate(states.velocity, -pose.yaw),
        acceleration=rotate(states.acceleration, -pose.yaw),
        yaw=states.yaw - pose.yaw,
    )


def odometry_message(stamp_ns, pose: Pose2):
    """nav_msgs/Odometry of ``base_link`` in ``odom``."""
    get = bag_typestore().types.__getitem__

    def vector(x=0.0, y=0.0, z=0.0):
        return get("geometry_msgs/msg/Vector3")(x=x, y=y, z=z)

    return get("nav_msgs/msg/Odometry")(
        header=get("std_msgs/msg/Header")(
            stamp=get("builtin_interfaces/msg/Time")(
                sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9
            ),
            frame_id="odom",
        ),
        child_frame_id="base_link",
        pose=get("geometry_msgs/msg/PoseWithCovariance")(
            pose=get("geometry_msgs/msg/Pose")(
                position=get("geometry_msgs/msg/Point")(x=pose.x, y=pose.y, z=0.0),
                orientation=get("geometry_msgs/msg/Quaternion")(
                    x=0.0, y=0.0, z=float(np.sin(pose.yaw / 2)), w=float(np.cos(pose.yaw / 2))
                ),
            ),
            covariance=np.zeros(36),
        ),
        twist=get("geometry_msgs/msg/TwistWithCovariance")(
            twist=get("geometry_msgs/msg/Twist")(linear=vector(), angular=vector()),
            covariance=np.zeros(36),
        ),
    )
