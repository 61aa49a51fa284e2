# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""perception_msgs/ObjectList of the ika perception interfaces, models ISCACTR and HEXAMOTION.

Velocity and acceleration are longitudinal and lateral in the OBJECT frame. A covariance diagonal
of -1 marks a value that is not set, the largest double a value with unknown covariance.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from msg_adapters.adapter import Decoded, InputAdapter
from msg_adapters.conversions import (
    finite,
    make_header,
    most_probable,
    positive,
    rotate,
    small_integer_keys,
    stamp_to_ns,
    table,
    to_header_frame,
    turn_velocity,
)
from msg_adapters.types import Types
from msg_adapters.wire.input_limits import Content
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass, Float64Array, TrackedStates, tracked_states

PACKAGE = "perception_msgs/msg/"
NOT_SET = -1.0
COVARIANCE_UNKNOWN = sys.float_info.max


@dataclass(frozen=True)
class StateModel:
    """Indices of the values read from one model's ``continuous_state``.

    Attributes:
        name: the model's name.
        size: length of the vector.
        yaw: index of the yaw. length, width: indices of the box's.

    x, y, z, vel_lon, vel_lat, acc_lon, acc_lat come first in both models.
    """

    name: str
    size: int
    yaw: int
    length: int
    width: int

    @property
    def columns(self) -> list[int]:
        """Indices of x, y, z, vel_lon, vel_lat, acc_lon, acc_lat, yaw, length, width."""
        return [0, 1, 2, 3, 4, 5, 6, self.yaw, self.length, self.width]


MODELS = {
    16: StateModel("ISCACTR", size=12, yaw=7, length=10, width=9),
    17: StateModel("HEXAMOTION", size=16, yaw=9, length=13, width=14),
}
_WRITTEN_MODEL = 16
_GEOMETRIC_CENTRE = 0
_COVARIANCE_COLUMNS = [0, 1, 3, 4]

_CLASSES = {
    1: AgentClass.PEDESTRIAN,
    2: AgentClass.BICYCLE,
    3: AgentClass.MOTORCYCLE,
    4: AgentClass.CAR,
    5: AgentClass.TRUCK,
    6: AgentClass.VAN,
    7: AgentClass.BUS,
    8: AgentClass.ANIMAL,
    11: AgentClass.TRAILER,
    12: AgentClass.PEDESTRIAN,  # VRU: wheelchairs and strollers, on sidewalks
    13: AgentClass.BICYCLE,  # MICRO: kick scooters and the like, on cycle lanes or the road
    50: AgentClass.CAR,
    51: AgentClass.TRUCK,
}
_LABELS = {int(ours): label for label, ours in reversed(_CLASSES.items()) if label < 50}
"""Of several labels of a class the first."""


def decode_object_list(
    message: Any, *, twist_frame: str = "object", fallback_stamp_ns: int | None = None
) -> Decoded:
    """Return the tracked states of an ObjectList, without objects of other state models.

    Args:
        message: ``perception_msgs/ObjectList``; its header holds for every object.
        twist_frame: ``object`` as defined by the message, or ``header``.
        fallback_stamp_ns: not needed, the message carries its time.
    """
    skipped = Counter[str]()
    kept = []
    for item in message.objects:
        reason = _unreadable(item.state)
        if reason:
            skipped[reason] += 1
        else:
            kept.append(item)
    values, covariance = _read_states([item.state for item in kept])
    offset = table([_to_centre(item.state.reference_point) for item in kept], 3)
    yaw = values[:, 7]
    # Without a heading, the point itself is nearer to the centre than one shifted anywhere.
    shift = np.where(np.isfinite(yaw)[:, None], rotate(offset[:, :2], yaw), 0.0)
    turned = yaw if twist_frame == "object" else np.zeros_like(yaw)
    states = tracked_states(
        stamp_to_ns(message.header.stamp),
        str(message.header.frame_id),
        keys_from_integers([int(item.id) for item in kept]),
        values[:, :2] + shift,
        agent_class=np.array([_agent_class(item.state) for item in kept], dtype=np.uint8),
        z=values[:, 2] + offset[:, 2],
        velocity=to_header_frame(values[:, 3:5], yaw, twist_frame),
        acceleration=to_header_frame(values[:, 5:7], yaw, twist_frame),
        yaw=yaw,
        size=positive(values[:, 8:]),
        covariance=turn_velocity(covariance, turned),
    )
    return Decoded(states, skipped)


