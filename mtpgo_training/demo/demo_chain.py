# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The demo from end to end: recording, bag, node, recorded predictions, scores, picture."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError, MtpgoError, RecordingError
from mtpgo_core.resources import find_resource
from mtpgo_core.task.model_file import find_model, load_task
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.atomic_files import write_text
from mtpgo_training.data.bag_conversion import convert
from mtpgo_training.data.readers import LAYOUTS, load_recordings
from mtpgo_training.data.recording import Recording
from mtpgo_training.demo import demo_report as report
from mtpgo_training.demo.capture import Capture, Received, read_capture
from mtpgo_training.demo.demo_plan import DemoPlan, make_plan
from mtpgo_training.demo.publication_timing import joined, timing
from mtpgo_training.demo.recording_session import check_ros, run_session
from mtpgo_training.evaluation.moments import choose_moments
from mtpgo_training.evaluation.scorebook import ScoreBook
from mtpgo_training.evaluation.scorer import add_scores
from mtpgo_training.reports.scene_plot import draw_picture

SHIPPED, SHIPPED_LAYOUT = "highway", "highd"
"""Folder and layout of the recording that ships with the package."""

PANELS = 3


@dataclass(frozen=True)
class Options:
    """What to play, through what, and where the results go.

    Attributes:
        data: folder of recordings; None for the shipped one.
        layout: their layout; None only with ``data`` None.
        recordings: names of those to play; None for all.
        play_all: also those that the model was trained on.
        model: name or file of the model.
        parameters: further parameters of the node, ``name:=value``.
        output: folder of the results.
        rate_hz: predictions per second (Hz).
    """

    data: Path | None = None
    layout: str | None = None
    recordings: Sequence[str] | None = None
    play_all: bool = False
    model: str = "default"
    parameters: tuple[str, ...] = ()
    output: Path = Path("demo_output")
    rate_hz: float = 5.0


def run_demo(options: Options) -> None:
    """Run the demo and print its table.

    Raises:
        MtpgoError: bad input, or one of the processes failed.
    """
    check_ros()
    model = find_model(options.model)
    task = load_task(model)
    plan = make_plan(_read(options), task.training, play_all=options.play_all)
    output = options.output.resolve()
    bags, recorded, logs = _clear(output)
    _introduce(plan, task, model)

    print("  writing the bags", flush=True)
    paths = []
    for recording in plan.recordings:
        paths.append(bags / f"{recording.name}.mcap")
        convert([recording], paths[-1])
    print("  starting predictor and record", flush=True)
    parameters = (f"model:={model}", f"rate:={options.rate_hz}", *options.parameters)
    durations_s = [recording.duration_s for recording in plan.recordings]
    run_session(paths, durations_s, recorded=recorded, logs=logs, parameters=parameters)

    print("  scoring the recorded predictions", flush=True)
    capture = read_capture(recorded)
    if not capture.predictions:
        raise MtpgoError(
            f"the predictor published nothing on {sum(durations_s):.0f} s of traffic, see {logs}"
        )
    total, parts = _results(plan, capture, task, options.rate_hz)
    content = report.summary(total, parts, task, capture)
    write_text(output / "summary.json", report.to_json(content))
    print("  drawing", flush=True)
    played = [
        (recording, [r.prediction for r in part.predictions])
        for recording, part in zip(plan.recordings, parts, strict=True)
    ]
    moments = choose_moments(played, PANELS)
    if moments:
        draw_picture(moments, output / "prediction.png")
    _conclude(content, options, output, bool(moments))


def _read(options: Options) -> list[Recording]:
    """The recordings asked for.

    Raises:
        MtpgoError: they cannot be had.
    """
    if options.data is None:
        folder, layout = find_resource("recordings", SHIPPED), options.layout or SHIPPED_LAYOUT
    elif options.layout is None:
        raise ConfigurationError(
            f"the layout of {options.data} is not given, expected --layout with one of "
            f"{', '.join(LAYOUTS)}"
        )
    else:
        folder, layout = options.data, options.layout
    return load_recordings(folder, layout, options.recordings)


def _clear(output: Path) -> tuple[Path, Path, Path]:
    """Folders for the bags, the recorded bag and the logs, without what an earlier run left.

    Raises:
        ConfigurationError: the output folder cannot be written.
    """
    bags, recorded, logs = output / "bags", output / "predictions", output / "logs"
    try:
        output.mkdir(parents=True, exist_ok=True)
        for folder in (bags, recorded, logs):
            if folder.exists():
                shutil.rmtree(folder)
        for name in ("summary.json", "prediction.png"):
            (output / name).unlink(missing_ok=True)
        bags.mkdir()
        logs.mkdir()
    except OSError as error:
        raise ConfigurationError(
            f"the output folder {output} cannot be written: {error.strerror}"
        ) from error
    return bags, recorded, logs


def _introduce(plan: DemoPlan, task: TaskDescription, model: Path) -> None:
    number = len(plan.recordings)
    names = ", ".join(recording.name for recording in plan.recordings)
    print(
        f"mtpgo demo: {number} recording{'s' if number > 1 else ''} ({names}), "
        f"{plan.duration_s:.0f} s of traffic, through the model {task.name} ({model.name})"
    )
    if plan.left_out:
        print(
            f"  {len(plan.left_out)} left out, the model was trained on them (--all or ALL=1 "
            f"plays them too): {', '.join(plan.left_out)}"
        )


def _results(
    plan: DemoPlan, capture: Capture, task: TaskDescription, rate_hz: float
) -> tuple[report.Result, list[report.Result]]:
    """The result of all recordings together, and that of each."""
    by_recording: list[list[Received]] = [[] for _ in plan.recordings]
    for received in capture.predictions:
        index = plan.at(received.prediction.stamp_ns)
        if index is None:
            raise RecordingError(
                f"a prediction is stamped {received.prediction.stamp_ns} ns, which no observation "
                "is, expected the observation's own stamp"
            )
        by_recording[index].append(received)
    whole = ScoreBook()
    parts = []
    for recording, predictions in zip(plan.recordings, by_recording, strict=True):
        book = ScoreBook()
        for target in (book, whole):
            add_scores(
                target,
                [received.prediction for received in predictions],
                recording,
                history=task.history,
                name=report.MODEL,
                protocol=report.PROTOCOL,
            )
        punctuality = timing(_observed(recording), capture.observed, _keys(predictions), rate_hz)
        parts.append(report.Result(recording.name, predictions, punctuality, book.table()))
    together = joined([part.timing for part in parts])
    return report.Result("all", capture.predictions, together, whole.table()), parts


def _observed(recording: Recording) -> dict[int, set[bytes]]:
    return {s.stamp_ns: {key.tobytes() for key in s.key} for s in recording.states()}


def _keys(predictions: Sequence[Received]) -> list[tuple[int, int, set[bytes]]]:
    return [
        (r.prediction.stamp_ns, r.received_ns, {key.tobytes() for key in r.prediction.key})
        for r in predictions
    ]


def _conclude(content: dict[str, object], options: Options, output: Path, drawn: bool) -> None:
    print()
    print(report.table(content))
    print()
    for sentence in report.sentences(content, options.rate_hz):
        print(sentence)
    files = (
        "summary.json and prediction.png" if drawn else "summary.json (no picture: nobody moves)"
    )
    print(f"Written to {output}: {files}, the bags and the logs.")
