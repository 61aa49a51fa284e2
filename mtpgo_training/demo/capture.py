# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What ``record`` wrote: observations, predictions and diagnostics, each with its receipt."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from msg_adapters.conversions import stamp_to_ns
from msg_adapters.predictions import prediction_from_pointcloud2
from mtpgo_core.schema import Prediction
from mtpgo_training.data.recording_bag import OBJECTS_TOPIC, open_bag

PREDICTIONS = "/predictor/predictions"
PROCESSING, DIAGNOSTICS = "/predictor/debug/processing_time_ms", "/diagnostics"

TOPICS = (OBJECTS_TOPIC, PREDICTIONS, PROCESSING, DIAGNOSTICS)
"""All that the demo has recorded."""


@dataclass(frozen=True)
class Received:
    """A prediction and the wall clock at its receipt (ns)."""

    prediction: Prediction
    received_ns: int


@dataclass
class Capture:
    """The content of the recorded bag.

    Attributes:
        observed: stamp of each observation -> wall clock of its receipt (ns).
        predictions: in the order of their receipt.
        processing_ms: what the node itself measured, from receipt to publication (ms).
        diagnostics: last value of each key, by the status' name.
    """

    observed: dict[int, int] = field(default_factory=dict)
    predictions: list[Received] = field(default_factory=list)
    processing_ms: list[float] = field(default_factory=list)
    diagnostics: dict[str, dict[str, str]] = field(default_factory=dict)

    def take(self, topic: str, received_ns: int, message: Any) -> None:
        """Take one message in."""
        if topic == OBJECTS_TOPIC:
            self.observed[stamp_to_ns(message.header.stamp)] = received_ns
        elif topic == PREDICTIONS:
            prediction = prediction_from_pointcloud2(message)
            self.predictions.append(Received(prediction, received_ns))
        elif topic == PROCESSING:
            self.processing_ms.append(float(message.data))
        elif topic == DIAGNOSTICS:
            for status in message.status:
                values = {pair.key: pair.value for pair in status.values}
                self.diagnostics.setdefault(status.name, {}).update(values)


def read_capture(bag: Path) -> Capture:
    """The content of a bag that ``record`` wrote.

    Raises:
        RecordingError: the bag cannot be read.
    """
    capture = Capture()
    with open_bag(bag) as reader:
        wanted = [c for c in reader.connections if c.topic in TOPICS]
        for connection, received_ns, data in reader.messages(connections=wanted):
            message = reader.deserialize(data, connection.msgtype)
            capture.take(connection.topic, received_ns, message)
    return capture
