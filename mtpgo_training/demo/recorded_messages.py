# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reads the bag that ``record`` wrote: observations, predictions and diagnostics."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.conversions import stamp_to_ns
from msg_adapters.outputs.quality_table import quality_from_array
from msg_adapters.predictions import prediction_from_pointcloud2
from mtpgo_core.quality.quality_report import QUALITY_ROW
from mtpgo_core.schema import Prediction
from mtpgo_training.data.recording_bag import OBJECTS_TOPIC, PREDICTIONS_TOPIC

PROCESSING, DIAGNOSTICS = "/predictor/debug/processing_time_ms", "/diagnostics"
QUALITY = "/predictor/quality_table"

TOPICS = (OBJECTS_TOPIC, PREDICTIONS_TOPIC, PROCESSING, QUALITY, DIAGNOSTICS)
"""The topics that the demo records."""


@dataclass(frozen=True)
class ReceivedPrediction:
    """A prediction and when it was received.

    Attributes:
        prediction: content of the message.
        received_ns: time of receipt by ``record`` (ns, wall clock).
    """

    prediction: Prediction
    received_ns: int


@dataclass
class RecordedMessages:
    """The content of the recorded bag.

    Attributes:
        observed: stamp of each observation (ns) -> time of its receipt (ns, wall clock).
        predictions: predictions in the order of their receipt.
        processing_ms: the node's own measurements, from receipt to publication (ms).
        diagnostics: name of a status -> key -> last value.
        quality: the node's last scores of its predictions, rows of ``QUALITY_ROW``.
    """

    observed: dict[int, int] = field(default_factory=dict)
    predictions: list[ReceivedPrediction] = field(default_factory=list)
    processing_ms: list[float] = field(default_factory=list)
    diagnostics: dict[str, dict[str, str]] = field(default_factory=dict)
    quality: NDArray[Any] = field(default_factory=lambda: np.empty(0, dtype=QUALITY_ROW))

    def add(self, topic: str, received_ns: int, message: Any) -> None:
        """Add one message of one of ``TOPICS``."""
        if topic == OBJECTS_TOPIC:
            self.observed[stamp_to_ns(message.header.stamp)] = received_ns
        elif topic == PREDICTIONS_TOPIC:
            prediction = prediction_from_pointcloud2(message)
            self.predictions.append(ReceivedPrediction(prediction, received_ns))
        elif topic == PROCESSING:
            self.processing_ms.append(float(message.data))
        elif topic == QUALITY:
            self.quality = quality_from_array(message)
        elif topic == DIAGNOSTICS:
            for status in message.status:
                values = {pair.key: pair.value for pair in status.values}
                self.diagnostics.setdefault(status.name, {}).update(values)


def read_messages(bag: Path) -> RecordedMessages:
    """Return the content of a bag that ``record`` wrote.

    Raises:
        RecordingError: the bag cannot be read.
    """
    recorded = RecordedMessages()
    with DecodingBagReader(bag) as reader:
        wanted = [c for c in reader.connections if c.topic in TOPICS]
        for connection, received_ns, message in reader.messages(wanted):
            recorded.add(connection.topic, received_ns, message)
    return recorded
