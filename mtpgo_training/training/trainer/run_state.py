# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How far a run is: all that changes beside the weights and the optimiser."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any

Row = dict[str, Any]
"""A line of the log."""


@dataclass
class RunState:
    """How far a run is.

    Attributes:
        epoch: epochs that are done.
        batch: batches that are done of the epoch under way.
        step: optimisation steps that are done.
        loss: sum over the agents of the epoch under way.
        agents: their number.
        skipped: steps of the epoch under way that were left out, being not finite.
        epoch_seconds: time that the epoch under way has taken so far (s).
        seconds: time that all epochs that are done have taken, validation included (s).
        best: smallest merit so far.
        best_epoch: epoch that had it, counted from 1.
        scale: factor on the covariances that fits at the best epoch.
        metrics: validation scores of the best epoch, plain data.
        rows: the log.
    """

    epoch: int = 0
    batch: int = 0
    step: int = 0
    loss: float = 0.0
    agents: float = 0.0
    skipped: int = 0
    epoch_seconds: float = 0.0
    seconds: float = 0.0
    best: float = math.inf
    best_epoch: int = 0
    scale: float = 1.0
    metrics: dict[str, Any] = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)

    def count(self, loss: float, agents: float) -> None:
        """A step is done: its loss, averaged over so many agents."""
        self.step += 1
        self.batch += 1
        if math.isfinite(loss):
            self.loss += loss * agents
            self.agents += agents
        else:
            self.skipped += 1

    def mean_loss(self) -> float:
        """The loss of the epoch under way so far."""
        return self.loss / max(self.agents, 1.0)

    def finish_epoch(self) -> None:
        """The epoch is done, its row is in the log."""
        self.seconds += self.epoch_seconds
        self.epoch += 1
        self.batch = self.skipped = 0
        self.loss = self.agents = self.epoch_seconds = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain data for the checkpoint."""
        return dataclasses.asdict(self)
