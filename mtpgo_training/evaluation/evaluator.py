# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Evaluation of exported models on recordings, with the predictor that the node runs.

Protocol ``all``: every agent counts once per instant, under the graph policy of the node
(``cover`` by default). Protocol ``centre``: every agent is predicted in the graph of which it is
the centre (policy ``each``), as in the paper. Models with the same history share the windows,
which are made once; the baselines use those of the first model.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.history.stream_guard import UpdateReport
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.history.track_index import find_sort_keys, sort_keys
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import MODEL as PREFER_MODEL
from mtpgo_core.live_calibration.live_options import OFF, SHIPPED, LiveOptions
from mtpgo_core.prediction.model_runner import ModelRunner, find_model
from mtpgo_core.prediction.scene_predictor import ScenePredictor
from mtpgo_core.schema import (
    AgentClass,
    Float64Array,
    HistoryWindow,
    IndexArray,
    Prediction,
    Source,
)
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.extreme_scenes import ExtremeScenes
from mtpgo_training.evaluation.honesty.agent_honesty import PredictedPaths
from mtpgo_training.evaluation.honesty.honesty_table import HonestyTable
from mtpgo_training.evaluation.offline_predictor import make_predictor
from mtpgo_training.evaluation.scorer import ScoredBaselines, ScoredPrediction, Scorer
from mtpgo_training.evaluation.scores.score_table import Averages, ScoreTable
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.kinematic_baselines import BASELINES
from mtpgo_training.scenes.taken_strides import rounded_strides
from mtpgo_training.scenes.tracker.simulated_tracker import draw_tracker
from mtpgo_training.scenes.windows import frames_every

CENTRE_EVERY = 5
"""The protocol ``centre`` is scored at every fifth instant; chosen: it needs a graph per agent.
Where paths are smoothed it is predicted at all of them, as the node would."""

HONESTY_PROTOCOL = "all"
"""The protocol whose predictions are also judged by honesty and plausibility: what users get."""


@dataclass(frozen=True)
class Settings:
    """What is scored.

    Attributes:
        policy: graph policy of the protocol ``all``, None for the models' own.
        stride_s: time between two scored instants (s).
        centre: score the protocol ``centre`` too.
        min_future_s: agents observed for a shorter time afterwards are left out (s).
        one_sample: forget the past before each instant, as if all agents were observed for the
            first time.
        trails: models see where earlier road users went, see
            :class:`~mtpgo_core.prediction.scene_predictor.PredictorOptions`.
        lanes: models with ``scene.lane_ways`` see the lanes of the recordings.
        tracker_seed: score what is predicted from the observations of a simulated tracker with
            this seed, None for the observations as recorded. The truth is the recording either
            way.
        calibration: what is applied to the models' output; ``online`` starts from the shipped
            calibration with each recording.
        prefer: who predicts, see :data:`~mtpgo_core.live_calibration.live_options.PREFERENCES`.
        correct_paths: whether the online calibration corrects paths, too.
        kde_samples: see :func:`~.scores.agent_scores.score_agents`.
        path_smoothing_s: memory of the farthest predicted points over the instants (s), 0 for
            none.
        unknown_classes: every road user is observed as one of an unknown class. The truth keeps
            its class, by which the scores are broken down.
        online_effect: also score what the online calibration makes of the same predictions
            (protocol ``all``).
    """

    policy: str | None = None
    stride_s: float = 0.2
    centre: bool = True
    min_future_s: float = 0.0
    one_sample: bool = False
    trails: bool = True
    lanes: bool = True
    tracker_seed: int | None = None
    calibration: str = SHIPPED
    prefer: str = PREFER_MODEL
    correct_paths: bool = True
    kde_samples: int = 0
    path_smoothing_s: float = 0.0
    unknown_classes: bool = False
    online_effect: bool = False

    @property
    def live(self) -> LiveOptions:
        """What a live calibration learns."""
        return LiveOptions(
            calibration=self.calibration, prefer=self.prefer, correct_paths=self.correct_paths
        )

    @property
    def online(self) -> LiveOptions:
        """What the live calibration learns whose effect is shown."""
        return LiveOptions(correct_paths=self.correct_paths)


