# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Exported models on recordings, by the very path that the node takes.

Protocol ``all``: under the graph policy of the node (``cover`` by default) every agent counts once
an instant. Protocol ``centre``: every agent is predicted in the graph of which it is the centre
(policy ``each``), as the paper evaluates. All models see the same history windows, which are made
once, and so are the baselines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.prediction.scene_predictor import PredictorOptions, ScenePredictor
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import HistoryWindow, Prediction
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.extreme_scenes import SceneKeeper
from mtpgo_training.evaluation.scorebook import ScoreBook
from mtpgo_training.evaluation.scorer import Judge
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.windows import frames_every

CENTRE_EVERY = 5
"""The protocol ``centre``, which costs a graph an agent, is scored at every so many instants."""

MAX_AGENTS = 10_000
"""No agent is left to constant velocity offline."""


@dataclass(frozen=True)
class Settings:
    """What is scored.

    Attributes:
        policy: graph policy of the protocol ``all``, None for the models' own.
        stride_s: time between two scored instants (s).
        centre: score the protocol ``centre`` too.
        min_future_s: agents observed for a shorter time afterwards are left out (s).
        one_sample: forget the past before each instant, as if everybody were seen for the first
            time.
    """

    policy: str | None = None
    stride_s: float = 0.2
    centre: bool = True
    min_future_s: float = 0.0
    one_sample: bool = False


@dataclass
class Evaluation:
    """What came out.

    Attributes:
        book: the scores.
        recordings: name in the book -> SHA-256 of its sources.
        scenes: by model, those worth a picture; only of models named when it was made.
    """

    book: ScoreBook = field(default_factory=ScoreBook)
    recordings: dict[str, str] = field(default_factory=dict)
    scenes: dict[str, SceneKeeper] = field(default_factory=dict)

    def merge(self, other: Evaluation) -> None:
        """Take the results on other recordings in."""
        self.book.merge(other.book)
        self.recordings.update(other.recordings)
        for name, keeper in other.scenes.items():
            self.scenes.setdefault(name, SceneKeeper()).merge(keeper)


def make_predictor(
    runner: ModelRunner, recording: Recording, policy: str | None = None
) -> ScenePredictor:
    """What the node would run on this recording."""
    return ScenePredictor(
        runner,
        options=PredictorOptions(policy=policy, max_agents=MAX_AGENTS),
        lanes=LaneMap(recording.lanes) if recording.lanes else None,
    )


def predict_recording(
    runner: ModelRunner, recording: Recording, *, policy: str | None = None, stride_s: float = 0.2
) -> Iterator[Prediction]:
    """The predictions that the node would publish on a recording.

    Args:
        runner: the model.
        recording: every frame is observed.
        policy: graph policy, None for the model's own.
        stride_s: time between two predictions (s).
    """
    predictor = make_predictor(runner, recording, policy)
    stamps_ns = map(recording.stamp_ns, frames_every(recording, stride_s).tolist())
    for window in replay(recording, runner.task.history, stamps_ns):
        yield predictor.predict(window)


def evaluate_recording(
    result: Evaluation,
    runners: Mapping[str, ModelRunner],
    recording: Recording,
    settings: Settings,
    *,
    name: str | None = None,
    tick: Callable[[], object] = lambda: None,
) -> None:
    """Score models and baselines on one recording.

    Args:
        result: takes the scores.
        runners: models by name. The baselines use the history of the first.
        recording: what they are scored on.
        settings: see :class:`Settings`.
        name: of the recording in the result, its own by default.
        tick: called after each frame.
    """
    name = recording.name if name is None else name
    result.recordings[name] = recording.sha256
    first = next(iter(runners), None)
    for group in _same_history(runners):
        history = runners[group[0]].task.history
        judge = Judge(
            recording, max_gap_s=history.max_gap_s, min_future_s=settings.min_future_s, name=name
        )
        entries = [
            _Entry(model, protocol, make_predictor(runners[model], recording, policy))
            for model in group
            for protocol, policy in (("all", settings.policy), ("centre", "each"))
            if protocol == "all" or settings.centre
        ]
        for window, protocols in _windows(recording, history, settings, tick):
            for entry in entries:
                if entry.protocol in protocols:
                    entry.score(result, judge, window, baselines=entry.model == first)


@dataclass(frozen=True)
class _Entry:
    """One model by one protocol on one recording."""

    model: str
    protocol: str
    predictor: ScenePredictor

    def score(
        self, result: Evaluation, judge: Judge, window: HistoryWindow, *, baselines: bool
    ) -> None:
        prediction = self.predictor.predict(window)
        if not len(prediction):
            return
        rows, seen, scores = judge.add(result.book, prediction, self.model, self.protocol)
        keeper = result.scenes.get(self.model) if self.protocol == "all" else None
        cv = None
        if baselines:
            cv = judge.add_baselines(result.book, window, seen, self.protocol)
        elif keeper is not None:
            cv = judge.add_baselines(ScoreBook(), window, seen, self.protocol)
        if keeper is not None and cv is not None:
            ade, age_s = scores.values["ade"], judge.age_s(seen.track, prediction.stamp_ns)
            keeper.offer(judge.recording, prediction, rows, seen.mask, ade, cv, age_s)


def _windows(
    recording: Recording,
    history: HistoryConfig,
    settings: Settings,
    tick: Callable[[], object],
) -> Iterator[tuple[HistoryWindow, set[str]]]:
    """The windows of all scored instants, each with the protocols it serves."""
    strides = {"all": settings.stride_s, "centre": CENTRE_EVERY * settings.stride_s}
    frames = {p: set(frames_every(recording, stride).tolist()) for p, stride in strides.items()}
    scored = sorted(set.union(*frames.values()))
    windows = replay(
        recording,
        history,
        map(recording.stamp_ns, scored),
        one_sample=settings.one_sample,
        on_frame=tick,
    )
    for frame, window in zip(scored, windows, strict=True):
        yield window, {protocol for protocol, chosen in frames.items() if frame in chosen}


def _same_history(runners: Mapping[str, ModelRunner]) -> list[list[str]]:
    """Names of models that see the same windows, together."""
    groups: dict[HistoryConfig, list[str]] = {}
    for name, runner in runners.items():
        groups.setdefault(runner.task.history, []).append(name)
    return list(groups.values())


def evaluate_all(
    runners: Mapping[str, ModelRunner],
    recordings: Iterable[tuple[str, Recording]],
    settings: Settings,
    *,
    draw: Sequence[str] = (),
    progress: Callable[[str, int], Callable[[], object]] = lambda name, frames: lambda: None,
) -> Evaluation:
    """Scores of models and baselines over recordings, of which only one need be in memory.

    Args:
        runners: models by name.
        recordings: names and recordings, taken one after the other.
        settings: see :class:`Settings`.
        draw: models whose best and worst scenes are kept for a picture.
        progress: given each recording's name and number of steps, what to call after each.
    """
    result = Evaluation(scenes={name: SceneKeeper() for name in draw})
    histories = max(1, len(_same_history(runners)))
    for name, recording in recordings:
        tick = progress(name, histories * len(recording.frames))
        evaluate_recording(result, runners, recording, settings, name=name, tick=tick)
    return result
