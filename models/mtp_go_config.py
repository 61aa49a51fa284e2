# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MTP-GO's options, which are fixed when its weights are created."""

import math
from dataclasses import dataclass

from models.network_config import NetworkConfig
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import option, require

LAYERS = ("graphconv", "gcn", "gat", "gat+")
ORDERS = (1, 2)
INTEGRATORS = ("euler", "heun", "rk4")
NOISE_INPUTS = ("velocity", "integrated")
STATIC_INPUTS = ("motion", "all")
INITIAL_COVARIANCES = ("learned", "configured")
MOTION_INPUTS = ("added", "network")

INFLATION = 1e-5
"""Default of ``covariance_inflation``. Chosen: float32 keeps a matrix definite only down to
relative eigenvalues of some 1e-6; a P_0 of millimetres under a motion of a hundred metres is
beyond that. The share widens a standard deviation by 0.013 % over 25 steps."""

SIGMA_FLOOR = 0.01
"""Least process noise (m/s or m/s^2) and least initial deviation (m, m/s).

Chosen: far below any tracker's accuracy, and not zero, so that covariances stay definite.
"""

RHO_LIMIT = 0.999
"""Factor on softsign (chosen: keeps Q definite in float32)."""


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
        motion_input: how the input u enters the motion model: ``added``: dq/dt = u + f(q, u), and
            u includes the velocity at t in first order; ``network``: dq/dt = f(q, u) with u as
            the decoder gives it, as in the paper (eqs. 17 to 19).
        noise_input: how process noise enters a second-order state: ``velocity``: Ts [0; I] as in
            the paper (eq. 25); ``integrated``: [Ts^2/2; Ts], so that the position is uncertain
            from the first step on. A first-order model has Ts I in both cases.
        initial_covariance: ``learned``: diagonal P_0 of each agent from its last encoder state;
            ``configured``: the two values below for all agents.
        initial_std_m: configured, or first value of the learned, position deviation (m).
        initial_std_mps: configured, or first value of the learned, velocity deviation (m/s).
        covariance_inflation: share of each variance that is added to it in every step, so that
            covariances stay positive definite in float32; 0 as in the paper (eq. 21), which also
            leaves out the floor of the rotation between frames.
        noise_floor: least process noise (m/s or m/s^2) and least learned initial deviation (m,
            m/s); the paper has 0.
        correlation_limit: largest correlation of the process noise; the paper has 1.
        observation_std_mps: as ``observation_std_m``, of the velocity (m/s).
        encoder_gnn: false removes all edges from the encoder's graphs (ablation).
        decoder_gnn: false removes all edges from the decoder's graph (ablation).
        ekf: false lets the decoder give the position's covariance directly (ablation).
        ode: false lets the decoder give the states directly; needs ``ekf=False`` (ablation).
        static_inputs: what sees the static features, with ``static_features``: ``motion``: the
            neural ODE alone, as in the paper; ``all``: the encoder, too.
        trail_branches: R, paths of earlier road users that the decoder sees; 0 for none.
        conditioned: inputs are scaled by statistics, and the untrained network moves every agent
            at constant velocity. False: features as they are, torch's usual initial weights, and
            nothing but the paper's layers; see docs/training.md for what that costs.
        hold_standing: the first mode of a standing agent is uniform motion (not in the paper), so
            that an agent that stays where it is can be predicted exactly.
        settle_standing: outside of the losses, modes in which a standing agent hardly moves are
            drawn to uniform motion (not in the paper), see
            :func:`models.gaussian_mixture.settle_standing`.
        stay_bias: outside of the losses, this is added to the logarithm of the weight of modes in
            which a standing agent stays (not in the paper), see
            :func:`models.gaussian_mixture.favour_staying`.
        heaviest_kernels: one for each of the first static features, which are classes: outside of
            the losses, the heaviest mode of a moving agent of that class is the mean of the modes
            around it, see :func:`models.gaussian_mixture.heaviest_at_local_mean`. Standard
            deviations of the kernel; 0 leaves the mode as it is, as in the paper.
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
    motion_input: str = option("added", choices=MOTION_INPUTS)
    noise_input: str = option("integrated", choices=NOISE_INPUTS)
    initial_covariance: str = option("learned", choices=INITIAL_COVARIANCES)
    initial_std_m: float = option(0.1, above=0.0, below=math.inf)
    initial_std_mps: float = option(0.3, above=0.0, below=math.inf)
    covariance_inflation: float = option(INFLATION, low=0.0, below=1.0)
    noise_floor: float = option(SIGMA_FLOOR, low=0.0, below=math.inf)
    correlation_limit: float = option(RHO_LIMIT, above=0.0, high=1.0)
    observation_std_mps: float = option(0.0, low=0.0, below=math.inf)
    encoder_gnn: bool = True
    decoder_gnn: bool = True
    ekf: bool = True
    ode: bool = True
    static_inputs: str = option("motion", choices=STATIC_INPUTS)
    trail_branches: int = option(0, low=0)
    conditioned: bool = True
    hold_standing: bool = False
    settle_standing: bool = False
    stay_bias: float = option(0.0, low=0.0, below=math.inf)
    heaviest_kernels: tuple[float, ...] = option((), low=0.0, below=math.inf)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ekf and not self.ode:
            raise ConfigurationError(
                "model.ekf is True and ode False, expected ekf=False without a motion model"
            )
        require(
            "model.heaviest_kernels",
            list(self.heaviest_kernels),
            len(self.heaviest_kernels) <= self.static_size,
            f"at most one for each of the {self.static_size} static features",
        )

    @property
    def state_size(self) -> int:
        """S, 2 or 4."""
        return 2 * self.order

    @property
    def is_conditioned(self) -> bool:
        """``conditioned``."""
        return self.conditioned

    @property
    def observation_std(self) -> list[float]:
        """Deviation [S] of an observed state around the true one (m, m/s)."""
        both = [self.observation_std_m] * 2 + [self.observation_std_mps] * 2
        return both[: self.state_size]
