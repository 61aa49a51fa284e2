# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Any predictions against the recording they were made on: online, offline or from a bag.

Tracks are matched by key and stamp. Beside the predictions stand the baselines at the same
instants for the same agents, from the history that the node would have had.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.constant_velocity import predict_constant_velocity
from mtpgo_core.history import TrackHistory
from mtpgo_core.schema import HistoryWindow, KeyArray, Prediction
from mtpgo_core.task import HistoryConfig
from mtpgo_training.baselines import BASELINES
from mtpgo_training.futures import FutureTable
from mtpgo_training.recording import Recording
from mtpgo_training.scorebook import ScoreBook, ScoreTable

IntArray = NDArray[np.int64]


def score(
    predictions: Iterable[Prediction],
    recording: Recording,
    *,
    history: HistoryConfig = HistoryConfig(),  # noqa: B008  frozen
    name: str = "model",
    protocol: str = "all",
) -> ScoreTable:
    """Scores of predictions and of the baselines beside them.

    Args:
        predictions: in the recording's frame and clock, in any order of time.
        recording: what happened.
        history: for the baselines' last observed states.
        name: what the predictions are called in the table.
        protocol: under which protocol they stand in the table.
    """
    book = ScoreBook()
    add_scores(book, predictions, recording, history=history, name=name, protocol=protocol)
    return book.table()


def add_scores(
    book: ScoreBook,
    predictions: Iterable[Prediction],
    recording: Recording,
    *,
    history: HistoryConfig = HistoryConfig(),  # noqa: B008  frozen
    name: str = "model",
    protocol: str = "all",
    baselines: bool = True,
    min_future_s: float = 0.0,
) -> None:
    """Like :func:`score`, into a book that may span recordings and models.

    Args:
        book: where the scores go.
        predictions: see :func:`score`, like the rest.
        recording: what happened.
        history: for the baselines.
        name: of the predictions.
        protocol: of the predictions.
        baselines: score the baselines too; only once for several models on the same instants.
        min_future_s: agents observed for a shorter time afterwards are left out (s).
    """
    ordered = sorted(predictions, key=lambda p: p.stamp_ns)
    future = FutureTable(recording, max_gap_s=history.max_gap_s)
    tracks = {key.tobytes(): i for i, key in enumerate(recording.key)}
    windows = _windows(recording, history, [p.stamp_ns for p in ordered])
    for prediction, window in zip(ordered, windows, strict=True):
        if not len(prediction):
            continue
        track = _find(prediction.key, tracks)
        horizon, dt_s = len(prediction.time_s), float(prediction.time_s[0])
        truth = future.at(track, prediction.stamp_ns, horizon, dt_s)
        rows = truth.known.sum(axis=1) >= max(1, round(min(min_future_s / dt_s, horizon)))
        book.add(
            name,
            protocol,
            mean=prediction.mean[rows][..., :2],
            weight=prediction.weight[rows],
            covariance=prediction.covariance[rows],
            truth=truth.position[rows],
            mask=truth.known[rows],
        )
        if baselines:
            chosen = track[rows]
            _add_baselines(
                book,
                protocol,
                window,
                tracks,
                chosen,
                truth.position[rows],
                truth.known[rows],
                dt_s,
            )


def _add_baselines(
    book: ScoreBook,
    protocol: str,
    window: HistoryWindow,
    tracks: dict[bytes, int],
    chosen: IntArray,
    truth: NDArray[np.float64],
    mask: NDArray[np.bool_],
    dt_s: float,
) -> None:
    """The baselines for those of the ``chosen`` tracks that the window holds at t."""
    held = _find(window.key, tracks)
    held[~window.valid[:, -1]] = -1
    at = {int(t): i for i, t in enumerate(held) if t >= 0}
    index = np.array([at.get(int(t), -1) for t in chosen], dtype=np.int64)
    there = index >= 0
    seen, truth, mask = window.select(index[there]), truth[there], mask[there]
    horizon = truth.shape[1]
    constant = predict_constant_velocity(seen, horizon_steps=horizon, dt_s=dt_s, modes=1)
    for name, baseline in BASELINES.items():
        book.add_path(
            name,
            protocol,
            path=baseline(seen, horizon, dt_s),
            covariance=constant.covariance[:, 0] if name == "cv" else None,
            truth=truth,
            mask=mask,
        )


def _windows(
    recording: Recording, config: HistoryConfig, stamps: list[int]
) -> Iterator[HistoryWindow]:
    """The history's window at each of the ascending stamps."""
    history = TrackHistory(config)
    states = recording.states()
    coming = next(states, None)
    for stamp in stamps:
        while coming is not None and coming.stamp_ns <= stamp:
            history.update(coming)
            coming = next(states, None)
        yield history.window(stamp)


def _find(keys: KeyArray, tracks: dict[bytes, int]) -> IntArray:
    """[n] track of each key, -1 where the recording has none."""
    return np.array([tracks.get(key.tobytes(), -1) for key in keys], dtype=np.int64)
