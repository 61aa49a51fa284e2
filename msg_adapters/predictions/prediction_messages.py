# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The messages that predictions are read from: the canonical cloud, and Autoware's message."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from msg_adapters.inputs.autoware import PACKAGE
from msg_adapters.predictions.predicted_objects import prediction_from_predicted_objects
from msg_adapters.predictions.prediction_cloud import prediction_from_cdr
from mtpgo_core.schema import Prediction


@dataclass(frozen=True)
class PredictionAdapter:
    """One kind of message with predictions.

    Attributes:
        name: short name, as the predictor's ``output`` calls it.
        message_type: ROS type.
        topic: where a predictor in the same namespace publishes it.
        read: makes a prediction of the CDR bytes of a message; the second argument says whether a
            covariance is assumed where the message gives none. Raises MessageError.
    """

    name: str
    message_type: str
    topic: str
    read: Callable[[bytes, bool], Prediction]


def _read_cloud(data: bytes, assume_covariance: bool) -> Prediction:
    del assume_covariance  # a cloud has its own
    return prediction_from_cdr(data)


def _read_predicted_objects(data: bytes, assume_covariance: bool) -> Prediction:
    return prediction_from_predicted_objects(data, assume_covariance=assume_covariance)


PREDICTIONS: dict[str, PredictionAdapter] = {
    adapter.name: adapter
    for adapter in (
        PredictionAdapter(
            "pointcloud2", "sensor_msgs/msg/PointCloud2", "predictor/predictions", _read_cloud
        ),
        PredictionAdapter(
            "autoware",
            PACKAGE + "PredictedObjects",
            "predictor/predicted_objects",
            _read_predicted_objects,
        ),
    )
}
"""The messages with predictions, by short name."""
