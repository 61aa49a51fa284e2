# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options that all networks have, MTP-GO and the baselines."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import check_options, check_types, from_dict, option

BASE_FEATURES = 8
"""Columns that all inputs begin with: x, y, vx, vy, ax, ay, cos_yaw, sin_yaw."""

LEAST_FEATURES = 7
"""The same with the yaw as one angle, as in the paper; only without own frames."""


@dataclass(frozen=True)
class NetworkConfig:
    """Options that are fixed when the weights of a network are created.

    Attributes:
        feature_size: F, the base columns x, y, vx, vy, ax, ay, cos_yaw, sin_yaw (or the yaw as
            one angle) and context.
        static_size: C, number of static features: the one-hot agent class, and its size.
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
        least_mode_spread: smallest distance between the modes, in standard deviations of the
            heaviest one. The network does not apply it; who uses its output does, the losses do
            not, see :func:`mtpgo_core.prediction.paths.mode_spread.with_least_spread`.
        static_features: the agent class is also an input (as in the paper's -S models).
        agent_frame: states and part of the input are in each agent's own frame (docs/design.md,
            decision 16).
    """

    feature_size: int = option(BASE_FEATURES, low=LEAST_FEATURES)
    static_size: int = option(8, low=0)
    history_steps: int = option(16, low=1)
    horizon_steps: int = option(25, low=1, high=1000)  # as a model file may have
    dt_s: float = option(0.2, above=0.0, below=math.inf)
    modes: int = option(8, low=1, high=64)  # the same
    hidden: int = option(64, low=1, high=8192)  # chosen: hundreds of millions of parameters
    observation_std_m: float = option(0.0, low=0.0, below=math.inf)
    covariance_scale: float = option(1.0, above=0.0, below=math.inf)
    least_mode_spread: float = option(0.0, low=0.0, high=3.0)  # as a model file may have
    static_features: bool = False
    agent_frame: bool = True

    def __post_init__(self) -> None:
        check_types(self, "model.")
        check_options(self, "model.")
        if self.static_features and self.static_size < 1:
            raise ConfigurationError(
                "model.static_features is True and static_size 0, expected at least 1"
            )
        if self.agent_frame and self.feature_size < BASE_FEATURES:
            raise ConfigurationError(
                f"model.feature_size is {self.feature_size}, expected at least {BASE_FEATURES} "
                "with agent_frame, which needs the yaw as cosine and sine (scene.angles)"
            )

    @property
    def state_size(self) -> int:
        """S, 2: x, y, unless a subclass predicts more."""
        return 2

    @property
    def is_conditioned(self) -> bool:
        """Whether inputs are scaled and the untrained network moves agents uniformly."""
        return True

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
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Return the configuration that :meth:`to_dict` gave.

        Raises:
            ConfigurationError: an unknown option, or a value that is not allowed.
        """
        return from_dict(cls, data, "model")
