# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A recording prepared once, so that scenes can be cut from it in any epoch."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_core.schema import Float64Array
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.ground_truth import FutureTable, future_columns
from mtpgo_training.data.recording import Columns, Recording
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.scenes.centre_sampling import Candidates, centre_chances
from mtpgo_training.scenes.lane_change_balancing import lane_changes
from mtpgo_training.scenes.recorded_trails import recorded_trails
from mtpgo_training.scenes.track_samples import SampleTable, take_in
from mtpgo_training.scenes.tracker.simulated_tracker import (
    SimulatedTracker,
    draw_tracker,
    tracked_columns,
)
from mtpgo_training.scenes.windows import Windows, cut_tracks, windows_of, with_pieces

RECORDED, RESTARTED, TRACKED = 0, 1, 2
"""Numbers of the views of a recording: as recorded, with short pasts, and from ``TRACKED`` on as
the simulated trackers report it."""


@dataclass(frozen=True)
class View:
    """A recording as it is observed.

    Attributes:
        windows: its windows, of the same instants in all views.
        trails: the trails that these observations leave, None if the task has none.
    """

    windows: Windows
    trails: TrailMemory | None = None


@dataclass(frozen=True)
class PreparedRecording:
    """One recording with its windows, futures and sampling weights.

    Attributes:
        recording: the recording.
        windows: its windows.
        restarted: windows of the same instants with short pasts, None if not wanted.
        tracked: as simulated trackers report it.
        future: the future of its tracks.
        lanes: its lanes if the context needs them.
        chance: [p] chance of the agents of ``windows.instants`` to be a graph's centre.
        changes: [p] their lane changes, see
            :func:`mtpgo_training.scenes.lane_change_balancing.lane_changes`; None where graphs are
            not balanced.
        weight: how often its windows are drawn in an epoch.
        trails: where its road users went, None if the task has no trails.
        site: where it was recorded: its directory and, where the data set names one, the location.
    """

    recording: Recording
    windows: Windows
    restarted: Windows | None
    future: FutureTable
    lanes: LaneMap | None
    chance: Float64Array
    changes: NDArray[np.int8] | None = None
    weight: float = 1.0
    trails: TrailMemory | None = None
    tracked: tuple[View, ...] = ()
    site: str = ""

    @property
    def views(self) -> tuple[View, ...]:
        """The views by number; without restarts, the one as recorded in their place."""
        restarted = self.windows if self.restarted is None else self.restarted
        return (View(self.windows, self.trails), View(restarted, self.trails), *self.tracked)

    def candidates(self, window: int, view: int = RECORDED) -> Candidates:
        """Return the agents present in a window of one of the views."""
        instants = self.windows.instants
        rows = instants.rows(window)
        changes = np.empty(0, dtype=np.int8) if self.changes is None else self.changes[rows]
        index = np.flatnonzero(instants.present[rows])
        other = self.views[view].windows.instants
        if other is instants:
            known = changes[index] if len(changes) else changes
            return Candidates(
                index, instants.position[rows][index], self.chance[rows][index], known
            )
        # The window of another view has the agents in other rows.
        at = np.full(len(self.recording.track_id), -1)
        at[instants.track[rows]] = np.arange(rows.stop - rows.start)
        mine = other.rows(window)
        index = np.flatnonzero(other.present[mine])
        place = at[other.track[mine][index]]
        chance = np.where(place >= 0, self.chance[rows][place], 1.0)
        known = changes[place] if len(changes) else changes
        return Candidates(index, other.position[mine][index], chance, known)


def prepare(
    recording: Recording,
    history: HistoryConfig,
    scene: SceneConfig,
    data: DataConfig,
    *,
    training: bool,
    horizon_steps: int = 25,
    seed: int = 0,
    weight: float = 1.0,
    cache: RecordingCache | None = None,
) -> PreparedRecording:
    """Prepare a recording: compute its windows, futures and sampling weights.

    Args:
        recording: the recording.
        history: see :class:`mtpgo_core.task.task_description.HistoryConfig`.
        scene: see :class:`mtpgo_core.task.task_description.SceneConfig`.
        data: strides, restarts, smoothing and balancing.
        training: use stride, smoothing and restarts of training, else those of validation.
        horizon_steps: steps over which lane changes are looked for.
        seed: seed of the restarts and trackers.
        weight: how often its windows are drawn in an epoch.
        cache: cache of the columns that are costly to compute.
    """
    cached = _CachedColumns(recording, cache)
    stride_s = data.stride_s if training else data.validation_stride_s
    settings = dataclasses.asdict(history)
    table = cached.columns("samples", settings, functools.partial(take_in, recording, history))
    samples = SampleTable(table, history)
    windows = windows_of(recording, samples, stride_s)
    restarted: Windows | None = None
    if training and data.restart_probability > 0.0:
        restarted = _restarted(cached, windows, history, data.restart_within_s, seed)
    trails = recorded_trails(recording, samples) if scene.trails else None
    tracked = tuple(
        _tracked(cached, tracker, windows, trails, history, data.restart_within_s)
        for tracker in trackers_of(recording, data, training=training, seed=seed)
    )
    smoothing_s = data.velocity_smoothing_s if training else 0.0
    future = FutureTable(
        recording,
        max_gap_s=history.max_gap_s,
        columns=cached.columns(
            "future", smoothing_s, functools.partial(future_columns, recording, smoothing_s)
        ),
    )
    changes = None
    if training and data.lane_change_share > 0.0:
        changes = lane_changes(windows, recording, future, horizon_steps, history.dt_s)
    return PreparedRecording(
        recording=recording,
        windows=windows,
        restarted=restarted,
        future=future,
        chance=centre_chances(windows, recording, future, data, history.dt_s),
        changes=changes,
        lanes=LaneMap(recording.lanes) if scene.uses_lanes else None,
        weight=weight,
        trails=trails,
        tracked=tracked,
    )


