# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A recording made ready once, so that scenes can be cut from it in any epoch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.lanes import LaneMap
from mtpgo_core.schema import Float64Array
from mtpgo_core.task import HistoryConfig, SceneConfig
from mtpgo_training.config import DataConfig
from mtpgo_training.futures import FutureTable
from mtpgo_training.recording import Recording
from mtpgo_training.sampling import centre_chances
from mtpgo_training.windows import TrackedWindow, cut_restarted_windows, cut_windows


@dataclass(frozen=True)
class Source:
    """One recording, ready for scenes to be cut from it.

    Attributes:
        recording: the recording.
        windows: its windows.
        restarted: windows of the same instants with short pasts, or empty.
        future: what happened next.
        lanes: its lanes, where the context needs them.
        chance: for each window, [tracks] the chance of a track to be a graph's centre.
        weight: how often its windows are drawn in an epoch.
    """

    recording: Recording
    windows: list[TrackedWindow]
    restarted: list[TrackedWindow]
    future: FutureTable
    lanes: LaneMap | None
    chance: list[Float64Array]
    weight: float = 1.0


def prepare(
    recording: Recording,
    history: HistoryConfig,
    scene: SceneConfig,
    data: DataConfig,
    *,
    training: bool,
    seed: int = 0,
    weight: float = 1.0,
) -> Source:
    """A recording's windows and futures.

    Args:
        recording: the recording.
        history: see :class:`mtpgo_core.task.HistoryConfig`.
        scene: see :class:`mtpgo_core.task.SceneConfig`.
        data: strides, restarts and smoothing.
        training: with the training's stride, smoothing and restarts, or the validation's.
        seed: of the restarts.
        weight: how often its windows are drawn in an epoch.
    """
    stride_s = data.stride_s if training else data.validation_stride_s
    restarted: list[TrackedWindow] = []
    if training and data.restart_probability > 0.0:
        generator = np.random.default_rng([seed, len(recording)])
        restarted = cut_restarted_windows(
            recording, history, stride_s, data.restart_within_s, generator
        )
    windows = cut_windows(recording, history, stride_s)
    future = FutureTable(
        recording,
        max_gap_s=history.max_gap_s,
        velocity_smoothing_s=data.velocity_smoothing_s if training else 0.0,
    )
    return Source(
        recording=recording,
        windows=windows,
        restarted=restarted,
        future=future,
        chance=[centre_chances(w, recording, future, data, history.dt_s) for w in windows],
        lanes=LaneMap(recording.lanes) if scene.context == "lanes" else None,
        weight=weight,
    )
