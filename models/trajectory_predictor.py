# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The interface of all networks, and what their inputs and outputs have in common."""

import torch
from torch import Tensor, nn

from models.network_config import NetworkConfig
from models.own_frame.conditioning import Conditioning


class TrajectoryPredictor(nn.Module):
    """Base of all networks: multimodal Gaussian trajectories of all agents of B scenes.

    Subclasses implement :meth:`roll_out`. Training and export use this interface alone.

    Args:
        config: the network's options.

    Attributes:
        config: the network's options.
        condition: scales of the inputs, kept in buffers.
        observation: [S, S] covariance of an observed state around the true one.
    """

    observation: Tensor

    def __init__(self, config: NetworkConfig):
        super().__init__()
        self.config = config
        self.horizon_steps = config.horizon_steps
        self.modes = config.modes
        self.covariance_scale = config.covariance_scale
        self.condition = Conditioning(config)
        observation = torch.tensor(config.observation_std).square().diag()
        self.register_buffer("observation", observation, persistent=False)

    def forward(
        self,
        features: Tensor,
        valid: Tensor,
        static: Tensor,
        initial_covariance: Tensor | None = None,
        trails: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Predict every agent, in the scene frame.

        Args:
            features: [B, N, T, F], columns as in the task's scene configuration; any value where
                ``valid`` is false.
            valid: [B, N, T] presence; an agent absent at t gets finite numbers without meaning.
            static: [B, N, C] static features.
            initial_covariance: [B, N, S, S] P_0 in the scene frame, for instance the tracker's;
                an agent whose entries are not all finite takes the model's own. A network without
                a Kalman filter ignores it.
            trails: [B, N, R, H, 3] paths of earlier road users in each agent's frame: offset from
                straight motion ahead and to the left (m), and share, 0 where not known. A network
                without this input ignores it.

        Returns:
            Log mixture weights [B, N, M], means [B, N, M, H, S] and covariances
            [B, N, M, H, S, S] of x, y (m) and, where S is 4, vx, vy (m/s) (output, eq. 26).
        """
        return self.roll_out(features, valid, static, initial_covariance, True, None, None, trails)

    def roll_out(
        self,
        features: Tensor,
        valid: Tensor,
        static: Tensor,
        initial_covariance: Tensor | None,
        with_covariance: bool,
        teacher: Tensor | None,
        teacher_valid: Tensor | None,
        trails: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """:meth:`forward` with the options of training.

        Args:
            features: see :meth:`forward`.
            valid: see :meth:`forward`.
            static: see :meth:`forward`.
            initial_covariance: see :meth:`forward`.
            with_covariance: false skips the covariances, which come back empty.
            teacher: [B, N, H, S] true future states in the scene frame. Where given and valid, the
                decoder sees them instead of its last prediction; the motion model never does.
            teacher_valid: [B, N, H].
            trails: see :meth:`forward`.

        Returns:
            As :meth:`forward`.
        """
        raise NotImplementedError

    def seen(
        self, state: Tensor, teacher: Tensor | None, teacher_valid: Tensor | None, step: int
    ) -> Tensor:
        """Return [B, N, M, S] the state that the decoder sees: its own, or the teacher's.

        Args:
            state: [B, N, M, S] the last prediction, in the agents' frames.
            teacher: [B, N, H, S] true states in the agents' frames (teacher forcing).
            teacher_valid: [B, N, H] where they are known.
            step: counted from 0; at the first the decoder sees the state at t.
        """
        if step == 0 or teacher is None or teacher_valid is None:
            return state
        known = teacher_valid[:, :, step - 1, None, None]
        return torch.where(known, teacher[:, :, step - 1].unsqueeze(2), state)

    def observed(self, covariance: Tensor) -> Tensor:
        """Return [B, N, M, H, S, S] calibrated covariances of observed states."""
        return self.covariance_scale * (covariance + self.observation)

    def set_statistics(
        self,
        feature_mean: Tensor,
        feature_std: Tensor,
        own_mean: Tensor | None = None,
        own_std: Tensor | None = None,
    ) -> None:
        """Fill the scaling buffers, see :meth:`Conditioning.set_statistics`."""
        self.condition.set_statistics(feature_mean, feature_std, own_mean, own_std)

    @torch.no_grad()
    def fit_statistics(self, features: Tensor, valid: Tensor) -> None:
        """Fill the scaling buffers from sample scenes: [B, N, T, F] and presence [B, N, T]."""
        self.condition.fit_statistics(features, valid)

    def fit_futures(self, features: Tensor, valid: Tensor, target: Tensor, mask: Tensor) -> None:
        """Set what depends on the futures of sample scenes; most networks have nothing to set.

        Args:
            features: [B, N, T, F].
            valid: [B, N, T].
            target: [B, N, H, S'] true states in the scene frame; any value where not observed.
            mask: [B, N, H] weight of each step, 0 where not observed.
        """