@dataclass
class Evaluation:
    """The results of an evaluation.

    Attributes:
        scores: of models and baselines.
        honesty: of models and baselines.
        recordings: name in the scores -> SHA-256 of its sources.
        online: scores of the models with the online calibration beside that of their files; each
            recording starts with the latter.
        shipped: scores of the same predictions with the calibration of their files, of which
            ``scores`` may hold more.
        scenes: the best and worst scenes of those models for which an entry was made before.
        rounded: name in the scores -> time between two scored instants (s), of the recordings
            whose frames do not have the stride that was asked for.
        laneless: model with ``scene.lane_ways`` -> names in the scores of the recordings without
            lanes, where it follows none, as the node would.
    """

    scores: ScoreTable = field(default_factory=ScoreTable)
    recordings: dict[str, str] = field(default_factory=dict)
    honesty: HonestyTable = field(default_factory=HonestyTable)
    online: ScoreTable = field(default_factory=ScoreTable)
    shipped: ScoreTable = field(default_factory=ScoreTable)
    scenes: dict[str, ExtremeScenes] = field(default_factory=dict)
    rounded: dict[str, float] = field(default_factory=dict)
    laneless: dict[str, list[str]] = field(default_factory=dict)

    def add(
        self,
        model: str,
        protocol: str,
        scorer: Scorer,
        prediction: Prediction,
        window: HistoryWindow | None = None,
        *,
        baselines: bool = False,
    ) -> ScoredPrediction:
        """Score a prediction, and return its scores.

        Args:
            model: name of the model or bag that it comes from.
            protocol: ``all`` or ``centre``.
            scorer: of the recording.
            prediction: of any agents.
            window: the history it was made from, needed for the baselines, the scenes, and the
                plausibility of recorded predictions.
            baselines: score the baselines for the same agents too.
        """
        found = scorer.score(prediction)
        self.scores.add(model, protocol, found.scores, found.truth.agents)
        if protocol == HONESTY_PROTOCOL:
            self._add_honesty(model, protocol, scorer, prediction, found, window)
        scenes = self.scenes.get(model) if protocol == "all" else None
        if window is None or not (baselines or scenes is not None):
            return found
        reference = scorer.score_baselines(window, found.truth)
        if baselines:
            reference.add_to(self.scores, protocol)
            if protocol == HONESTY_PROTOCOL:
                self._add_baselines(protocol, scorer, prediction, found, reference, window)
        if scenes is not None:
            scenes.update(scorer, prediction, found, reference.cv_ade)
        return found

    def add_online(
        self, model: str, scorer: Scorer, prediction: Prediction, shipped: ScoredPrediction
    ) -> None:
        """Score a prediction of the protocol ``all`` with the online calibration.

        Args:
            model: name of the model.
            scorer: of the recording.
            prediction: with the online calibration.
            shipped: scores of the same prediction with the calibration of the model's file.
        """
        self.shipped.add(model, "all", shipped.scores, shipped.truth.agents)
        found = scorer.score(prediction)
        self.online.add(model, "all", found.scores, found.truth.agents)

    def _add_honesty(
        self,
        model: str,
        protocol: str,
        scorer: Scorer,
        prediction: Prediction,
        found: ScoredPrediction,
        window: HistoryWindow | None,
    ) -> None:
        agents, rows = found.truth.agents, np.flatnonzero(found.rows)
        start, yaw = _starts(prediction, rows, window)
        paths = PredictedPaths.of(
            agents,
            size=scorer.recording.size[agents.track],
            start=start,
            yaw=yaw,
            mean=prediction.mean[rows][..., :2],
            weight=prediction.weight[rows],
            covariance=prediction.covariance[rows],
            sigma_factor_50=prediction.sigma_factor_50[rows],
            by_model=prediction.source[rows] == Source.MODEL,
            truth=found.truth.position,
            mask=found.truth.mask,
        )
        self.honesty.add(model, protocol, agents, paths)

    def _add_baselines(
        self,
        protocol: str,
        scorer: Scorer,
        prediction: Prediction,
        found: ScoredPrediction,
        reference: ScoredBaselines,
        window: HistoryWindow,
    ) -> None:
        agents, rows = reference.truth.agents, np.flatnonzero(found.rows)[reference.rows]
        start, yaw = _starts(prediction, rows, window)
        for name, path in reference.paths.items():
            paths = PredictedPaths.of(
                agents,
                size=scorer.recording.size[agents.track],
                start=start,
                yaw=yaw,
                mean=path.position[:, None],
                weight=np.ones((len(agents.track), 1)),
                covariance=None if path.covariance is None else path.covariance[:, None],
                by_model=np.zeros(len(agents.track), dtype=np.bool_),
                truth=reference.truth.position,
                mask=reference.truth.mask,
            )
            self.honesty.add(name, protocol, agents, paths)

    def note_missing_lanes(
        self, runners: Mapping[str, ModelRunner], recording: Recording, name: str
    ) -> None:
        """Note which models would follow lanes and find none in a recording."""
        for model, runner in runners.items():
            if runner.task.scene.lane_ways and not recording.lanes:
                self.laneless.setdefault(model, []).append(name)

    def merge(self, other: Evaluation) -> None:
        """Add the results on other recordings."""
        self.scores.merge(other.scores)
        self.honesty.merge(other.honesty)
        self.online.merge(other.online)
        self.shipped.merge(other.shipped)
        self.recordings.update(other.recordings)
        self.rounded.update(other.rounded)
        for model, names in other.laneless.items():
            self.laneless.setdefault(model, []).extend(names)
        for name, scenes in other.scenes.items():
            self.scenes.setdefault(name, ExtremeScenes()).merge(scenes)


