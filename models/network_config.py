# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options that all networks have, MTP-GO and the baselines, and the checks of options."""

import dataclasses
from dataclasses import dataclass
from typing import Any, Self, cast

BASE_FEATURES = 8
"""Columns that all inputs begin with: x, y, vx, vy, ax, ay, cos_yaw, sin_yaw."""


@dataclass(frozen=True)
class NetworkConfig:
    """Options that are fixed when the weights of a network are created.

    Attributes:
        feature_size: F, the base columns x, y, vx, vy, ax, ay, cos_yaw, sin_yaw and context.
        static_size: C, length of the one-hot agent class.
        history_steps: T, the present sample included (docs/design.md, decision 1).
        horizon_steps: H.
        dt_s: step of history and horizon (s).
        modes: M, components of the mixture.
        hidden: D, size of the recurrent state.
        observation_std_m: deviation of an observed position around the true one (m). The network
            predicts observed states, so its square is added to every position's variance. The
            paper has 0; above 0, agents whose motion is nearly certain, stationary ones in
            particular, do not dominate the likelihood.
        covariance_scale: factor on all covariances in the output, 1 in training; set by a
            calibration that is fitted afterwards on recordings that were not used for training.
        static_features: the agent class is also an input (as in the paper's -S models).
        agent_frame: states and part of the input are in each agent's own frame (docs/design.md,
            decision 16).
    """

    feature_size: int = BASE_FEATURES
    static_size: int = 8
    history_steps: int = 16
    horizon_steps: int = 25
    dt_s: float = 0.2
    modes: int = 8
    hidden: int = 64
    observation_std_m: float = 0.0
    covariance_scale: float = 1.0
    static_features: bool = False
    agent_frame: bool = True

    def __post_init__(self) -> None:
        check_types(self)
        check_at_least(self, BASE_FEATURES, "feature_size")
        check_at_least(self, 0, "static_size")
        check_at_least(self, 1, "history_steps", "horizon_steps", "modes", "hidden")
        check_positive(self, "dt_s", "covariance_scale")
        check_not_negative(self, "observation_std_m")
        if self.static_features and self.static_size < 1:
            raise ValueError("static_features is True and static_size 0, expected at least 1")

    @property
    def state_size(self) -> int:
        """S, 2: x, y, unless a subclass predicts more."""
        return 2

    @property
    def observation_std(self) -> list[float]:
        """Deviation [S] of an observed state around the true one (m, m/s)."""
        return [self.observation_std_m] * 2

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, for JSON and YAML."""
        return dataclasses.asdict(self)

    @classmethod
    def names(cls) -> list[str]:
        """Return the names of all options."""
        return [field.name for field in dataclasses.fields(cls)]

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Return the configuration of which :meth:`to_dict` returned ``data``.

        Raises:
            ValueError: an unknown field or a value outside of what is allowed.
        """
        for name in data:
            if name not in cls.names():
                raise ValueError(
                    f"the model configuration has the unknown field {name!r}, "
                    f"expected {', '.join(cls.names())}"
                )
        return cls(**data)


def check_types(config: NetworkConfig) -> None:
    """Check that every value has its field's type; an integer is accepted for a float."""
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        kinds = (int, float) if field.type is float else (cast(type, field.type),)
        if not isinstance(value, kinds) or (isinstance(value, bool) and field.type is not bool):
            name = getattr(field.type, "__name__", field.type)
            raise ValueError(f"{field.name} is {value!r}, expected a value of type {name}")


def check_one_of(config: NetworkConfig, valid: tuple[object, ...], *names: str) -> None:
    """Check that the options ``names`` have one of the ``valid`` values."""
    for name in names:
        if getattr(config, name) not in valid:
            raise ValueError(
                f"{name} is {getattr(config, name)!r}, "
                f"expected one of {', '.join(map(repr, valid))}"
            )


def check_at_least(config: NetworkConfig, least: int, *names: str) -> None:
    """Check that the options ``names`` are ``least`` or more."""
    for name in names:
        if getattr(config, name) < least:
            raise ValueError(f"{name} is {getattr(config, name)!r}, expected at least {least}")


def check_positive(config: NetworkConfig, *names: str) -> None:
    """Check that the options ``names`` are finite and above zero."""
    for name in names:
        if not 0.0 < getattr(config, name) < float("inf"):
            raise ValueError(f"{name} is {getattr(config, name)!r}, expected a positive number")


def check_not_negative(config: NetworkConfig, *names: str) -> None:
    """Check that the options ``names`` are finite and not below zero."""
    for name in names:
        if not 0.0 <= getattr(config, name) < float("inf"):
            raise ValueError(f"{name} is {getattr(config, name)!r}, expected at least 0")
