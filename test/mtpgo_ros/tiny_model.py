# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A minimal model file in the exporter's format: modes at constant velocity.

``work`` makes it as slow as a test wants, ``poison`` makes it answer NaN for fast agents, and
``drift_mps`` makes it wrong: all agents drift along the scene's y axis.
"""

from __future__ import annotations

from pathlib import Path

import torch

from mtpgo_core.task.task_description import (
    TASK_FILE,
    HistoryConfig,
    SceneConfig,
    TaskDescription,
)

MODES, STEPS, DT_S = 3, 25, 0.2
POISON_MPS = 80.0


class TinyModel(torch.nn.Module):
    """log weights [B, N, M], means [B, N, M, H, 4], covariances [B, N, M, H, 4, 4]."""

    def __init__(self, work: int, poison: bool, drift_mps: float) -> None:
        super().__init__()
        self.work, self.poison = work, poison
        self.register_buffer("drift", torch.tensor([0.0, drift_mps]))
        self.register_buffer("time", DT_S * torch.arange(1, STEPS + 1).float())
        self.register_buffer("heavy", torch.full((400, 400), 0.0025))

    def forward(
        self,
        features: torch.Tensor,
        valid: torch.Tensor,
        static: torch.Tensor,
        initial_covariance: torch.Tensor | None = None,
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        shape = features.shape[:2]
        busy = self.heavy
        # Only fast agents cost time, so that the warm-up does not.
        if features[:, :, -1, 2:4].abs().max() > 15.0:
            for _ in range(self.work):
                busy = busy @ self.heavy
        position = features[:, :, -1, 0:2] + 0.0 * busy[0, 0]
        velocity = features[:, :, -1, 2:4]
        speed = torch.linalg.vector_norm(velocity, dim=-1)
        along = position[:, :, None] + (velocity[:, :, None] + self.drift) * self.time[:, None]
        mode = torch.cat([along, velocity[:, :, None].expand_as(along)], dim=-1)
        if self.poison:
            mode = torch.where(
                (speed > 80.0)[:, :, None, None], torch.full_like(mode, float("nan")), mode
            )
        mean = mode[:, :, None].expand(shape[0], shape[1], 3, 25, 4)
        weight = torch.log(torch.tensor([0.5, 0.3, 0.2])).expand(shape[0], shape[1], 3)
        variance = (0.1 + self.time**2)[:, None, None] * torch.eye(4)
        covariance = variance.expand(shape[0], shape[1], 3, 25, 4, 4)
        return weight, mean, covariance


def write_tiny_model(
    path: Path,
    *,
    work: int = 0,
    poison: bool = False,
    context: str = "none",
    drift_mps: float = 0.0,
    name: str = "tiny",
    history: HistoryConfig | None = None,
) -> Path:
    """Script and save the model with its task description."""
    task = TaskDescription(
        name=name,
        history=history or HistoryConfig(),
        horizon_steps=STEPS,
        modes=MODES,
        scene=SceneConfig(context=context),
        weights_sha256="0" * 64,
    )
    module = torch.jit.script(TinyModel(work, poison, drift_mps).eval())
    torch.jit.save(torch.jit.freeze(module), str(path), _extra_files={TASK_FILE: task.to_json()})
    return path