@dataclass(frozen=True)
class _CachedColumns:
    """Columns of a recording, from a cache if there is one."""

    recording: Recording
    cache: RecordingCache | None

    def columns(
        self,
        purpose: str,
        settings: object,
        make: Callable[[], Columns],
        *code: Callable[..., Any],
    ) -> Columns:
        """Return columns; the arguments are those of :meth:`RecordingCache.columns`."""
        if self.cache is None:
            return make()
        return self.cache.columns(self.recording, purpose, settings, make, *code)


def _restarted(
    cached: _CachedColumns,
    windows: Windows,
    history: HistoryConfig,
    within_s: float,
    seed: int,
) -> Windows:
    """Return the windows of the same instants with tracks that are cut to short pasts."""
    recording = cached.recording
    generator = np.random.default_rng([seed, len(recording)])
    pieces, owner = cut_tracks(recording, within_s, generator)
    table = cached.columns(
        "restarted",
        {**dataclasses.asdict(history), "seed": seed, "within_s": within_s},
        functools.partial(take_in, pieces, history),
        cut_tracks,
    )
    return Windows(pieces, SampleTable(table, history), windows.instants.stamp_ns, owner)


def _tracked(
    cached: _CachedColumns,
    tracker: SimulatedTracker,
    windows: Windows,
    trails: TrailMemory | None,
    history: HistoryConfig,
    restart_within_s: float,
) -> View:
    """Return a recording as a simulated tracker reports it, at the instants of ``windows``.

    Args:
        cached: the columns of the recording.
        tracker: the tracker.
        windows: as recorded.
        trails: as recorded, None if the task has none.
        history: see :func:`prepare`.
        restart_within_s: longest past of the tracks of a tracker that restarts (s).
    """
    recording = cached.recording
    within_s = restart_within_s if tracker.restarts else None
    table = cached.columns(
        "tracked",
        {
            **dataclasses.asdict(history),
            "tracker": dataclasses.asdict(tracker),
            "within_s": within_s,
        },
        functools.partial(tracked_columns, recording, tracker, history, within_s),
    )
    owner, reported = table["owner"], tracker.attributes(recording)
    if tracker.restarts:
        reported = with_pieces(reported, owner)
    samples = SampleTable(table, history)
    # The pieces of a tracker that restarts have keys of their own: it keeps the recorded trails.
    if trails is not None and not tracker.restarts:
        trails = recorded_trails(reported, samples)
    return View(Windows(reported, samples, windows.instants.stamp_ns, owner), trails)


def trackers_of(
    recording: Recording, data: DataConfig, *, training: bool, seed: int
) -> list[SimulatedTracker]:
    """Return the simulated trackers of a training or validation recording.

    Validation recordings have the same one whatever the seed of a run, so that runs are compared
    on the same observations.

    Args:
        recording: the recording.
        data: number of trackers and share of restarts.
        training: use those of training.
        seed: seed of the trackers of training.
    """
    if not training:
        return [draw_tracker(recording, 0)] if data.validation_tracker else []
    if data.tracker_share <= 0.0:
        return []
    numbers, share = range(data.tracker_variants), data.restart_probability
    return [draw_tracker(recording, seed, n, restart_share=share) for n in numbers]


def prepare_all(
    named: Sequence[NamedRecording],
    history: HistoryConfig,
    scene: SceneConfig,
    data: DataConfig,
    *,
    training: bool,
    horizon_steps: int = 25,
    seed: int = 0,
    cache: RecordingCache | None = None,
    progress: bool = False,
) -> list[PreparedRecording]:
    """Prepare the recordings of one use, see :func:`prepare`.

    Args:
        named: the recordings.
        history: see :func:`prepare`.
        scene: see :func:`prepare`.
        data: see :func:`prepare`.
        training: see :func:`prepare`.
        horizon_steps: see :func:`prepare`.
        seed: see :func:`prepare`.
        cache: see :func:`prepare`.
        progress: show a bar on stderr.
    """
    what = "training recordings" if training else "validation recordings"
    return [
        dataclasses.replace(
            prepare(
                item.recording,
                history,
                scene,
                data,
                training=training,
                horizon_steps=horizon_steps,
                seed=seed,
                weight=source_weight(item, data),
                cache=cache,
            ),
            site="/".join(filter(None, (item.source, item.recording.location))),
        )
        for item in tqdm(named, desc=what, disable=not progress, leave=False)
    ]


def source_weight(item: NamedRecording, data: DataConfig) -> float:
    """Return ``data.source_weight`` of a recording, else of its directory, else 1."""
    for name in (item.name, f"{item.source}/{item.whole}", item.source):
        if name in data.source_weight:
            return data.source_weight[name]
    return 1.0