def states_to_object_list(states: TrackedStates, types: Types) -> Any:
    """Return an ObjectList of model ISCACTR; unknown values are marked as not set.

    Raises:
        MessageError: a key does not fit into the message's uint64 id.
    """
    model = MODELS[_WRITTEN_MODEL]
    header = make_header(types, states.stamp_ns, states.frame_id)
    ids = small_integer_keys(states.key, 64, "perception_msgs/Object")
    values = np.full((len(states), model.size), np.nan)
    values[:, model.columns] = np.column_stack(
        [
            states.position,
            states.z,
            rotate(states.velocity, -states.yaw),
            rotate(states.acceleration, -states.yaw),
            states.yaw,
            states.size,
        ]
    )
    covariance = turn_velocity(states.covariance, -states.yaw)
    objects = []
    for i, number in enumerate(ids):
        state = types.make(
            PACKAGE + "ObjectState",
            header=header,
            model_id=_WRITTEN_MODEL,
            continuous_state=types.doubles(np.nan_to_num(values[i], nan=0.0).tolist()),
            continuous_state_covariance=types.doubles(
                _write_covariance(values[i], covariance[i]).tolist()
            ),
            classifications=[
                types.make(
                    PACKAGE + "ObjectClassification",
                    type=_LABELS.get(int(states.agent_class[i]), 0),
                    probability=1.0,
                )
            ],
        )
        objects.append(
            types.make(PACKAGE + "Object", id=number, existence_probability=1.0, state=state)
        )
    return types.make(PACKAGE + "ObjectList", header=header, objects=objects)


def _unreadable(state: Any) -> str:
    model = MODELS.get(int(state.model_id))
    if model is None:
        return f"state model {int(state.model_id)}, neither 16 (ISCACTR) nor 17 (HEXAMOTION)"
    found = len(state.continuous_state)
    if found != model.size:
        return f"continuous_state of {found} values, {model.name} has {model.size}"
    found = len(state.continuous_state_covariance)
    if found not in (0, model.size**2):
        return f"continuous_state_covariance of {found} values, {model.name} has {model.size**2}"
    return ""


def _to_centre(reference: Any) -> tuple[float, float, float]:
    """Return the vector from reference point to box centre, along the object's axes (m)."""
    if int(reference.value) == _GEOMETRIC_CENTRE:
        return 0.0, 0.0, 0.0
    shift = reference.translation_to_geometric_center
    return shift.x, shift.y, shift.z


def _read_states(states: list[Any]) -> tuple[Float64Array, Float64Array]:
    """Return [n, 10] ``StateModel.columns``; [n, 4, 4] covariance of x, y, vel_lon, vel_lat."""
    values = np.full((len(states), 10), np.nan)
    covariance = np.full((len(states), 4, 4), np.nan)
    models = np.array([int(state.model_id) for state in states], dtype=np.int64)
    for number, model in MODELS.items():
        where = np.flatnonzero(models == number)
        chosen = [states[i] for i in where]
        if not chosen:
            continue
        vector = finite(np.array([state.continuous_state for state in chosen]))
        unfilled = np.full(model.size**2, COVARIANCE_UNKNOWN)
        given = [state.continuous_state_covariance for state in chosen]
        matrix = np.array([row if len(row) else unfilled for row in given], dtype=np.float64)
        matrix = matrix.reshape(-1, model.size, model.size)
        variances = np.diagonal(matrix, axis1=1, axis2=2)
        vector[variances == NOT_SET] = np.nan
        values[where] = vector[:, model.columns]
        block = matrix[:, _COVARIANCE_COLUMNS][:, :, _COVARIANCE_COLUMNS]
        known = ((variances > 0.0) & (variances < COVARIANCE_UNKNOWN))[:, _COVARIANCE_COLUMNS]
        covariance[where] = np.where(known[:, :, None] & known[:, None, :], block, np.nan)
    return values, finite(covariance)


def _write_covariance(values: Float64Array, covariance: Float64Array) -> Float64Array:
    size = len(values)
    matrix = np.zeros((size, size))
    known = np.isfinite(covariance)
    matrix[np.ix_(_COVARIANCE_COLUMNS, _COVARIANCE_COLUMNS)] = np.where(known, covariance, 0.0)
    unknown = np.ones(size, dtype=bool)
    unknown[_COVARIANCE_COLUMNS] = ~np.diagonal(known)
    diagonal = np.einsum("ii->i", matrix)
    diagonal[unknown] = COVARIANCE_UNKNOWN
    diagonal[~np.isfinite(values)] = NOT_SET
    return matrix.reshape(-1)


def _agent_class(state: Any) -> int:
    best = most_probable(state.classifications, lambda item: item.probability)
    if best is None:
        return int(AgentClass.UNKNOWN)
    return int(_CLASSES.get(int(best.type), AgentClass.UNKNOWN))


IKA = InputAdapter(
    name="ika",
    message_type=PACKAGE + "ObjectList",
    twist_frame="object",
    content=Content("objects", 80),
    decoder=decode_object_list,
    builder=states_to_object_list,
)
