# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The network's configuration: what is fixed when the weights are made."""

import dataclasses
from dataclasses import dataclass
from typing import Any, cast

LAYERS = ("graphconv", "gcn", "gat", "gat+")
ORDERS = (1, 2)
INTEGRATORS = ("euler", "heun", "rk4")
NOISE_INPUTS = ("velocity", "integrated")
INITIAL_COVARIANCES = ("learned", "configured")
BASE_FEATURES = 8
"""x, y, vx, vy, ax, ay, cos_yaw, sin_yaw: the feature columns every input begins with."""


@dataclass(frozen=True)
class ModelConfig:
    """All choices that shape MTP-GO; the defaults are the model we ship.

    Attributes:
        feature_size: F, the base columns x, y, vx, vy, ax, ay, cos_yaw, sin_yaw and context.
        static_size: C, length of the one-hot agent class.
        history_steps: T, the present sample included (design D1).
        horizon_steps: H.
        dt_s: step of history and horizon (s).
        modes: M, components of the mixture.
        hidden: D, size of the recurrent state.
        layer: GNN layer, one of ``LAYERS`` (paper, "GNN Layers").
        heads: attention heads of gat and gat+, averaged.
        gnn_layers: layers per GNN, ELU between them.
        tied: attention's neighbour key and value share one matrix (as in GATv2's published code).
        bandwidth_m: first value of the learned edge bandwidth (m, eq. edge_weight).
        order: 1: states x, y; 2: states x, y, vx, vy (paper, "Motion Model").
        integrator: step of the neural ODE, one of ``INTEGRATORS``.
        ode_hidden: units of each hidden layer of f_1 and of f_2.
        ode_layers: hidden layers of f_1 and of f_2.
        noise_input: how process noise enters a second-order state: ``velocity``: Ts [0; I] as in
            the paper; ``integrated``: [Ts^2/2; Ts], so that the position is uncertain from the
            first step on. A first-order model has Ts I either way.
        initial_covariance: ``learned``: diagonal P_0 of each agent from its last encoder state;
            ``configured``: the two values below for everybody.
        initial_std_m: configured, or first value of the learned, position deviation (m).
        initial_std_mps: likewise of the velocity (m/s).
        observation_std_m: deviation of an observed position around the true one (m). Predicted
            are observed states, so its square is added to every position's variance. With 0 as in
            the paper; above it, agents whose motion is nearly certain, the standing ones above
            all, do not drown the others in the likelihood.
        observation_std_mps: likewise of the velocity (m/s).
        covariance_scale: factor on all covariances in the output, 1 in training; a calibration
            fitted afterwards on recordings that did not train sets it.
        encoder_gnn: false removes all edges from the encoder's graphs (ablation).
        decoder_gnn: likewise in the decoder.
        ekf: false lets the decoder give the position's covariance directly (ablation).
        ode: false lets the decoder give the states directly; needs ``ekf=False`` (ablation).
        static_features: the agent class joins the ODE's input (the paper's -S models).
        agent_frame: states and part of the input live in each agent's own frame (design D16).
    """

    feature_size: int = BASE_FEATURES
    static_size: int = 8
    history_steps: int = 16
    horizon_steps: int = 25
    dt_s: float = 0.2
    modes: int = 8
    hidden: int = 64
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
    observation_std_m: float = 0.0
    observation_std_mps: float = 0.0
    covariance_scale: float = 1.0
    encoder_gnn: bool = True
    decoder_gnn: bool = True
    ekf: bool = True
    ode: bool = True
    static_features: bool = False
    agent_frame: bool = True

    def __post_init__(self) -> None:
        _check_types(self)
        _one_of("layer", self.layer, LAYERS)
        _one_of("order", self.order, ORDERS)
        _one_of("integrator", self.integrator, INTEGRATORS)
        _one_of("noise_input", self.noise_input, NOISE_INPUTS)
        _one_of("initial_covariance", self.initial_covariance, INITIAL_COVARIANCES)
        _at_least("feature_size", self.feature_size, BASE_FEATURES)
        _at_least("static_size", self.static_size, 0)
        for name in ("history_steps", "horizon_steps", "modes", "hidden", "heads", "gnn_layers"):
            _at_least(name, getattr(self, name), 1)
        for name in ("ode_hidden", "ode_layers"):
            _at_least(name, getattr(self, name), 1)
        for name in (
            "dt_s",
            "bandwidth_m",
            "initial_std_m",
            "initial_std_mps",
            "covariance_scale",
        ):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected a positive number")
        for name in ("observation_std_m", "observation_std_mps"):
            if not 0.0 <= getattr(self, name) < float("inf"):
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected at least 0")
        if self.ekf and not self.ode:
            raise ValueError(
                "ekf is True and ode False, expected ekf=False without a motion model"
            )
        if self.static_features and self.static_size < 1:
            raise ValueError("static_features is True and static_size 0, expected at least 1")

    @property
    def state_size(self) -> int:
        """S, 2 or 4."""
        return 2 * self.order

    def to_dict(self) -> dict[str, Any]:
        """Plain data, for JSON and YAML."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> "ModelConfig":
        """The configuration that :meth:`to_dict` gave.

        Raises:
            ValueError: an unknown field or a value outside of what is allowed.
        """
        names = [field.name for field in dataclasses.fields(cls)]
        for name in data:
            if name not in names:
                raise ValueError(
                    f"the model configuration has the unknown field {name!r}, "
                    f"expected {', '.join(names)}"
                )
        return cls(**data)


def _check_types(config: ModelConfig) -> None:
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        kinds = (int, float) if field.type is float else (cast(type, field.type),)
        if not isinstance(value, kinds) or (isinstance(value, bool) and field.type is not bool):
            name = getattr(field.type, "__name__", field.type)
            raise ValueError(f"{field.name} is {value!r}, expected a value of type {name}")


def _one_of(name: str, value: object, valid: tuple[object, ...]) -> None:
    if value not in valid:
        raise ValueError(f"{name} is {value!r}, expected one of {', '.join(map(repr, valid))}")


def _at_least(name: str, value: int, least: int) -> None:
    if value < least:
        raise ValueError(f"{name} is {value!r}, expected at least {least}")
