# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Published predictors to compare MTP-GO with, on its inputs and with its outputs.

Four share one structure (:mod:`models.baselines.recurrent_predictor`): an LSTM encodes each
agent's history, another decodes its future, and heads give a mixture of Gaussian trajectories.
They differ in what an agent receives from its neighbours:

* ``Seq2Seq``: nothing.
* ``SocialLSTM``: a grid around it into which the neighbours' states are summed, at every step
  (Alahi et al., "Social LSTM: Human Trajectory Prediction in Crowded Spaces", CVPR 2016).
* ``ConvolutionalSocialLSTM``: the same grid at the present, as input of convolutions (Deo and
  Trivedi, "Convolutional Social Pooling for Vehicle Trajectory Prediction", CVPR Workshops 2018).
* ``GraphRNN``: a graph network over the encoded histories (Mo, Xing and Lv, "Graph and Recurrent
  Neural Network-based Vehicle Trajectory Prediction For Highway Driving", ITSC 2021).

Two have their own structure and their own training objective:

* ``MMTransformer``: stacked transformers with fixed proposals (Liu et al., CVPR 2021).
* ``TrajectronPlusPlus``: a discrete latent and integrated dynamics (Salzmann et al., ECCV 2020).
"""

from models.baselines.baseline_config import GraphConfig, GridConfig, RecurrentConfig
from models.baselines.cs_lstm import ConvolutionalSocialLSTM
from models.baselines.gnn_rnn import GraphRNN
from models.baselines.latent.trajectron_config import TrajectronConfig
from models.baselines.latent.trajectron_plus_plus import TrajectronPlusPlus
from models.baselines.s_lstm import SocialLSTM
from models.baselines.seq2seq import Seq2Seq
from models.baselines.transformers.mm_transformer import MMTransformer
from models.baselines.transformers.transformer_config import TransformerConfig

__all__ = [
    "ConvolutionalSocialLSTM",
    "GraphConfig",
    "GraphRNN",
    "GridConfig",
    "MMTransformer",
    "RecurrentConfig",
    "Seq2Seq",
    "SocialLSTM",
    "TrajectronConfig",
    "TrajectronPlusPlus",
    "TransformerConfig",
]
