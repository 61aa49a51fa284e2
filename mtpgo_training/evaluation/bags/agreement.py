# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Agreement of recorded predictions with those that a model file makes offline, per agent."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from mtpgo_core.history.track_index import find_sort_keys, sort_keys
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.schema import Float64Array, Prediction, Source
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.offline_predictor import make_predictor
from mtpgo_training.scenes.history_replay import replay

_SAME_WEIGHT = 1e-5
"""Modes whose weights differ by less may be in another order after the conversion to float32;
chosen: about a hundred times the rounding of a weight."""


@dataclass
class Agreement:
    """Differences between two sets of predictions of the same scenes.

    Attributes:
        differences_m: of each agent at each instant, the largest distance between two means over
            all modes and steps (m).
        unpaired: agents that only one of the two predicted by the model.
        where: recording, time of the stamp (s) and track of the largest difference.
    """

    differences_m: list[float] = field(default_factory=list)
    unpaired: int = 0
    where: str = ""

    def add(self, recorded: Prediction, own: Prediction, recording: Recording, name: str) -> None:
        """Compare two predictions of one instant."""
        sortable = sort_keys(own.key)
        order = np.argsort(sortable)
        place = find_sort_keys(sortable[order], sort_keys(recorded.key))
        row = np.where(place >= 0, order[place], -1) if len(own) else place
        both = (row >= 0) & (recorded.source == Source.MODEL)
        both &= own.source[row] == Source.MODEL
        self.unpaired += int((~both).sum())
        if not both.any():
            return
        apart = _apart(recorded, own, np.flatnonzero(both), row[both])
        if not apart.max() <= max(self.differences_m, default=-1.0):
            worst = int(np.flatnonzero(both)[np.argmax(apart)])
            (index,) = recording.find_tracks(recorded.key[worst : worst + 1])
            track = recording.track_id[index]
            since_s = (recorded.stamp_ns - recording.span_ns[0]) * 1e-9
            self.where = f"road user {track} of {name} at {since_s:.1f} s"
        self.differences_m += apart.tolist()

    def text(self, bag: str, model: str) -> str:
        """Return one sentence for the terminal."""
        if not self.differences_m:
            return (
                f"{bag} and {model}: nothing to compare, no road user was predicted by the model "
                "in both"
            )
        values = 1e3 * np.array(self.differences_m)
        rest = f"; {self.unpaired} not in both" if self.unpaired else ""
        return (
            f"{bag} and {model}, agent by agent: the means of {len(values)} predictions differ by "
            f"{values.max():.3f} mm at most ({self.where}), "
            f"median {np.median(values):.3f} mm{rest}"
        )

    def to_dict(self) -> dict[str, float | int | str | None]:
        """Return plain data for JSON, in mm."""
        values = 1e3 * np.array(self.differences_m)
        return {
            "largest_mm": float(values.max()) if len(values) else None,
            "median_mm": float(np.median(values)) if len(values) else None,
            "predictions": len(values),
            "unpaired": self.unpaired,
            "where": self.where,
        }


def replay_offline(
    runner: ModelRunner, recording: Recording, stamps: Sequence[int], ahead_ns: Iterable[int]
) -> Iterator[tuple[Prediction, Prediction]]:
    """Yield the model's predictions at ascending stamps (ns), from all observations up to each.

    Their horizons begin ``ahead_ns`` later (ns), see
    :func:`~mtpgo_training.scenes.history_replay.replay`.

    Each comes with the calibration in the model's file and with the online one. The graphs depend
    on those of the cycle before, so only the same sequence of instants gives the same scenes.
    """
    history, predictor = runner.task.history, make_predictor(runner, recording)
    live = LiveCalibration(LiveOptions(), history, runner.task.horizon_steps)
    for window in replay(recording, history, stamps, ahead_ns=ahead_ns, on_update=live.observe):
        prediction = predictor.predict(window)
        yield prediction, live.serve(prediction, window)


def _apart(
    one: Prediction, two: Prediction, first: np.ndarray, second: np.ndarray
) -> Float64Array:
    """[k] largest distance between the means of agents ``first`` and ``second`` (m)."""
    modes = min(one.weight.shape[1], two.weight.shape[1])
    steps = min(len(one.time_s), len(two.time_s))
    a, b = (p.mean[rows][:, :modes, :steps, :2] for p, rows in ((one, first), (two, second)))
    apart = np.linalg.norm(a[:, :, None] - b[:, None], axis=-1).max(axis=-1)  # [k, M, M]
    wa, wb = one.weight[first][:, :modes], two.weight[second][:, :modes]
    may_pair = np.abs(wa[:, :, None] - wb[:, None]) < _SAME_WEIGHT
    may_pair |= np.eye(modes, dtype=bool)
    return np.asarray(np.where(may_pair, apart, np.inf).min(axis=2).max(axis=1))
