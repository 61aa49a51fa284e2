# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How different the modes of a mixture are, weighted: ``end`` [n, M, 2] (m), ``weight`` [n, M]."""

from __future__ import annotations

import numpy as np

from mtpgo_core.quality.metrics import Array

NEAR_M = 1.0
"""Modes that end within this of the heaviest are of its opinion (m); chosen: half of the distance
beyond which a prediction is a miss."""


def mode_distance(end: Array, weight: Array) -> Array:
    """[n] expected distance of two modes drawn by weight (m), zero if one has all of it."""
    apart = np.linalg.norm(end[:, :, None] - end[:, None], axis=-1)
    return np.einsum("ni,nj,nij->n", weight, weight, apart)


def weight_near_heaviest(end: Array, weight: Array, near_m: float = NEAR_M) -> Array:
    """[n] weight of the modes that end within ``near_m`` (m) of the heaviest, itself included."""
    row = np.arange(len(weight))
    apart = np.linalg.norm(end - end[row, weight.argmax(axis=1)][:, None], axis=-1)
    return np.asarray((weight * (apart <= near_m)).sum(axis=1))
