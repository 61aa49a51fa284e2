# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""visualization_msgs/MarkerArray as input: one CUBE or CYLINDER per object.

Namespace and id together identify the track; the namespace, or the marker's text, may name the
class. There is no velocity; the core estimates it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from msg_adapters.adapter import Decoded, InputAdapter
from msg_adapters.conversions import (
    known,
    make_header,
    make_pose,
    make_vector,
    pose_row,
    positive,
    stamp_to_ns,
    table,
    yaw_from_quaternions,
)
from msg_adapters.types import Types
from msg_adapters.wire.input_limits import Content
from mtpgo_core.errors import MessageError
from mtpgo_core.identity import keys_from_strings
from mtpgo_core.schema import AgentClass, KeyArray, TrackedStates, tracked_states

_CUBE, _CYLINDER = 1, 3
_ADD, _DELETE, _DELETE_ALL = 0, 2, 3
_KEY_NAMESPACE = "key:"
_WORD = 0xFFFFFFFF


def marker_keys(namespaces: Sequence[str], ids: Sequence[int]) -> KeyArray:
    """Return [n, 4] keys: word id_0 is the marker's id, the others encode its namespace.

    An empty namespace gives zeros, so the key is the id itself; any other is hashed, except one
    in which :func:`states_to_markers` wrote a longer key.
    """
    words = {namespace: _namespace_words(namespace) for namespace in set(namespaces)}
    rows = [
        (int(number) & _WORD, *words[namespace])
        for namespace, number in zip(namespaces, ids, strict=True)
    ]
    return np.array(rows, dtype=np.uint32).reshape(-1, 4)


def decode_markers(
    message: Any, *, twist_frame: str = "none", fallback_stamp_ns: int | None = None
) -> Decoded:
    """Return the tracked states of a MarkerArray, in the order of their first appearance.

    Actions are followed in order, as in a display: a marker deleted later in the same array is not
    an object. Deletions are reported; the history does not need them.

    Args:
        message: ``visualization_msgs/MarkerArray``.
        twist_frame: not used, there are no velocities.
        fallback_stamp_ns: time of receipt (ns), used where no object has a stamp: markers
            may be published with stamp zero ("now"), and an empty array has no header at all.

    Raises:
        MessageError: the objects are in different frames, or there is no time.
    """
    boxes: dict[tuple[str, int], Any] = {}
    removed: dict[tuple[str, int], None] = {}
    skipped = Counter[str]()
    cleared = False
    for marker in message.markers:
        name = (str(marker.ns), int(marker.id))
        action, kind = int(marker.action), int(marker.type)
        if action == _DELETE_ALL:
            boxes.clear()
            removed.clear()
            cleared = True
        elif action == _DELETE:
            boxes.pop(name, None)
            removed[name] = None
        elif action != _ADD:
            skipped[f"marker with action {action}"] += 1
        elif kind not in (_CUBE, _CYLINDER):
            skipped[f"marker of type {kind}, neither CUBE nor CYLINDER"] += 1
        else:
            removed.pop(name, None)
            boxes[name] = marker
    markers = list(boxes.values())
    pose = table([pose_row(marker.pose) for marker in markers], 7)
    names = [(str(marker.ns), str(marker.text)) for marker in markers]
    states = tracked_states(
        _newest_stamp_ns(markers or message.markers, fallback_stamp_ns),
        _common_frame(markers),
        marker_keys([ns for ns, _ in boxes], [number for _, number in boxes]),
        pose[:, :2],
        agent_class=np.array([_agent_class(*pair) for pair in names], dtype=np.uint8),
        z=pose[:, 2],
        yaw=yaw_from_quaternions(pose[:, 3:]),
        size=positive(table([(marker.scale.x, marker.scale.y) for marker in markers], 2)),
    )
    gone = marker_keys([ns for ns, _ in removed], [number for _, number in removed])
    return Decoded(states, skipped, gone, cleared, names)


def states_to_markers(states: TrackedStates, types: Types) -> Any:
    """Return a MarkerArray of one CUBE per object; the text names the class.

    A key of one word is the marker's id with an empty namespace.
    """
    header = make_header(types, states.stamp_ns, states.frame_id)
    markers = []
    for i in range(len(states)):
        low, *high = (int(word) for word in states.key[i])
        length, width = states.size[i]
        markers.append(
            types.make(
                "visualization_msgs/msg/Marker",
                header=header,
                ns=_KEY_NAMESPACE + "".join(f"{word:08x}" for word in high) if any(high) else "",
                id=low - (1 << 32) if low >= 1 << 31 else low,
                type=_CUBE,
                action=_ADD,
                pose=make_pose(types, states.position[i], states.z[i], states.yaw[i]),
                scale=make_vector(types, known(length), known(width)),
                color=types.make("std_msgs/msg/ColorRGBA", r=0.6, g=0.6, b=0.6, a=0.8),
                text=AgentClass(int(states.agent_class[i])).name.lower(),
            )
        )
    return types.make("visualization_msgs/msg/MarkerArray", markers=markers)


def _namespace_words(namespace: str) -> tuple[int, ...]:
    if namespace == "":
        return 0, 0, 0
    digits = namespace.removeprefix(_KEY_NAMESPACE)
    if len(digits) == 24 and len(namespace) == 24 + len(_KEY_NAMESPACE):
        try:
            return tuple(int(digits[i : i + 8], 16) for i in (0, 8, 16))
        except ValueError:
            pass
    return tuple(int(word) for word in keys_from_strings([namespace])[0, 1:])


def _agent_class(namespace: str, text: str) -> int:
    """Return the class that a marker names; without a class map numbers in it are no classes."""
    named = AgentClass.from_name(namespace)
    return int(named if named != AgentClass.UNKNOWN else AgentClass.from_name(text))


def _newest_stamp_ns(markers: Sequence[Any], fallback_stamp_ns: int | None) -> int:
    newest = max((stamp_to_ns(marker.header.stamp) for marker in markers), default=0)
    if newest > 0:
        return newest
    if fallback_stamp_ns is not None:
        return fallback_stamp_ns
    if markers:
        return newest
    raise MessageError("MarkerArray is empty, so nothing in it says the time of the observation")


def _common_frame(markers: Sequence[Any]) -> str:
    frames = {str(marker.header.frame_id): None for marker in markers}
    if len(frames) > 1:
        raise MessageError(
            f"MarkerArray has objects in the frames {', '.join(map(repr, frames))}, expected one"
        )
    return next(iter(frames), "")


MARKERS = InputAdapter(
    name="markers",
    message_type="visualization_msgs/msg/MarkerArray",
    twist_frame="none",
    content=Content("markers", 200, has_header=False),
    decoder=decode_markers,
    builder=states_to_markers,
)
