# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The supported message kinds, by name and by message type."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from msg_adapters.adapter import InputAdapter
from msg_adapters.inputs.autoware import AUTOWARE
from msg_adapters.inputs.autoware_auto import AUTOWARE_AUTO
from msg_adapters.inputs.derived_objects import DERIVED
from msg_adapters.inputs.detections import VISION
from msg_adapters.inputs.ika import IKA
from msg_adapters.inputs.object_cloud import POINTCLOUD2
from msg_adapters.inputs.object_markers import MARKERS
from msg_adapters.outputs.autoware_predictions import (
    prediction_to_predicted_objects,
    prediction_to_predicted_objects_bytes,
)
from msg_adapters.outputs.marker_tracker import MarkerTracker
from msg_adapters.outputs.prediction_markers import (
    MarkerStyle,
    prediction_to_marker_bytes,
    prediction_to_markers,
)
from msg_adapters.predictions import prediction_to_pointcloud2
from msg_adapters.types import Types
from mtpgo_core.errors import ConfigurationError, MessageError
from mtpgo_core.schema import Prediction

Writer = Callable[[Prediction], Any]
"""Makes a message, or its bytes, from a prediction; to be called from one thread at a time."""


@dataclass(frozen=True)
class OutputAdapter:
    """One kind of prediction message.

    Attributes:
        name: short name, for instance ``markers``.
        message_type: ROS type.
        make_writer: makes a writer of messages, (types, max_modes) -> writer.
        make_byte_writer: makes a faster writer of serialised messages, (max_modes) -> writer; None
            where message objects are as fast.
    """

    name: str
    message_type: str
    make_writer: Callable[[Types, int | None], Writer]
    make_byte_writer: Callable[[int | None], Writer] | None = None

    @property
    def package(self) -> str:
        """Message package that must be installed to publish this type."""
        return self.message_type.partition("/")[0]

    def writer(
        self, types: Types, *, max_modes: int | None = None, serialized: bool = False
    ) -> Writer:
        """Return a function from prediction to message; the one for markers keeps a state.

        Args:
            types: source of message classes.
            max_modes: the heaviest modes to keep, renormalised; None keeps all.
            serialized: write CDR bytes where that is much faster; rclpy publishers accept both.

        Raises:
            MessageError: the message package is not available.
        """
        types.message_class(self.message_type)
        if serialized and self.make_byte_writer is not None:
            return self.make_byte_writer(max_modes)
        return self.make_writer(types, max_modes)


INPUTS: dict[str, InputAdapter] = {
    adapter.name: adapter
    for adapter in (POINTCLOUD2, AUTOWARE, VISION, DERIVED, MARKERS, IKA, AUTOWARE_AUTO)
}
"""The supported messages of tracked objects, by short name."""


def input_adapter(name: str) -> InputAdapter:
    """Return the input adapter of a short name.

    Raises:
        ConfigurationError: an unknown name; the message lists the names.
    """
    try:
        return INPUTS[name]
    except KeyError:
        raise ConfigurationError(
            f"input type is {name!r}, expected one of {', '.join(map(repr, INPUTS))}"
        ) from None


def adapter_for_type(message_type: str) -> InputAdapter:
    """Return the adapter of a message type, written ``pkg/msg/Name`` or ``pkg/Name``.

    Raises:
        MessageError: no adapter reads that type; the message lists the types.
    """
    package, _, rest = message_type.partition("/")
    full = f"{package}/msg/{rest.removeprefix('msg/')}"
    for adapter in INPUTS.values():
        if adapter.message_type == full:
            return adapter
    readable = ", ".join(adapter.message_type for adapter in INPUTS.values())
    raise MessageError(
        f"message type {message_type!r} carries no tracked objects that can be read, expected "
        f"one of {readable}"
    )


def output_adapter(name: str) -> OutputAdapter:
    """Return the output adapter of a short name.

    Raises:
        ConfigurationError: an unknown name; the message lists the names.
    """
    try:
        return OUTPUTS[name]
    except KeyError:
        raise ConfigurationError(
            f"output is {name!r}, expected one of {', '.join(map(repr, OUTPUTS))}"
        ) from None


def _cloud_writer(types: Types, max_modes: int | None) -> Writer:
    return lambda prediction: prediction_to_pointcloud2(prediction, types, max_modes=max_modes)


def _autoware_writer(types: Types, max_modes: int | None) -> Writer:
    return lambda prediction: prediction_to_predicted_objects(
        prediction, types, max_modes=max_modes
    )


def _autoware_byte_writer(max_modes: int | None) -> Writer:
    return lambda prediction: prediction_to_predicted_objects_bytes(
        prediction, max_modes=max_modes
    )


def _marker_byte_writer(max_modes: int | None) -> Writer:
    tracker, style = MarkerTracker(), MarkerStyle()
    return lambda prediction: prediction_to_marker_bytes(
        prediction, tracker, max_modes=max_modes, style=style
    )


def _marker_writer(types: Types, max_modes: int | None) -> Writer:
    tracker, style = MarkerTracker(), MarkerStyle()
    return lambda prediction: prediction_to_markers(
        prediction, types, tracker, max_modes=max_modes, style=style
    )


OUTPUTS: dict[str, OutputAdapter] = {
    adapter.name: adapter
    for adapter in (
        OutputAdapter("pointcloud2", POINTCLOUD2.message_type, _cloud_writer),
        OutputAdapter("markers", MARKERS.message_type, _marker_writer, _marker_byte_writer),
        OutputAdapter(
            "autoware",
            "autoware_perception_msgs/msg/PredictedObjects",
            _autoware_writer,
            _autoware_byte_writer,
        ),
    )
}
"""The messages in which predictions can be published, by short name."""
