# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Networks between two networks of the same architecture.

A network between a fine-tuned one and the one it started from forgets less of the old data than
the fine-tuned one, and is often better on the new data, too (M. Wortsman et al., "Robust
fine-tuning of zero-shot models", CVPR 2022).
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

SHARES = (0.25, 0.5, 0.75, 1.0)
"""Shares of the fine-tuned weights among which the adaptation chooses (chosen: a finer choice is
within the noise of a few minutes of validation)."""


def between(
    base: Mapping[str, Tensor], tuned: Mapping[str, Tensor], share: float
) -> dict[str, Tensor]:
    """Return the weights that are ``share`` of the way from one network to another.

    Args:
        base: weights and buffers by name.
        tuned: the same of the fine-tuned network. What is not a floating-point number is taken
            from here.
        share: 0 for ``base``, 1 for ``tuned``.
    """
    return {
        name: torch.lerp(base[name], value, share) if value.is_floating_point() else value
        for name, value in tuned.items()
    }