def _starts(
    prediction: Prediction, rows: IndexArray, window: HistoryWindow | None
) -> tuple[Float64Array, Float64Array]:
    """Return [k, 4] position and velocity (m, m/s) and [k] yaw (rad) of agents when predicted.

    Recorded predictions have none: they are those of the history, NaN where it has none.

    Args:
        prediction: of all agents.
        rows: [k] the agents wanted.
        window: the history at the time of the prediction.
    """
    start, yaw = prediction.initial[rows], prediction.initial_yaw[rows]
    known = np.isfinite(start).all(axis=1)
    if window is None or not len(window) or known.all():
        return start, yaw
    names = sort_keys(window.key)
    order = np.argsort(names, kind="stable")
    place = find_sort_keys(names[order], sort_keys(prediction.key[rows]))
    own = order[place]
    taken = ~known & (place >= 0) & window.valid[own, -1]
    state = [window.position[own, -1], np.nan_to_num(window.velocity[own, -1])]
    start = np.where(taken[:, None], np.concatenate(state, axis=1), start)
    return start, np.where(taken, np.nan_to_num(window.yaw[own, -1]), yaw)


def load_models(given: Sequence[str]) -> dict[str, ModelRunner]:
    """Load models; their names are those in the files, or of the files where names repeat.

    Args:
        given: files or names of shipped models, as given with ``--model``.

    Raises:
        ConfigurationError: a model is given twice, or has the name of a baseline.
    """
    loaded = [(str(one), ModelRunner.load(find_model(one))) for one in given]
    names = [runner.task.name for _, runner in loaded]
    if len(set(names)) < len(names):
        names = [runner.path.stem for _, runner in loaded]
    if len(set(names)) < len(names):
        names = [one for one, _ in loaded]
    if len(set(names)) < len(names):
        raise ConfigurationError(f"--model names {' '.join(given)}, expected each model once")
    taken = next((name for name in names if name in BASELINES), None)
    if taken is not None:
        raise ConfigurationError(f"a model is called {taken}, which is the name of a baseline")
    return dict(zip(names, (runner for _, runner in loaded), strict=True))


def evaluate_recording(
    result: Evaluation,
    runners: Mapping[str, ModelRunner],
    recording: Recording,
    settings: Settings,
    *,
    name: str | None = None,
    site: str | None = None,
    tick: Callable[[], object] = lambda: None,
) -> None:
    """Score models and baselines on one recording.

    Args:
        result: takes the scores.
        runners: models by name. The baselines use the history of the first.
        recording: what they are scored on.
        settings: see :class:`Settings`.
        name: of the recording in the result, its own by default.
        site: of the recording in the result, its location by default.
        tick: called after each frame.
    """
    name = recording.name if name is None else name
    result.recordings[name] = recording.sha256
    result.rounded |= rounded_strides({name: recording}, settings.stride_s)
    if settings.lanes:
        result.note_missing_lanes(runners, recording, name)
    first = next(iter(runners), None)
    if settings.calibration == OFF:
        runners = {model: runner.uncalibrated() for model, runner in runners.items()}
    observed = _observed(recording, settings)
    for group in _same_history(runners):
        history = runners[group[0]].task.history
        scorer = Scorer(
            recording,
            max_gap_s=history.max_gap_s,
            min_future_s=settings.min_future_s,
            name=name,
            site=site,
            kde_samples=settings.kde_samples,
        )
        predictors = {
            (model, protocol): make_predictor(
                runners[model],
                recording,
                policy,
                settings.path_smoothing_s,
                trails=settings.trails,
                lanes=settings.lanes,
            )
            for model in group
            for protocol, policy in (("all", settings.policy), ("centre", "each"))
            if protocol == "all" or settings.centre
        }
        live = {
            key: LiveCalibration(settings.live, history, runners[key[0]].task.horizon_steps)
            for key in predictors
        }
        online = {
            model: LiveCalibration(settings.online, history, runners[model].task.horizon_steps)
            for model in group
            if settings.online_effect
        }

        def learn(history: TrackHistory, report: UpdateReport) -> None:
            # Called before the next group.
            for calibration in (*live.values(), *online.values()):  # noqa: B023
                calibration.observe(history, report)

        for window, protocols in _windows(recording, observed, history, settings, tick, learn):
            for (model, protocol), predictor in predictors.items():
                if protocol not in protocols:
                    _skip(predictor, window, settings, protocols)
                    continue
                prediction = predictor.predict(window)
                prediction = live[model, protocol].serve(prediction, window)
                if not len(prediction):
                    continue
                found = result.add(
                    model, protocol, scorer, prediction, window, baselines=model == first
                )
                if protocol == "all" and model in online:
                    served = online[model].serve(prediction, window)
                    result.add_online(model, scorer, served, found)
    result.honesty.finish()


