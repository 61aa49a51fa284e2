# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Replay of a recording through the history of the node."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator

from mtpgo_core.history.track_history import TrackHistory, UpdateReport
from mtpgo_core.schema import HistoryWindow
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.recording import Recording


def replay(
    recording: Recording,
    config: HistoryConfig,
    stamps_ns: Iterable[int],
    *,
    ahead_ns: Iterable[int] = itertools.repeat(0),
    one_sample: bool = False,
    on_frame: Callable[[], object] = lambda: None,
    on_update: Callable[[TrackHistory, UpdateReport], object] = lambda history, report: None,
) -> Iterator[HistoryWindow]:
    """Yield the window of the history at each stamp, after all observations up to it.

    Args:
        recording: every frame up to the last stamp is observed.
        config: grid and estimators of the history.
        stamps_ns: ascending times (ns).
        ahead_ns: how much later than its stamp the time of each window is (ns), as in a node that
            compensates its delay.
        one_sample: forget the past before each frame, as if every agent were seen for the first
            time.
        on_frame: called after each observed frame.
        on_update: called with the history after each observed frame.
    """
    history = TrackHistory(config)
    states = recording.states()
    upcoming = next(states, None)
    for stamp_ns, ahead in zip(stamps_ns, ahead_ns, strict=False):
        while upcoming is not None and upcoming.stamp_ns <= stamp_ns:
            if one_sample:
                history.clear()
            on_update(history, history.update(upcoming))
            on_frame()
            upcoming = next(states, None)
        yield history.window(stamp_ns + ahead)
