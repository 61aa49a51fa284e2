# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The fields of the next window that a training scene is paired with.

Two predictions of the same road user, made a moment apart, should agree unless something happened
in between. The consistency loss compares them, so both must be in the sample.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch_geometric.data import Data

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.frames import rotate
from mtpgo_core.schema import (
    MOVING_MPS,
    AgentClass,
    BoolArray,
    Float64Array,
    HistoryWindow,
    SceneBatch,
)
from mtpgo_training.scenes.augmentation import Augmentation
from mtpgo_training.scenes.windows import TrackedWindow

IntArray = NDArray[np.int64]

_TOLERANCE = 0.02
"""Share of a horizon step by which the time between two windows may differ from a whole number of
steps; chosen above what frames of 29.97 Hz need."""


def steps_between_windows(stride_s: float, dt_s: float, horizon_steps: int) -> int:
    """Return the number of horizon steps from a window to the next.

    Args:
        stride_s: time between two windows (s).
        dt_s: step of the horizon (s).
        horizon_steps: H.

    Raises:
        ConfigurationError: it is no whole number of steps, or not within the horizon.
    """
    steps = round(stride_s / dt_s)
    if not _is_whole(stride_s / dt_s) or not 1 <= steps < horizon_steps:
        raise ConfigurationError(
            f"data.stride_s is {stride_s:g} but optimisation.consistency_weight compares the "
            f"predictions of one window with those of the next, expected a multiple of "
            f"history.dt_s, {dt_s:g} s, below the horizon of {horizon_steps * dt_s:g} s"
        )
    return steps


def are_steps_apart(earlier_ns: int, later_ns: int, dt_s: float, steps: int) -> bool:
    """Return whether two stamps (ns) are ``steps`` steps of ``dt_s`` (s) apart."""
    apart = (later_ns - earlier_ns) / (1e9 * dt_s)
    return _is_whole(apart) and round(apart) == steps


def present_row(tracked: TrackedWindow, track: int) -> int | None:
    """Return the row of a track that is present at a window's time, None if it is not."""
    rows = np.flatnonzero((tracked.track == track) & tracked.window.valid[:, -1])
    return int(rows[0]) if len(rows) else None


def is_compared(window: HistoryWindow) -> BoolArray:
    """Return [n] whether the predictions of an agent should not jump: it is a moving vehicle.

    Pedestrians change direction within a cycle, and standing agents may start, so jumps of their
    predictions are justified.
    """
    speed = np.linalg.norm(np.nan_to_num(window.velocity[:, -1]), axis=-1)
    moving: BoolArray = speed > MOVING_MPS
    return moving & (window.agent_class != AgentClass.PEDESTRIAN)


def alone(data: Data) -> dict[str, Tensor]:
    """Return the fields of :func:`paired` for a scene without a later one: no agent is in both."""
    count = int(data.num_nodes or 0)
    fields = {
        "later_x": data.x,
        "later_valid": data.valid,
        "later_both": torch.zeros(count),
        "later_change": torch.eye(2, 3).expand(count, 2, 3),
    }
    if "trails" in data:
        fields["later_trails"] = data.trails
    return fields


def paired(
    earlier: SceneBatch,
    track: IntArray,
    later: SceneBatch,
    later_track: IntArray,
    augmentation: Augmentation,
    features: tuple[str, ...],
    compared: BoolArray,
) -> dict[str, Tensor]:
    """Return the fields of a later scene in the order of an earlier scene's agents.

    Args:
        earlier: one graph.
        track: [N] tracks of its agents.
        later: one graph with the same centre, from the next window.
        later_track: [n] tracks of its agents.
        augmentation: of both.
        features: their names.
        compared: [N] agents whose predictions are to be compared, see :func:`is_compared`.

    Returns:
        ``later_x`` [N, T, F], ``later_valid`` [N, T] and, if the task has trails, ``later_trails``
        [N, R, H, 3], zero and false for agents that are not in the later scene; ``later_both`` [N]
        is 1 for agents that are present in both and compared; ``later_change`` [N, 2, 3] is the
        turn and the shift (m) from the frame of the later scene to that of the earlier one. Static
        features are those of the earlier scene.
    """
    order = np.argsort(later_track)
    place = order[np.searchsorted(later_track[order], track).clip(max=len(order) - 1)]
    found = later_track[place] == track
    valid = later.valid[0][place] & found[:, None]
    x = augmentation.features(later.features[0][place], features)
    x[~valid] = 0.0
    both = valid[:, -1] & earlier.valid[0][:, -1] & compared
    change = torch.from_numpy(_frame_change(earlier, later, augmentation).astype(np.float32))
    fields = {
        "later_x": torch.from_numpy(x),
        "later_valid": torch.from_numpy(valid),
        "later_both": torch.from_numpy(both.astype(np.float32)),
        "later_change": change.expand(len(track), 2, 3),
    }
    if later.trails is not None:
        trails = augmentation.trails(later.trails[0][place]) * found[:, None, None, None]
        fields["later_trails"] = torch.from_numpy(trails)
    return fields


def _is_whole(steps: float) -> bool:
    return abs(steps - round(steps)) < _TOLERANCE


def _frame_change(
    earlier: SceneBatch, later: SceneBatch, augmentation: Augmentation
) -> Float64Array:
    """Return [2, 3] the turn and the shift from the later scene's frame to the earlier one's.

    An augmentation maps the vectors of both frames, so the turn becomes A R A^-1.
    """
    turn = float(later.rotation[0] - earlier.rotation[0])
    shift = rotate(later.origin[0] - earlier.origin[0], -float(earlier.rotation[0]))
    axes = rotate(np.eye(2), turn)  # row i: image of the later frame's axis i
    augmented = augmentation.vectors(np.eye(2))
    rows = np.linalg.inv(augmented) @ axes @ augmented
    return np.concatenate([rows.T, augmentation.vectors(shift)[:, None]], axis=1)
