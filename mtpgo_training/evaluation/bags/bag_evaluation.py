# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Evaluation of recorded predictions: scored like models, and compared with them per agent."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from msg_adapters.bags.bag_reader import BagReader, bag_name
from msg_adapters.predictions import predictions_in_bag
from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.prediction.output_assembly import delay_ns, from_horizon_start, time_grid
from mtpgo_core.schema import CalibrationStage, Prediction, Source
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.bags.bag_frames import in_frame_of_predictions, observed_frame
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.bags.agreement import Agreement, replay_offline
from mtpgo_training.evaluation.bags.bag_predictions import (
    last_of_each_stamp,
    match,
    without_holes,
)
from mtpgo_training.evaluation.bags.clock_alignment import find_parts
from mtpgo_training.evaluation.bags.replayed_quality import quality_rows, replayed_quality
from mtpgo_training.evaluation.evaluator import Evaluation
from mtpgo_training.evaluation.extreme_scenes import ExtremeScenes
from mtpgo_training.evaluation.scorer import Scorer
from mtpgo_training.parallel.work_item import Failure
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.kinematic_baselines import BASELINES

_ONLINE = (CalibrationStage.ONLINE, CalibrationStage.ONLINE_PATH)

PROTOCOL = "all"
"""Protocol of recorded predictions: a node publishes each road user once."""

FALLBACK_SHARE = 0.1
"""Share of predictions by constant velocity in place of the model above which the scores are said
not to be the model's; chosen: a single late cycle is less."""


@dataclass
class BagResult:
    """The results of an evaluation of bags.

    Attributes:
        evaluation: the scores of bags, models and baselines.
        agreements: by bag and model.
        warnings: one sentence each.
        live: by bag that holds observations, the scores that the node had at its end, see
            :func:`~mtpgo_training.evaluation.bags.replayed_quality.quality_rows`.
        published: by bag, number of predictions of road users by calibration: ``none``,
            ``shipped``, ``online`` or ``online_path``.
        failures: files that could not be read or scored.
    """

    evaluation: Evaluation
    agreements: dict[str, dict[str, Agreement]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    live: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    published: dict[str, dict[str, int]] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)


def observed_recordings(
    bags: Sequence[Path], options: ReadingOptions = AS_USUAL, topic: str | None = None
) -> dict[str, Recording]:
    """Return what the bags themselves observed: the ground truth where no other is given.

    Args:
        bags: the bags.
        options: how their observations are read.
        topic: of the predictions, into whose frame the observations are transformed.

    Raises:
        RecordingError: a bag has no tracked objects.
    """
    found: dict[str, Recording] = {}
    for bag in bags:
        with BagReader(bag):
            pass  # a file that is not a bag has its own error
        try:
            recordings = load_recordings(bag, "bag", None, _of(bag, options, topic))
        except RecordingError as error:
            raise RecordingError(
                f"{error}; the truth for recorded predictions is in the bag itself, or given "
                "with --data"
            ) from error
        for recording in recordings:
            name = recording.name if recording.name not in found else f"{bag}/{recording.name}"
            found[name] = recording
    return found


