# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sources of message classes: the installed ROS packages, or a rosbags typestore.

Adapters read messages by attribute, so reading needs no classes. Building does, and the two
families differ: rclpy classes have defaults and accept ``array.array`` fastest, rosbags classes
require every field and numpy arrays. :class:`Types` hides the difference, so the node and the
offline tools use the same builders.
"""

from __future__ import annotations

import array
import importlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import MessageError

_SOURCE_ONLY = {
    "perception_msgs": "build it from https://github.com/ika-rwth-aachen/perception_interfaces",
    "autoware_auto_perception_msgs": (
        "it was never released for Jazzy, where autoware_perception_msgs has taken its place; "
        "mtpgo convert reads its bags without it"
    ),
}
"""Packages without a release in the ROS distribution, and how to get them."""

_RELEASED = frozenset(
    {
        "ackermann_msgs",
        "autoware_perception_msgs",
        "autoware_planning_msgs",
        "derived_object_msgs",
        "diagnostic_msgs",
        "geographic_msgs",
        "geometry_msgs",
        "nav_msgs",
        "sensor_msgs",
        "shape_msgs",
        "std_msgs",
        "stereo_msgs",
        "tf2_msgs",
        "trajectory_msgs",
        "unique_identifier_msgs",
        "vision_msgs",
        "visualization_msgs",
    }
)
"""Packages known to be released for Jazzy (its index, 2026). No other is suggested: a package of
that name may not exist."""

# Kinds of a field definition, as numbered by rosbags.
_BASE, _NAME, _ARRAY, _SEQUENCE = 1, 2, 3, 4


class Types(ABC):
    """Maker of messages by type name, for instance ``geometry_msgs/msg/Point``."""

    @abstractmethod
    def message_class(self, name: str) -> type:
        """Return the class of a message type.

        Raises:
            MessageError: the type is not available; the message says what to install.
        """

    @abstractmethod
    def make(self, name: str, /, **values: Any) -> Any:
        """Return a message with ``values`` set and every other field at its ROS default."""

    @abstractmethod
    def octets(self, data: NDArray[np.uint8] | bytes) -> Any:
        """Return the content of a ``uint8[]`` field."""

    @abstractmethod
    def small_integers(self, data: NDArray[np.int8]) -> Any:
        """Return the content of an ``int8[]`` field."""

    @abstractmethod
    def doubles(self, values: Iterable[float]) -> Any:
        """Return the content of a ``float64[]`` field."""


class RclpyTypes(Types):
    """Classes of the message packages installed for rclpy, imported at first use."""

    def __init__(self) -> None:
        self._classes: dict[str, type] = {}

    def message_class(self, name: str) -> type:  # noqa: D102 (inherited)
        found = self._classes.get(name)
        if found is None:
            found = self._classes[name] = _import_class(name)
        return found

    def make(self, name: str, /, **values: Any) -> Any:  # noqa: D102 (inherited)
        return self.message_class(name)(**values)

    def octets(self, data: NDArray[np.uint8] | bytes) -> Any:  # noqa: D102 (inherited)
        # A uint8 array assigned as it is would be checked element by element.
        return array.array("B", data if isinstance(data, bytes) else data.tobytes())

    def small_integers(self, data: NDArray[np.int8]) -> Any:  # noqa: D102 (inherited)
        return array.array("b", data.tobytes())

    def doubles(self, values: Iterable[float]) -> Any:  # noqa: D102 (inherited)
        return array.array("d", values)


class TypestoreTypes(Types):
    """Classes of a rosbags typestore, so bags can be written where ROS is not installed.

    Args:
        typestore: anything with the ``types`` and ``fielddefs`` of ``rosbags.typesys.Typestore``,
            with :data:`msg_adapters.wire.definitions.DEFINITIONS` registered where messages of
            packages beyond the common interfaces are to be built.
    """

    def __init__(self, typestore: Any) -> None:
        self._types = typestore.types
        self._fielddefs = typestore.fielddefs
        self._defaults: dict[str, dict[str, Callable[[], Any]]] = {}

    def message_class(self, name: str) -> type:  # noqa: D102 (inherited)
        try:
            found: type = self._types[name]
        except KeyError:
            raise MessageError(
                f"message type {name!r} is not in the typestore: register its definition "
                "(msg_adapters.wire.definitions) before messages of it are built"
            ) from None
        return found

    def make(self, name: str, /, **values: Any) -> Any:  # noqa: D102 (inherited)
        message_class = self.message_class(name)
        for field, default in self._defaults_of(name).items():
            if field not in values:
                values[field] = default()
        return message_class(**values)

    def octets(self, data: NDArray[np.uint8] | bytes) -> Any:  # noqa: D102 (inherited)
        return np.frombuffer(data, dtype=np.uint8)

    def small_integers(self, data: NDArray[np.int8]) -> Any:  # noqa: D102 (inherited)
        return np.ascontiguousarray(data, dtype=np.int8).reshape(-1)

    def doubles(self, values: Iterable[float]) -> Any:  # noqa: D102 (inherited)
        return np.fromiter(values, dtype=np.float64)

    def _defaults_of(self, name: str) -> dict[str, Callable[[], Any]]:
        found = self._defaults.get(name)
        if found is None:
            fields = self._fielddefs[name][1]
            found = {field: self._default(kind, content) for field, (kind, content) in fields}
            if name == "geometry_msgs/msg/Quaternion":
                found["w"] = lambda: 1.0
            self._defaults[name] = found
        return found

    def _default(self, kind: int, content: Any) -> Callable[[], Any]:
        if kind == _NAME:
            return lambda: self.make(content)
        if kind == _BASE:
            value = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}.get(
                content[0], 0
            )
            return lambda: value
        (inner_kind, inner), length = content
        if inner_kind != _BASE or inner[0] == "string":
            if kind == _SEQUENCE:
                return list
            inner_default = self._default(inner_kind, inner)
            return lambda: [inner_default() for _ in range(length)]
        count = length if kind == _ARRAY else 0
        return lambda: np.zeros(count, dtype=inner[0])


def message_class(name: str) -> type:
    """Return the installed rclpy class of a type, for instance ``vision_msgs/msg/BoundingBox3D``.

    Raises:
        MessageError: the package is not installed (the message says what to install) or has no
            such message.
    """
    return _import_class(name)


def install_hint(package: str) -> str:
    """Return how to get a message package, for instance ``install ros-jazzy-...``."""
    if package in _RELEASED:
        return f"install ros-jazzy-{package.replace('_', '-')}"
    return _SOURCE_ONLY.get(package, "build it from source, in the workspace that you source")


def _import_class(name: str) -> type:
    package, _, rest = name.partition("/")
    kind, _, short = rest.rpartition("/")
    if not package or not short or kind not in ("", "msg"):
        raise MessageError(f"{name!r} is not a message type, expected for instance 'pkg/msg/Name'")
    try:
        module = importlib.import_module(f"{package}.msg")
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.split(".")[0] != package:
            raise
        raise MessageError(
            f"message type {name!r} needs the package {package}, which is not installed: "
            f"{install_hint(package)}"
        ) from None
    found: type | None = getattr(module, short, None)
    if found is None:
        raise MessageError(f"the installed package {package} has no message {short!r}")
    return found
