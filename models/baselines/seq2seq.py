# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Seq2Seq: every agent is predicted alone."""

from models.baselines.baseline_config import RecurrentConfig
from models.baselines.interaction import NoInteraction
from models.baselines.recurrent_predictor import RecurrentPredictor


class Seq2Seq(RecurrentPredictor):
    """LSTM encoder and decoder without interaction."""

    def __init__(self, config: RecurrentConfig):
        super().__init__(config, NoInteraction())