def evaluate_bags(
    bags: Sequence[Path],
    recordings: Mapping[str, Recording],
    runners: Mapping[str, ModelRunner],
    *,
    sites: Mapping[str, str] = MappingProxyType({}),
    topic: str | None = None,
    min_future_s: float = 0.0,
    own_clock: bool = True,
    options: ReadingOptions = AS_USUAL,
    draw: bool = False,
) -> BagResult:
    """Score recorded predictions, and the models' predictions at the same instants.

    Args:
        bags: recorded predictions.
        recordings: what was played, by name.
        runners: models by name, may be empty. The baselines use the history of the first.
        sites: name of a recording -> its site, its location where none is given.
        topic: of the predictions; by default the one that holds predictions.
        min_future_s: agents observed for a shorter time afterwards are left out (s).
        own_clock: the bags may have another clock than the recordings, found by their own
            observations; false where the recordings come from the bags.
        options: how the bags' observations are read.
        draw: keep the best and worst scenes for a picture.

    Raises:
        RecordingError: see :func:`~msg_adapters.predictions.predictions_in_bag` and :func:`match`;
            or the predictions of a bag have different horizons.
        ConfigurationError: two bags, or a bag and a model, have the same name.
    """
    names = [bag_name(bag) for bag in bags]
    for name in names:
        if names.count(name) > 1 or name in runners or name in BASELINES:
            raise ConfigurationError(
                f"two sets of predictions are called {name}, expected bags, models and baselines "
                "of different names"
            )
    result = BagResult(Evaluation(scenes={name: ExtremeScenes() for name in names if draw}))
    done: set[str] = set()
    for bag, bag_called in zip(bags, names, strict=True):
        received, holes = without_holes(list(predictions_in_bag(bag, topic)))
        if holes:
            sentence = (
                f"points are missing of {holes} predictions of road users in {bag}, as in a cloud"
                " that was filtered"
            )
            if not any(map(len, received)):
                raise RecordingError(f"{sentence}, expected every mode and step")
            result.warnings.append(f"{sentence}; they are left out")
        predictions = last_of_each_stamp(received)
        if len(predictions) < len(received):
            result.warnings.append(
                f"{len(received) - len(predictions)} of the {len(received)} predictions in {bag} "
                "have the stamp of a later one, as of two predictors on one topic or of a bag "
                "played twice; the last one of each stamp is scored"
            )
        _require_one_horizon(bag, predictions)
        result.published[bag_called] = _by_calibration(predictions)
        result.warnings += _fallback_warning(bag, predictions)
        reading = _of(bag, options, topic)
        with contextlib.suppress(RecordingError):  # it may hold predictions only
            result.warnings += _frame_warning(bag, predictions, reading)
            live = replayed_quality(bag, received, _history(runners), reading)
            if live.predictions.any():
                result.live[bag_called] = quality_rows(live)
        parts = find_parts(_observed(bag, reading), recordings) if own_clock else []
        if parts and not any(part.name for part in parts):
            result.warnings.append(
                f"what {bag} observed is in none of the recordings, so its predictions are "
                "matched by their stamps and identities as they are"
            )
        matched = match(bag, predictions, recordings, parts)
        if matched.unmatched:
            result.warnings.append(
                f"{matched.unmatched} of the {len(predictions)} predictions in {bag} are of no "
                "road user of the recordings and are left out"
            )
        for name, own in matched.by_recording.items():
            part = _RecordingEvaluation(
                name, recordings[name], min_future_s, runners, sites.get(name)
            )
            for once in _by_pass(own):
                part.score_bag(result, bag_called, once, baselines=name not in done)
                part.score_models(result, bag_called, once, first=name not in done)
                result.evaluation.honesty.finish()
                done.add(name)
    return result


def _by_pass(predictions: Sequence[Prediction]) -> list[list[Prediction]]:
    """Return predictions of a recording by the times that it was played, each ascending in time.

    What was observed in one of them is the future of the next one.
    """
    passes: list[list[Prediction]] = []
    for prediction in predictions:
        if not passes or prediction.stamp_ns <= passes[-1][-1].stamp_ns:
            passes.append([])
        passes[-1].append(prediction)
    return passes


def _require_one_horizon(bag: Path, predictions: Sequence[Prediction]) -> None:
    """Check that the predictions of a bag may be of one model.

    Raises:
        RecordingError: they have different horizons.
    """
    found = dict.fromkeys(
        f"{steps} steps of {time_grid(one.time_s)[1]:.4g} s" if steps > 1 else "1 step"
        for one in predictions
        if len(one) and (steps := len(one.time_s))
    )
    if len(found) > 1:
        raise RecordingError(
            f"the predictions in {bag} have different horizons ({', '.join(found)}), expected "
            "those of one model"
        )


def _by_calibration(predictions: Sequence[Prediction]) -> dict[str, int]:
    """Return the number of predictions of road users by their calibration."""
    stages = Counter(stage for one in predictions for stage in one.calibration.tolist())
    return {stage.name.lower(): stages[stage] for stage in CalibrationStage if stages[stage]}


