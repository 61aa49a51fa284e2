# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions for their consumers: the published cloud as arrays, and questions about them.

Everything public is imported from here; docs/messages.md has an example of each function. numpy is
needed, rosbags only for bags and pandas only for :func:`prediction_frame`.
"""

from msg_adapters.inputs.odometry import pose_of, pose_of_transform
from msg_adapters.predictions.predicted_objects import prediction_from_predicted_objects
from msg_adapters.predictions.prediction_bag import NoPredictionsError, predictions_in_bag
from msg_adapters.predictions.prediction_cloud import (
    POINT,
    REQUIRED_FIELDS,
    prediction_from_cdr,
    prediction_from_pointcloud2,
    prediction_to_pointcloud2,
)
from msg_adapters.predictions.prediction_rows import prediction_frame
from mtpgo_core.frames import Pose2
from mtpgo_core.prediction.output_assembly import select
from mtpgo_core.prediction.prediction_queries import (
    agent_row,
    at_times,
    mixture_moments,
    most_probable,
    most_probable_mode,
    to_frame,
)
from mtpgo_core.schema import AgentClass, CalibrationStage, Prediction, Source

__all__ = [
    "POINT",
    "REQUIRED_FIELDS",
    "AgentClass",
    "CalibrationStage",
    "NoPredictionsError",
    "Pose2",
    "Prediction",
    "Source",
    "agent_row",
    "at_times",
    "mixture_moments",
    "most_probable",
    "most_probable_mode",
    "pose_of",
    "pose_of_transform",
    "prediction_frame",
    "prediction_from_cdr",
    "prediction_from_pointcloud2",
    "prediction_from_predicted_objects",
    "prediction_to_pointcloud2",
    "predictions_in_bag",
    "select",
    "to_frame",
]
