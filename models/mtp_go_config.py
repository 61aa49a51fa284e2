# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MTP-GO's options, which are fixed when its weights are created."""

import math
from dataclasses import dataclass

from models.network_config import NetworkConfig
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import option

LAYERS = ("graphconv", "gcn", "gat", "gat+")
ORDERS = (1, 2)
INTEGRATORS = ("euler", "heun", "rk4")
NOISE_INPUTS = ("velocity", "integrated")
STATIC_INPUTS = ("motion", "all")
INITIAL_COVARIANCES = ("learned", "configured")


@dataclass(frozen=True)
class ModelConfig(NetworkConfig):
    """All options of MTP-GO.

    Attributes:
        layer: GNN layer, one of ``LAYERS`` (paper, "GNN Layers").
        heads: attention heads of gat and gat+, averaged.
        gnn_layers: layers per GNN, ELU between them.
        tied: attention's neighbour key and value share one matrix (as in GATv2's published code).
        bandwidth_m: first value of the learned edge bandwidth (m, eq. 13).
        order: 1: states x, y (eq. 18); 2: states x, y, vx, vy (eq. 19).
        integrator: step of the neural ODE, one of ``INTEGRATORS``.
        ode_hidden: units of each hidden layer of f_1 and of f_2.
        ode_layers: hidden layers of f_1 and of f_2.
        noise_input: how process noise enters a second-order state: ``velocity``: Ts [0; I] as in
            the paper (eq. 25); ``integrated``: [Ts^2/2; Ts], so that the position is uncertain
            from the first step on. A first-order model has Ts I in both cases.
        initial_covariance: ``learned``: diagonal P_0 of each agent from its last encoder state;
            ``configured``: the two values below for all agents.
        initial_std_m: configured, or first value of the learned, position deviation (m).
        initial_std_mps: configured, or first value of the learned, velocity deviation (m/s).
        observation_std_mps: as ``observation_std_m``, of the velocity (m/s).
        encoder_gnn: false removes all edges from the encoder's graphs (ablation).
        decoder_gnn: false removes all edges from the decoder's graph (ablation).
        ekf: false lets the decoder give the position's covariance directly (ablation).
        ode: false lets the decoder give the states directly; needs ``ekf=False`` (ablation).
        static_inputs: what sees the static features, with ``static_features``: ``motion``: the
            neural ODE alone, as in the paper; ``all``: the encoder, too.
        trail_branches: R, paths of earlier road users that the decoder sees; 0 for none.
        hold_standing: the first mode of a standing agent is uniform motion (not in the paper), so
            that an agent that stays where it is can be predicted exactly.
    """

    layer: str = option("gat+", choices=LAYERS)
    heads: int = option(1, low=1)
    gnn_layers: int = option(1, low=1)
    tied: bool = True
    bandwidth_m: float = option(30.0, above=0.0, below=math.inf)
    order: int = option(2, choices=ORDERS)
    integrator: str = option("rk4", choices=INTEGRATORS)
    ode_hidden: int = option(16, low=1)
    ode_layers: int = option(1, low=1)
    noise_input: str = option("integrated", choices=NOISE_INPUTS)
    initial_covariance: str = option("learned", choices=INITIAL_COVARIANCES)
    initial_std_m: float = option(0.1, above=0.0, below=math.inf)
    initial_std_mps: float = option(0.3, above=0.0, below=math.inf)
    observation_std_mps: float = option(0.0, low=0.0, below=math.inf)
    encoder_gnn: bool = True
    decoder_gnn: bool = True
    ekf: bool = True
    ode: bool = True
    static_inputs: str = option("motion", choices=STATIC_INPUTS)
    trail_branches: int = option(0, low=0)
    hold_standing: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ekf and not self.ode:
            raise ConfigurationError(
                "model.ekf is True and ode False, expected ekf=False without a motion model"
            )

    @property
    def state_size(self) -> int:
        """S, 2 or 4."""
        return 2 * self.order

    @property
    def observation_std(self) -> list[float]:
        """Deviation [S] of an observed state around the true one (m, m/s)."""
        both = [self.observation_std_m] * 2 + [self.observation_std_mps] * 2
        return both[: self.state_size]