def _fallback_warning(bag: Path, predictions: Sequence[Prediction]) -> list[str]:
    """Return a sentence where many predictions are constant velocity in place of the model."""
    total = sum(map(len, predictions))
    fallback = sum(int((one.source == Source.CONSTANT_VELOCITY).sum()) for one in predictions)
    if fallback <= FALLBACK_SHARE * total:
        return []
    return [
        f"{fallback} of the {total} predictions of road users in {bag} are constant velocity in"
        " place of the model, as on a busy or slow machine, so the scores say little about the"
        " model"
    ]


def _frame_warning(
    bag: Path, predictions: Sequence[Prediction], options: ReadingOptions
) -> list[str]:
    """Return a sentence where predictions are not in the frame of the objects, as it is known."""
    frame = observed_frame(bag, options)
    others = sorted({one.frame_id for one in predictions if len(one)} - {frame})
    if not frame or not others:
        return []
    return [
        f"the predictions in {bag} are in the frame {', '.join(map(repr, others))}, the objects in"
        f" {frame!r}, and no transform is known between them; they are scored as if these were the"
        " same"
    ]


def _of(bag: Path, options: ReadingOptions, predictions_topic: str | None) -> ReadingOptions:
    """Return the options of one bag of several, with the frame of its predictions."""
    topic = options.bags.topic_of(bag_name(bag))
    own = replace(options, bags=replace(options.bags, topic=topic, topics={}))
    return in_frame_of_predictions(bag, own, predictions_topic)


def _history(runners: Mapping[str, ModelRunner]) -> HistoryConfig:
    """Return the history of the first model, or the default."""
    return next((runner.task.history for runner in runners.values()), HistoryConfig())


def _observed(bag: Path, options: ReadingOptions) -> list[Recording]:
    """Return the recordings of a bag's observations; empty if it has only predictions."""
    try:
        return load_recordings(bag, "bag", None, options)
    except RecordingError:
        return []


@dataclass(frozen=True)
class _RecordingEvaluation:
    """The evaluation of predictions and models on one recording."""

    name: str
    recording: Recording
    min_future_s: float
    runners: Mapping[str, ModelRunner]
    site: str | None = None

    def _scorer(self, history: HistoryConfig) -> Scorer:
        return Scorer(
            self.recording,
            max_gap_s=history.max_gap_s,
            min_future_s=self.min_future_s,
            name=self.name,
            site=self.site,
        )

    def score_bag(
        self, result: BagResult, bag: str, predictions: Sequence[Prediction], *, baselines: bool
    ) -> None:
        """Score the bag's own predictions; the baselines only once for a recording."""
        evaluation = result.evaluation
        evaluation.recordings[self.name] = self.recording.sha256
        history = _history(self.runners)
        scorer = self._scorer(history)
        stamps = [p.stamp_ns for p in predictions]
        ahead_ns = map(delay_ns, predictions)
        windows = replay(self.recording, history, stamps, ahead_ns=ahead_ns)
        for prediction, window in zip(predictions, windows, strict=True):
            evaluation.add(bag, PROTOCOL, scorer, prediction, window, baselines=baselines)

    def score_models(
        self, result: BagResult, bag: str, predictions: Sequence[Prediction], *, first: bool
    ) -> None:
        """Compare the models with the bag at its instants; score them once for a recording."""
        if first:
            result.evaluation.note_missing_lanes(self.runners, self.recording, self.name)
        stamps = [p.stamp_ns for p in predictions]
        published = result.published[bag]
        with_online = first and any(stage.name.lower() in published for stage in _ONLINE)
        for model, runner in self.runners.items():
            agreement = result.agreements.setdefault(bag, {}).setdefault(model, Agreement())
            scorer = self._scorer(runner.task.history)
            ahead_ns = map(delay_ns, predictions)
            own_all = replay_offline(runner, self.recording, stamps, ahead_ns)
            for recorded, (own, online) in zip(predictions, own_all, strict=True):
                moved = (recorded.calibration == CalibrationStage.ONLINE_PATH).any()
                same = online if moved else own
                agreement.add(from_horizon_start(recorded), same, self.recording, self.name)
                if not (first and len(own)):
                    continue
                found = result.evaluation.add(model, PROTOCOL, scorer, own)
                if with_online:
                    result.evaluation.add_online(model, scorer, online, found)
