# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of the baselines, in addition to those that all networks have."""

import math
from dataclasses import dataclass

from models.mtp_go_config import LAYERS
from models.network_config import BASE_FEATURES, NetworkConfig
from mtpgo_core.options import option, require


@dataclass(frozen=True)
class BaselineConfig(NetworkConfig):
    """Options of all baselines.

    Attributes:
        yaw_as_angle: the yaw is one column, an angle (rad), as in the paper of MTP-GO; else it is
            two, cosine and sine. Follows from the task's ``scene.angles``.
    """

    yaw_as_angle: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        require(
            "model.yaw_as_angle",
            self.yaw_as_angle,
            not (self.yaw_as_angle and self.agent_frame),
            "false with agent_frame, which needs the yaw as cosine and sine",
        )

    @property
    def has_angle(self) -> bool:
        """``yaw_as_angle``, or fewer columns than with cosine and sine."""
        return self.yaw_as_angle or self.feature_size < BASE_FEATURES


@dataclass(frozen=True)
class RecurrentConfig(BaselineConfig):
    """Options of the recurrent baselines; Seq2Seq has no others.

    Attributes:
        embedding: channels of the embedded inputs, fed-back states and neighbour features.
    """

    embedding: int = option(32, low=1)


@dataclass(frozen=True)
class GridConfig(RecurrentConfig):
    """Options of the two social poolings: the grid around each agent.

    The agent is in the middle; rows follow one another along its heading at t.

    Attributes:
        rows: cells along the heading.
        columns: cells across the heading.
        cell_length_m: length of a cell, along the heading (m).
        cell_width_m: width of a cell, across the heading (m).
    """

    rows: int = option(9, low=5)  # two convolutions of three cells need at least five
    columns: int = option(5, low=3)
    cell_length_m: float = option(8.0, above=0.0, below=math.inf)
    cell_width_m: float = option(4.0, above=0.0, below=math.inf)


@dataclass(frozen=True)
class GraphConfig(RecurrentConfig):
    """Options of GNN-RNN: its graph network, which has MTP-GO's layers and edge weights.

    Attributes:
        layer: GNN layer, one of ``LAYERS`` of :mod:`models.mtp_go_config`.
        heads: attention heads of gat and gat+, averaged.
        gnn_layers: layers, ELU after each.
        bandwidth_m: first value of the learned edge bandwidth (m, eq. 13).
    """

    layer: str = option("gat", choices=LAYERS)
    heads: int = option(1, low=1)
    gnn_layers: int = option(2, low=1)
    bandwidth_m: float = option(30.0, above=0.0, below=math.inf)
