# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MTP-GO's options, which are fixed when its weights are created."""

from dataclasses import dataclass

from models.network_config import (
    NetworkConfig,
    check_at_least,
    check_not_negative,
    check_one_of,
    check_positive,
)

LAYERS = ("graphconv", "gcn", "gat", "gat+")
ORDERS = (1, 2)
INTEGRATORS = ("euler", "heun", "rk4")
NOISE_INPUTS = ("velocity", "integrated")
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
    """

    layer: str = "gat+"
    heads: int = 1
    gnn_layers: int = 1
    tied: bool = True
    bandwidth_m: float = 30.0
    order: int = 2
    integrator: str = "rk4"
    ode_hidden: int = 16
    ode_layers: int = 1
    noise_input: str = "integrated"
    initial_covariance: str = "learned"
    initial_std_m: float = 0.1
    initial_std_mps: float = 0.3
    observation_std_mps: float = 0.0
    encoder_gnn: bool = True
    decoder_gnn: bool = True
    ekf: bool = True
    ode: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_one_of(self, LAYERS, "layer")
        check_one_of(self, ORDERS, "order")
        check_one_of(self, INTEGRATORS, "integrator")
        check_one_of(self, NOISE_INPUTS, "noise_input")
        check_one_of(self, INITIAL_COVARIANCES, "initial_covariance")
        check_at_least(self, 1, "heads", "gnn_layers", "ode_hidden", "ode_layers")
        check_positive(self, "bandwidth_m", "initial_std_m", "initial_std_mps")
        check_not_negative(self, "observation_std_mps")
        if self.ekf and not self.ode:
            raise ValueError(
                "ekf is True and ode False, expected ekf=False without a motion model"
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
