# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reads what is viewed: observations, and predictions that are recorded or a model's."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from msg_adapters.bags.bag_reader import DecodingBagReader, bag_name, is_bag
from msg_adapters.conversions import reading
from msg_adapters.predictions import NoPredictionsError
from mtpgo_core.errors import (
    ConfigurationError,
    MessageError,
    RecordingError,
    found_names,
)
from mtpgo_core.prediction.model_runner import ModelRunner, find_model
from mtpgo_core.schema import Prediction
from mtpgo_training.data.data_sources import DataSource
from mtpgo_training.data.readers import reading_jobs
from mtpgo_training.data.readers.bags.bag_frames import in_frame_of_predictions, observed_frame
from mtpgo_training.data.recording import Recording, require_span
from mtpgo_training.evaluation.bags.bag_predictions import match, read_predictions
from mtpgo_training.evaluation.offline_predictor import predict_as_the_node
from mtpgo_training.scenes.windows import frames_every
from mtpgo_training.view.view_scene import ViewScene, view_scene

DEFAULT_MODEL = "default"
"""Predicts where a bag or recording has no predictions."""

_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_LOOKED_AT = 20
"""Messages read to find a model's name; chosen: the first ones may be empty."""

_log = logging.getLogger("mtpgo")


def _by_option(name: str) -> str:
    return "--recordings chooses"


@dataclass(frozen=True)
class ViewOptions:
    """What of a source is viewed.

    Attributes:
        model: name or file of the model that predicts; None takes the predictions in the bag, and
            the shipped model where it has none.
        predictions_topic: topic of the predictions, None for the one that holds some.
        start_s: begin, from the first frame (s), None for the first frame.
        end_s: end, from the first frame (s), None for the last frame, or ``longest_s``.
        longest_s: longest time that is viewed if no end is given (s), None for any.
        another: returns how the user gets to see the recording of a name instead, as the end of
            a sentence.
    """

    model: str | None = None
    predictions_topic: str | None = None
    start_s: float | None = None
    end_s: float | None = None
    longest_s: float | None = None
    another: Callable[[str], str] = _by_option

    def __post_init__(self) -> None:
        require_span(self.start_s, self.end_s)
        if self.model is not None and self.predictions_topic is not None:
            raise ConfigurationError(
                "--model is given with --predictions, expected one: a model predicts anew"
            )


def load_scene(source: DataSource, options: ViewOptions) -> ViewScene:
    """Return what is to be viewed of a bag, or of the first recording of a directory.

    Args:
        source: where it is.
        options: what of it.

    Raises:
        RecordingError: it cannot be read, or nothing of it lies in the time asked for.
        ConfigurationError: the model cannot be used.
    """
    runner = ModelRunner.load(find_model(options.model)) if options.model is not None else None
    if runner is None and source.layout == "bag":
        topic = options.predictions_topic
        own = in_frame_of_predictions(source.directory, source.options, topic)
        source = source._replace(options=own)
    recording = _one_recording(source, options)
    start_s, end_s = _span(recording, options)
    bag = _bag_of(source, recording.name)
    predictions: list[Prediction] = []
    model = ""
    frame_id = observed_frame(bag, source.options) if bag is not None else ""
    if runner is None and bag is not None:
        predictions = _recorded(bag, recording, options, start_s, end_s)
        _warn_of_other_frames(predictions, frame_id)
        model = recorded_model(bag) if predictions else ""
    if runner is None and not predictions:
        _log.warning(
            "mtpgo: %s has no predictions of %s: the model %s predicts; --model chooses another",
            source.directory,
            recording.name,
            DEFAULT_MODEL,
        )
        runner = ModelRunner.load(find_model(DEFAULT_MODEL))
    if runner is not None:
        predictions, model = _predicted(runner, recording, start_s, end_s), runner.task.name
    return view_scene(
        recording,
        predictions,
        name=recording.name,
        model=model,
        frame_id=frame_id,
        start_s=start_s,
        end_s=end_s,
    )


def _warn_of_other_frames(predictions: list[Prediction], frame_id: str) -> None:
    """Say that predictions are not in the frame of the objects; empty if that is not known."""
    others = sorted({one.frame_id for one in predictions} - {frame_id})
    if frame_id and others:
        _log.warning(
            "mtpgo: the predictions are in the frame %s and the objects in %r; both are drawn, and"
            " errors computed, as if these were the same",
            ", ".join(map(repr, others)),
            frame_id,
        )


