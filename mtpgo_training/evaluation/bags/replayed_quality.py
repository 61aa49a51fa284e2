# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node's live scores, computed again from a bag of what it observed and predicted."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from msg_adapters.bags.bag_reader import DecodingBagReader
from mtpgo_core.errors import MessageError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.quality.outcome_matcher import OutcomeMatcher
from mtpgo_core.quality.quality_report import SCORES, QualityLimits, QualityReport
from mtpgo_core.quality.rolling_scores import RollingScores
from mtpgo_core.schema import Prediction, TrackedStates
from mtpgo_core.task.calibration import GROUPS
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.readers.bag_poses import BagPoses
from mtpgo_training.data.readers.bag_topics import objects_topic

_STAMP_TOLERANCE_NS, _CONFIRMATIONS = 1_000_000_000, 3
"""How far a stamp may be ahead of the clock (ns), and from which message in a row on such stamps
are accepted; the node's defaults."""

_ANY_NUMBER = QualityLimits(min_agents=1)


def replayed_quality(
    bag: Path, predictions: Sequence[Prediction], config: HistoryConfig
) -> QualityReport:
    """Return the scores as the node has them after the last observation of a bag.

    Observations and predictions take the way that they take in the node, message by message, so
    that the history's verdicts on odd input are the same.

    Args:
        bag: holds the observations.
        predictions: what was published, at most one of a stamp.
        config: of the node's history.

    Raises:
        RecordingError: the bag has no tracked objects, or is damaged.
    """
    history, matcher = TrackHistory(config), OutcomeMatcher(config)
    scores = RollingScores(config.dt_s)
    waiting = {prediction.stamp_ns: prediction for prediction in predictions}
    for states in _observations(bag):
        report = history.update(states)
        scores.update(matcher.update(history, report))
        prediction = waiting.pop(states.stamp_ns, None)
        if prediction is not None and len(prediction):
            # With delay compensation the horizon starts later than the observation.
            delay_s = float(prediction.time_s[0]) - config.dt_s
            start_ns = states.stamp_ns + 1000 * round(1e6 * delay_s)
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


def _observations(bag: Path) -> Iterator[TrackedStates]:
    """Yield what the node accepted from the bag's topic of tracked objects, as it came."""
    with DecodingBagReader(bag) as reader:
        connection, adapter = objects_topic(reader)
        poses, ahead = BagPoses(reader), 0
        for _, received_ns, message in reader.messages([connection]):
            with contextlib.suppress(MessageError):  # the node leaves such a message out
                states = poses.lift(adapter.to_states(message, fallback_stamp_ns=received_ns))
                if states is None or not states.stamp_ns:
                    continue
                # The node drops single stamps ahead of its clock, which the recorder's stands for.
                ahead = ahead + 1 if states.stamp_ns > received_ns + _STAMP_TOLERANCE_NS else 0
                if not 0 < ahead < _CONFIRMATIONS:
                    yield states
