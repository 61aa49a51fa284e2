# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The adapter of a message type of tracked objects: decoding and building.

An adapter reads by attribute only, so it accepts objects decoded by rclpy, rosbags or
mcap-ros2-support, and reading imports no message package.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from msg_adapters.conversions import choose_twist_frame, reading
from msg_adapters.types import Types
from msg_adapters.wire.input_limits import (
    DEFAULT_LIMITS,
    Content,
    InputLimits,
    check_frame,
    check_serialized,
)
from mtpgo_core.class_map import OWN_NAMES, ClassMap
from mtpgo_core.schema import AgentClass, ClassArray, KeyArray, TrackedStates


@dataclass(frozen=True)
class Decoded:
    """The content of one message.

    Attributes:
        states: the tracked objects.
        skipped: number of objects left out, by reason.
        removed: [k, 4] keys of tracks that the message deletes.
        cleared: the message deletes all earlier tracks.
        class_names: [n] what the message calls the class of each object, the names to be looked
            up one after the other; None where the type of the message defines its classes.
    """

    states: TrackedStates
    skipped: Mapping[str, int] = field(default_factory=Counter)
    removed: KeyArray = field(default_factory=lambda: np.empty((0, 4), dtype=np.uint32))
    cleared: bool = False
    class_names: Sequence[Sequence[str]] | None = None

    @property
    def skipped_total(self) -> int:
        """Number of objects left out."""
        return sum(self.skipped.values())


class MessageDecoder(Protocol):
    """Reads a message; see :meth:`InputAdapter.decode` for the arguments."""

    def __call__(
        self, message: Any, *, twist_frame: str, fallback_stamp_ns: int | None
    ) -> Decoded:
        """Return the content of the message."""


@dataclass(frozen=True)
class InputAdapter:
    """One kind of tracked-object message.

    Attributes:
        name: short name, for instance ``autoware``.
        message_type: ROS type, for instance ``autoware_perception_msgs/msg/TrackedObjects``.
        twist_frame: frame in which this message's publishers express velocities, ``object`` or
            ``header``; ``none`` where the message has no velocity.
        content: where its objects are, to count them before they are read.
        decoder: the reading function.
        builder: the writing function, (states, types) -> message.
    """

    name: str
    message_type: str
    twist_frame: str
    content: Content
    decoder: MessageDecoder
    builder: Callable[[TrackedStates, Types], Any]

    @property
    def package(self) -> str:
        """Message package that must be installed to subscribe to this type."""
        return self.message_type.partition("/")[0]

    def decode(
        self,
        message: Any,
        *,
        twist_frame: str = "default",
        fallback_stamp_ns: int | None = None,
        class_map: ClassMap = OWN_NAMES,
        limits: InputLimits = DEFAULT_LIMITS,
    ) -> Decoded:
        """Return the content of a message.

        Args:
            message: decoded message of :attr:`message_type`.
            twist_frame: ``default`` (what publishers of this type do), ``object`` or ``header``.
            fallback_stamp_ns: time of receipt (ns), used where the message has no time (a
                MarkerArray without objects).
            class_map: our classes by the names in the message, where it has names.
            limits: the most objects and fields that are read.

        Raises:
            MessageError: the message is malformed or too large (the topic is added by the caller).
            ConfigurationError: ``twist_frame`` is not one of the three.
        """
        frame = choose_twist_frame(twist_frame, self.twist_frame)
        with reading(message, self.message_type):
            self._check(message, limits)
            decoded = self.decoder(message, twist_frame=frame, fallback_stamp_ns=fallback_stamp_ns)
        check_frame(decoded.states.frame_id)
        if class_map is OWN_NAMES or decoded.class_names is None:
            return decoded
        found = [class_map.find(*names) for names in decoded.class_names]
        states = replace(decoded.states, agent_class=np.array(found, dtype=np.uint8))
        return replace(decoded, states=states)

    def check_serialized(self, data: bytes, limits: InputLimits) -> None:
        """Check the bytes of a message before they are decoded, in constant time.

        Raises:
            MessageError: it is too large, cut off or contradicts itself.
        """
        check_serialized(data, self.content, limits)

    def _check(self, message: Any, limits: InputLimits) -> None:
        if self.content.name:
            limits.check_objects(len(getattr(message, self.content.name)))
        else:
            limits.check_objects(int(message.height) * int(message.width))
            limits.check_fields(len(message.fields))

    def to_states(
        self,
        message: Any,
        *,
        twist_frame: str = "default",
        fallback_stamp_ns: int | None = None,
        class_map: ClassMap = OWN_NAMES,
    ) -> TrackedStates:
        """Return the tracked objects only; arguments and errors as in :meth:`decode`."""
        return self.decode(
            message,
            twist_frame=twist_frame,
            fallback_stamp_ns=fallback_stamp_ns,
            class_map=class_map,
        ).states

    def from_states(self, states: TrackedStates, types: Types) -> Any:
        """Return a message that decodes to ``states``, as far as its type can represent them.

        Raises:
            MessageError: the package is not available, or an identity does not fit the message.
        """
        return self.builder(states, types)


def known_classes(labels: np.ndarray) -> ClassArray:
    """Return [n] uint8 agent classes; unknown labels become ``UNKNOWN``."""
    labels = np.asarray(labels)
    inside = (labels >= 0) & (labels <= max(AgentClass))
    return np.where(inside, labels, AgentClass.UNKNOWN).astype(np.uint8)