def _one_recording(source: DataSource, options: ViewOptions) -> Recording:
    """Return the first recording of a source that has a road user, and say which others it has."""
    jobs = reading_jobs(*source)
    names = [name for job in jobs for name in job.names]
    for number, job in enumerate(jobs):
        found = [recording for recording in job.read() if len(recording)]
        if not found:
            continue
        others = [r.name for r in found[1:]] + [n for j in jobs[number + 1 :] for n in j.names]
        if others:
            _log.warning(
                "mtpgo: %s of %s is shown, and not %s; %s",
                found[0].name,
                source.directory,
                found_names(others, 8),
                options.another(others[0]),
            )
        return found[0]
    raise RecordingError(f"{source.directory}: no road user is in {', '.join(names)}")


def _span(recording: Recording, options: ViewOptions) -> tuple[float, float]:
    """Return begin and end of what is viewed, from the first frame (s)."""
    start_s, whole_s = options.start_s or 0.0, recording.duration_s
    if start_s > whole_s or not len(recording.between(start_s, options.end_s)):
        raise RecordingError(
            f"{recording.name} has no road user from {start_s:g} s on"
            + (f" to {options.end_s:g} s" if options.end_s is not None else "")
            + f", it lasts {whole_s:.1f} s"
        )
    if options.end_s is not None:
        return start_s, min(options.end_s, whole_s)
    end_s = whole_s
    if options.longest_s is not None and whole_s - start_s > options.longest_s:
        end_s = start_s + options.longest_s
        _log.warning(
            "mtpgo: %g to %g s of the %.1f s of %s are shown; --start and --end choose",
            start_s,
            end_s,
            whole_s,
            recording.name,
        )
    return start_s, end_s


def _bag_of(source: DataSource, recording: str) -> Path | None:
    """Return the bag that a recording was read from, None if it was not a bag."""
    if source.layout != "bag":
        return None
    if source.directory.is_file() or is_bag(source.directory):
        return source.directory
    bags = [path for path in sorted(source.directory.iterdir()) if is_bag(path)]
    named = [path for path in bags if recording == bag_name(path)]
    parts = [path for path in bags if recording.startswith(f"{bag_name(path)}-")]
    return next(iter([*named, *parts]), None)


def _recorded(
    bag: Path, recording: Recording, options: ViewOptions, start_s: float, end_s: float
) -> list[Prediction]:
    """Return the predictions that the bag has of a recording; empty if there are none."""
    first_ns = recording.span_ns[0]
    span_ns = (first_ns + round(1e9 * start_s), first_ns + round(1e9 * end_s))
    try:
        found = read_predictions(bag, options.predictions_topic, span_ns=span_ns)
    except NoPredictionsError:
        if options.predictions_topic is not None:
            raise
        return []
    if not any(len(prediction) for prediction in found):
        return []
    return match(bag, found, {recording.name: recording}).by_recording[recording.name]


def _predicted(
    runner: ModelRunner, recording: Recording, start_s: float, end_s: float
) -> list[Prediction]:
    """Return what the node would predict, which observed the recording from its beginning."""
    stamps = [
        recording.stamp_ns(frame)
        for frame in frames_every(
            recording.between(None, end_s), runner.task.history.dt_s
        ).tolist()
    ]
    begin_ns = recording.span_ns[0] + round(1e9 * start_s)
    made = predict_as_the_node(runner, recording, stamps)
    return [p for p in made if p.stamp_ns >= begin_ns]


def recorded_model(bag: Path) -> str:
    """Return the name of the model that the node of a recorded bag reported, empty if none did."""
    with DecodingBagReader(bag) as reader:
        diagnostics = [c for c in reader.connections if c.msgtype == _DIAGNOSTICS]
        for _, _, message in itertools.islice(reader.messages(diagnostics), _LOOKED_AT):
            with suppress(MessageError), reading(message, _DIAGNOSTICS):
                for status in message.status:
                    values = {value.key: value.value for value in status.values}
                    if status.name.endswith(": model") and values.get("model"):
                        return str(values["model"])
    return ""
