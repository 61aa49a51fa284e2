# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of an adaptation."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mtpgo_core.options import LARGEST_SEED, LARGEST_THREADS, check_options, option

FEWEST_AGENTS = 50
"""Fewest moving agents, each at one instant, by whose errors two models are compared (chosen)."""


@dataclass(frozen=True)
class AdaptOptions:
    """How a model is adapted.

    Attributes:
        minutes: time limit of everything, reading the recordings included (min).
        epochs: most epochs; fewer where they would take too long.
        epoch_scenes: about how many scenes an epoch has; of more, other ones are drawn each time.
        learning_rate: its highest value, from which it falls to nearly none at the last epoch.
        validation_fraction: share of the time, at the end of each directory's recordings, on which
            the model is chosen and calibrated.
        seed: of the order of the scenes and their augmentation.
        num_threads: threads of torch.
    """

    minutes: float = option(10.0, above=0)
    epochs: int = option(8, above=0)
    epoch_scenes: int = option(1000, above=0)
    learning_rate: float = option(2e-3, above=0, below=math.inf)
    validation_fraction: float = option(0.25, above=0.0, below=1.0)
    seed: int = option(1, low=0, high=LARGEST_SEED)
    num_threads: int = option(2, low=0, high=LARGEST_THREADS)

    def __post_init__(self) -> None:
        check_options(self, "adapt.")
