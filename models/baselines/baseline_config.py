# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of the baselines, in addition to those that all networks have."""

from dataclasses import dataclass

from models.mtp_go_config import LAYERS
from models.network_config import NetworkConfig, check_at_least, check_one_of, check_positive


@dataclass(frozen=True)
class RecurrentConfig(NetworkConfig):
    """Options of all baselines; Seq2Seq has no others.

    Attributes:
        embedding: channels of the embedded inputs, fed-back states and neighbour features.
    """

    embedding: int = 32

    def __post_init__(self) -> None:
        super().__post_init__()
        check_at_least(self, 1, "embedding")


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

    rows: int = 9
    columns: int = 5
    cell_length_m: float = 8.0
    cell_width_m: float = 4.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_at_least(self, 5, "rows")  # two convolutions of three cells need at least five
        check_at_least(self, 3, "columns")
        check_positive(self, "cell_length_m", "cell_width_m")


@dataclass(frozen=True)
class GraphConfig(RecurrentConfig):
    """Options of GNN-RNN: its graph network, which has MTP-GO's layers and edge weights.

    Attributes:
        layer: GNN layer, one of ``LAYERS`` of :mod:`models.mtp_go_config`.
        heads: attention heads of gat and gat+, averaged.
        gnn_layers: layers, ELU after each.
        bandwidth_m: first value of the learned edge bandwidth (m, eq. 13).
    """

    layer: str = "gat"
    heads: int = 1
    gnn_layers: int = 2
    bandwidth_m: float = 30.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_one_of(self, LAYERS, "layer")
        check_at_least(self, 1, "heads", "gnn_layers")
        check_positive(self, "bandwidth_m")
