# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""vision_msgs/Detection3DArray: boxes without velocity; the core estimates it.

The ``id`` identifies the track. A detection with an empty id belongs to no track and is left out;
the output of a detector without a tracker cannot be predicted from.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from msg_adapters.adapter import Decoded, InputAdapter
from msg_adapters.conversions import (
    flat36,
    known,
    make_header,
    make_pose,
    make_vector,
    most_probable,
    planar_block,
    pose_row,
    positive,
    stamp_to_ns,
    state_covariance,
    table,
    yaw_from_quaternions,
)
from msg_adapters.types import Types
from msg_adapters.wire.input_limits import Content
from mtpgo_core.class_map import OWN_NAMES
from mtpgo_core.identity import key_to_int, keys_from_texts
from mtpgo_core.schema import AgentClass, TrackedStates, tracked_states

PACKAGE = "vision_msgs/msg/"
_NO_COVARIANCE = (np.nan,) * 4


def decode_detections(
    message: Any, *, twist_frame: str = "none", fallback_stamp_ns: int | None = None
) -> Decoded:
    """Return the tracked states of a Detection3DArray.

    Args:
        message: ``vision_msgs/Detection3DArray``; its header holds for every detection.
        twist_frame: not used, there are no velocities.
        fallback_stamp_ns: not needed, the message carries its time.
    """
    tracked = [item for item in message.detections if _track(item)]
    skipped = Counter[str]()
    if len(tracked) < len(message.detections):
        skipped["detection without an id"] = len(message.detections) - len(tracked)
    boxes = [item.bbox for item in tracked]
    best = [most_probable(item.results, _score) for item in tracked]
    names = ["" if b is None else _class_name(b) for b in best]
    pose = table([pose_row(box.center) for box in boxes], 7)
    position_covariance = table(
        [planar_block(b.pose.covariance) if b is not None else _NO_COVARIANCE for b in best], 4
    ).reshape(-1, 2, 2)
    yaw = yaw_from_quaternions(pose[:, 3:])
    states = tracked_states(
        stamp_to_ns(message.header.stamp),
        str(message.header.frame_id),
        keys_from_texts([_track(item) for item in tracked]),
        pose[:, :2],
        agent_class=OWN_NAMES.find_all(names),
        z=pose[:, 2],
        yaw=yaw,
        size=positive(table([(box.size.x, box.size.y) for box in boxes], 2)),
        covariance=state_covariance(
            position_covariance, np.full_like(position_covariance, np.nan), yaw, "header"
        ),
    )
    return Decoded(states, skipped, class_names=[(name,) for name in names])


def states_to_detections(states: TrackedStates, types: Types) -> Any:
    """Return a Detection3DArray; the id is the key as a decimal number, the class its name."""
    header = make_header(types, states.stamp_ns, states.frame_id)
    detections = []
    for i in range(len(states)):
        pose = make_pose(types, states.position[i], states.z[i], states.yaw[i])
        result = types.make(
            PACKAGE + "ObjectHypothesisWithPose",
            hypothesis=types.make(
                PACKAGE + "ObjectHypothesis",
                class_id=AgentClass(int(states.agent_class[i])).name.lower(),
                score=1.0,
            ),
            pose=types.make(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=pose,
                covariance=flat36(states.covariance[i, :2, :2]),
            ),
        )
        length, width = states.size[i]
        box = types.make(
            PACKAGE + "BoundingBox3D",
            center=pose,
            size=make_vector(types, known(length), known(width)),
        )
        detections.append(
            types.make(
                PACKAGE + "Detection3D",
                header=header,
                results=[result],
                bbox=box,
                id=str(key_to_int(states.key[i])),
            )
        )
    return types.make(PACKAGE + "Detection3DArray", header=header, detections=detections)


def _track(item: Any) -> str:
    """Return the name of a detection's track, empty without one."""
    if hasattr(item, "id"):
        return str(item.id)
    # Recorded with vision_msgs 2.x; the versions between had no track at all.
    return str(getattr(item, "tracking_id", ""))


def _class_name(result: Any) -> str:
    found = getattr(result, "hypothesis", result)  # vision_msgs 2.x
    return str(found.class_id if hasattr(found, "class_id") else found.id)


def _score(result: Any) -> float:
    return float(getattr(result, "hypothesis", result).score)


VISION = InputAdapter(
    name="vision",
    message_type=PACKAGE + "Detection3DArray",
    twist_frame="none",
    content=Content("detections", 100),
    decoder=decode_detections,
    builder=states_to_detections,
)
