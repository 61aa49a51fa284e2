# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node's live scores, computed again from a bag of what it observed and predicted."""

from __future__ import annotations

from collections import deque
from collections.abc import Container, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from msg_adapters.bags.bag_reader import DecodingBagReader, bag_name
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.output_assembly import delay_ns
from mtpgo_core.quality.outcome_matcher import OutcomeMatcher
from mtpgo_core.quality.quality_report import SCORES, QualityLimits, QualityReport
from mtpgo_core.quality.rolling_scores import RollingScores
from mtpgo_core.schema import Prediction
from mtpgo_core.task.calibration import GROUPS
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.readers.bags.bag_pieces import BagPiece, PieceReader
from mtpgo_training.data.readers.bags.bag_topics import objects_topic
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions

_ANY_NUMBER = QualityLimits(min_agents=1)


def replayed_quality(
    bag: Path,
    predictions: Sequence[Prediction],
    config: HistoryConfig,
    options: ReadingOptions = AS_USUAL,
) -> QualityReport:
    """Return the scores as the node has them after the last observation of a bag.

    Observations and predictions take the way that they take in the node, message by message, so
    that the history's verdicts on odd input are the same.

    Args:
        bag: holds the observations.
        predictions: what was published, in that order. A stamp may occur again where the clock
            was set back, as where a bag is played in a loop.
        config: of the node's history.
        options: how the observations are read.

    Raises:
        RecordingError: the bag has no tracked objects, or is damaged.
    """
    history, matcher = TrackHistory(config), OutcomeMatcher(config)
    scores = RollingScores(config.dt_s)
    passes = _passes(predictions)
    waiting: dict[int, Prediction] | None = None
    taken = frozenset(prediction.stamp_ns for prediction in predictions)
    for piece in _pieces(bag, options, taken):
        first = piece.states[0]
        if len(history) and first.frame_id != history.frame_id:
            history.clear()
            matcher.clear("frame_changed")
        elif first.stamp_ns < (history.newest_stamp_ns or 0):
            history.clear()
            matcher.clear("clock_reset")
            waiting = None
        if waiting is None and passes and any(s.stamp_ns in passes[0] for s in piece.states):
            waiting = passes.popleft()
        for states in piece.states:
            scores.update(matcher.update(history, history.update(states)))
            prediction = (waiting or {}).pop(states.stamp_ns, None)
            if prediction is not None and len(prediction):
                start_ns = states.stamp_ns + delay_ns(prediction)
                matcher.add(prediction, history.window(start_ns))
    return scores.report(matcher.unknown)


def quality_rows(report: QualityReport) -> list[dict[str, Any]]:
    """Return the scores of every window, group and time that was predicted, for JSON.

    Scores are given for any number of agents; None where there are none.
    """
    rows = []
    for row in report.rows(_ANY_NUMBER):
        if not row["predictions"]:
            continue
        values = {name: row[name].item() for name in row.dtype.names}
        values["group"] = GROUPS[values["group"]]
        for name in SCORES:
            values[name] = values[name] if np.isfinite(values[name]) else None
        rows.append(values)
    return rows


def _passes(predictions: Sequence[Prediction]) -> deque[dict[int, Prediction]]:
    """Return predictions by stamp (ns), apart where the clock was set back."""
    passes: deque[dict[int, Prediction]] = deque()
    newest_ns: int | None = None
    for prediction in predictions:
        if newest_ns is None or prediction.stamp_ns < newest_ns:
            passes.append({})
        newest_ns = prediction.stamp_ns
        passes[-1][newest_ns] = prediction
    return passes


def _pieces(bag: Path, options: ReadingOptions, taken: Container[int]) -> Iterator[BagPiece]:
    """Yield what the node accepted from the bag's topic of tracked objects, as it came."""
    with DecodingBagReader(bag) as reader:
        topic = objects_topic(reader, options.bags.topic_of(bag_name(bag)))
        yield from PieceReader(reader, topic, options, taken).pieces()