def _observed(recording: Recording, settings: Settings) -> Recording:
    """Return a recording as the models observe it; the recording itself stays the truth."""
    observed = recording
    if settings.tracker_seed is not None:
        observed = draw_tracker(recording, settings.tracker_seed).observe(recording)
    if settings.unknown_classes:
        unknown = np.full_like(observed.agent_class, AgentClass.UNKNOWN)
        observed = dataclasses.replace(observed, agent_class=unknown)
    return observed


def _skip(
    predictor: ScenePredictor,
    window: HistoryWindow,
    settings: Settings,
    protocols: Collection[str],
) -> None:
    """Show a predictor a window at which its protocol is not scored."""
    if settings.path_smoothing_s and "all" in protocols:
        predictor.predict(window)  # the next paths are smoothed with these
    else:
        predictor.observe(window)


def _windows(
    recording: Recording,
    observed: Recording,
    history: HistoryConfig,
    settings: Settings,
    tick: Callable[[], object],
    learn: Callable[[TrackHistory, UpdateReport], object] = lambda history, report: None,
) -> Iterator[tuple[HistoryWindow, set[str]]]:
    """Yield the windows of all scored instants, each with the protocols that it is scored for.

    Between instants that are farther apart than a window is long, there are windows without a
    protocol, so that predictors see all of the recording.

    Args:
        recording: gives the instants.
        observed: gives the observations.
        history: see :func:`~mtpgo_training.scenes.history_replay.replay`.
        settings: the strides.
        tick: called after each observed frame.
        learn: called with the history after each observed frame.
    """
    strides = {"all": settings.stride_s, "centre": CENTRE_EVERY * settings.stride_s}
    frames = {p: set(frames_every(recording, stride).tolist()) for p, stride in strides.items()}
    instants = set.union(*frames.values())
    span_s = history.dt_s * max(1, history.steps - 1)
    if settings.stride_s > span_s:
        instants |= set(frames_every(recording, span_s).tolist())
    ordered = sorted(instants)
    windows = replay(
        observed,
        history,
        map(recording.stamp_ns, ordered),
        one_sample=settings.one_sample,
        on_frame=tick,
        on_update=learn,
    )
    for frame, window in zip(ordered, windows, strict=True):
        yield window, {protocol for protocol, chosen in frames.items() if frame in chosen}


def _same_history(runners: Mapping[str, ModelRunner]) -> list[list[str]]:
    """Return the names of the models in groups that see the same windows."""
    groups: dict[HistoryConfig, list[str]] = {}
    for name, runner in runners.items():
        groups.setdefault(runner.task.history, []).append(name)
    return list(groups.values())


def evaluate_all(
    runners: Mapping[str, ModelRunner],
    recordings: Iterable[tuple[str, Recording]],
    settings: Settings,
    *,
    sites: Mapping[str, str] = MappingProxyType({}),
    draw: Sequence[str] = (),
    progress: Callable[[str, int], Callable[[], object]] = lambda name, frames: lambda: None,
) -> Evaluation:
    """Evaluate models and baselines on recordings, of which only one need be in memory.

    Args:
        runners: models by name.
        recordings: names and recordings, taken one after the other.
        settings: see :class:`Settings`.
        sites: name of a recording -> its site, its location where none is given.
        draw: models whose best and worst scenes are kept for a picture.
        progress: called with each recording's name and number of steps; returns a function that is
            called after each step.
    """
    result = Evaluation(scenes={name: ExtremeScenes() for name in draw})
    histories = max(1, len(_same_history(runners)))
    for name, recording in recordings:
        tick = progress(name, histories * len(recording.frames))
        site = sites.get(name)
        evaluate_recording(result, runners, recording, settings, name=name, site=site, tick=tick)
    return result


def evaluate(
    runners: Mapping[str, ModelRunner],
    recordings: Iterable[Recording],
    *,
    policy: str | None = None,
    stride_s: float = 0.2,
    centre: bool = True,
    min_future_s: float = 0.0,
) -> Averages:
    """Return average scores of models and baselines over recordings.

    Args:
        runners: models by name. The baselines use the history of the first.
        recordings: what they are scored on.
        policy: graph policy of the protocol ``all``, None for the models' own.
        stride_s: time between two scored instants (s); the protocol ``centre`` is scored at every
            fifth.
        centre: score the protocol ``centre`` too.
        min_future_s: agents observed for a shorter time afterwards are left out (s).
    """
    settings = Settings(policy, stride_s, centre, min_future_s)
    return evaluate_all(runners, [(r.name, r) for r in recordings], settings).scores.averages()
