# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""autoware_auto_perception_msgs/TrackedObjects, Autoware's message before 2024.

The package was never released for Jazzy, but its bags are many. The fields are those of
autoware_perception_msgs under the same names; on the wire ``orientation_availability`` comes after
the pose instead of after the acceleration, so the bytes of one cannot be read as the other.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.inputs.autoware import AUTOWARE, PACKAGE, states_to_tracked_objects
from msg_adapters.types import Types
from mtpgo_core.schema import TrackedStates

PACKAGE_AUTO = "autoware_auto_perception_msgs/msg/"


class _RenamedTypes(Types):
    """Makes the messages of the later package by their names in the earlier one."""

    def __init__(self, types: Types) -> None:
        self._types = types

    def message_class(self, name: str) -> type:
        return self._types.message_class(name.replace(PACKAGE, PACKAGE_AUTO))

    def make(self, name: str, /, **values: Any) -> Any:
        return self._types.make(name.replace(PACKAGE, PACKAGE_AUTO), **values)

    def octets(self, data: NDArray[np.uint8] | bytes) -> Any:
        return self._types.octets(data)

    def small_integers(self, data: NDArray[np.int8]) -> Any:
        return self._types.small_integers(data)

    def doubles(self, values: Iterable[float]) -> Any:
        return self._types.doubles(values)


def states_to_auto_objects(states: TrackedStates, types: Types) -> Any:
    """Return a TrackedObjects message of the earlier package."""
    return states_to_tracked_objects(states, _RenamedTypes(types))


AUTOWARE_AUTO = dataclasses.replace(
    AUTOWARE,
    name="autoware_auto",
    message_type=PACKAGE_AUTO + "TrackedObjects",
    builder=states_to_auto_objects,
)
