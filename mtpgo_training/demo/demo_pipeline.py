# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs the demo: recording, bag, node, recorded predictions, scores, picture."""

from __future__ import annotations

import dataclasses
import os
import shlex
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError, MtpgoError, RecordingError
from mtpgo_core.history.track_index import sort_keys
from mtpgo_core.resources import find_resource
from mtpgo_core.task.model_file import find_model, load_task
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.atomic_files import write_text
from mtpgo_training.data.bag_conversion import convert
from mtpgo_training.data.data_sources import DataSource, named_recordings
from mtpgo_training.data.recording import Recording
from mtpgo_training.demo import demo_report as report
from mtpgo_training.demo.calibration_effect import calibration_effect
from mtpgo_training.demo.live_comparison import (
    Json,
    compare_live,
    difference_sentences,
    live_comparison_table,
)
from mtpgo_training.demo.node_session import run_session
from mtpgo_training.demo.playback_plan import PlaybackPlan, make_plan
from mtpgo_training.demo.publication_timing import merge_timings, timing
from mtpgo_training.demo.recorded_messages import (
    ReceivedPrediction,
    RecordedMessages,
    read_messages,
)
from mtpgo_training.evaluation.bags.replayed_quality import quality_rows, replayed_quality
from mtpgo_training.evaluation.moments import Moment, choose_moments
from mtpgo_training.evaluation.scorer import add_scores
from mtpgo_training.evaluation.scores.score_table import ScoreTable
from mtpgo_training.processes.child_process import require_ros
from mtpgo_training.reports.honesty.live_scores import calibration_effect_table
from mtpgo_training.table_format import to_text

SHIPPED = ("recordings", "roundabout", "roundabout.mcap")
"""The bag that ships with the package, described in the Markdown file beside it."""

PICTURE = "prediction.png"
"""File of the picture in the output folder."""

PAGE, PAGE_S = "demo.html", 60.0
"""File of the page that shows the predictions over time, and the longest time on it (s); chosen: a
minute has a few MB."""

REPORT = "report"
"""Folder of the report in the output folder."""

_FOLDERS = ("bags", "predictions", "logs")
"""Folders of bags, of the recorded bag and of logs in the output folder."""

_MARK = Path("logs") / "predictor.log"
"""File in the output folder of every demo, by which its results are known as such."""

PANELS = 3
"""Most scenes in the picture."""


@dataclass(frozen=True)
class DemoOptions:
    """Settings of the demo.

    Attributes:
        sources: the recordings to play.
        play_all: also play recordings that the model was trained on.
        model: name or file of the model.
        parameters: further parameters of the node, ``name:=value``.
        output: folder for the results.
        rate_hz: predictions per second (Hz); the default is the node's. A parameter ``rate`` has
            the same value.
    """

    sources: tuple[DataSource, ...]
    play_all: bool = False
    model: str = "default"
    parameters: tuple[str, ...] = ()
    output: Path = Path("demo_output")
    rate_hz: float = 5.0


def run_demo(options: DemoOptions) -> None:
    """Run the demo and print its table.

    Raises:
        MtpgoError: bad input, or one of the processes failed.
    """
    require_ros()
    output = Path(os.path.realpath(options.output))
    _require_replaceable(output, options.sources)
    model = find_model(options.model)
    task = load_task(model)
    plan = make_plan(_read(options.sources), task.training, play_all=options.play_all)
    bags, predictions, logs = _make_folders(output)
    _print_plan(plan, task, model)

    print("  writing the bags", flush=True)
    paths = []
    for recording in plan.recordings:
        paths.append(bags / f"{recording.name}.mcap")
        convert([recording], paths[-1])
    print("  starting predictor and record", flush=True)
    # One road user is enough to show that live and recorded scores are equal.
    own = (f"model:={model}", f"rate:={options.rate_hz}", "quality_min_agents:=1")
    parameters = _last_of_each((*own, *options.parameters))
    durations_s = [recording.duration_s for recording in plan.recordings]
    run_session(paths, durations_s, recorded=predictions, logs=logs, parameters=parameters)

    print("  scoring the recorded predictions", flush=True)
    recorded = read_messages(predictions)
    if not recorded.predictions:
        raise MtpgoError(
            f"the predictor published nothing on {sum(durations_s):.0f} s of traffic, see {logs}"
        )
    page = _write_page(predictions, output / PAGE)
    total, parts = score_recordings(plan, recorded, task, options.rate_hz)
    replayed = replayed_quality(
        predictions, [r.prediction for r in recorded.predictions], task.history
    )
    live = compare_live(recorded.quality, quality_rows(replayed))
    # Only here: the model needs torch, which takes seconds to import.
    from mtpgo_core.prediction.model_runner import ModelRunner

    effect = calibration_effect(ModelRunner.load(model), plan.recordings)
    content = report.summary(total, parts, task, recorded)
    content |= {"live": live, "calibration": effect}
    write_text(output / "summary.json", report.to_json(content))
    played = [
        (recording, [r.prediction for r in part.predictions])
        for recording, part in zip(plan.recordings, parts, strict=True)
    ]
    drawn = _draw(choose_moments(played, PANELS), output / PICTURE)
    reported = _report(content, options.rate_hz, output / REPORT)
    _print_results(content, options, output, f"{drawn}, {reported}")
    if page is not None:
        print(f"To see the predictions over time, open {page.as_uri()} in a browser.")


def _last_of_each(parameters: Sequence[str]) -> list[str]:
    """Return ``name:=value`` with the last value of each name.

    Of several, ROS takes a whole number rather than a later real one.
    """
    last = dict(parameter.split(":=", 1) for parameter in parameters)
    return [f"{name}:={value}" for name, value in last.items()]


def shipped_source() -> DataSource:
    """Return the recording that ships with the package."""
    return DataSource(find_resource(*SHIPPED), "bag")


def _write_page(bag: Path, path: Path) -> Path | None:
    """Write the page of the viewer and say where it is; return None if there is none to write."""
    from mtpgo_training.view.scene_outputs import write_outputs
    from mtpgo_training.view.view_source import ViewOptions, load_scene

    def another(name: str) -> str:
        words = ("mtpgo", "view", str(bag), "--recordings", name, "--html")
        return f"to see another: {shlex.join(words)} FILE"

    try:
        scene = load_scene(DataSource(bag, "bag"), ViewOptions(longest_s=PAGE_S, another=another))
        for sentence in write_outputs(scene, {"html": path}):
            print(f"  {sentence}", flush=True)
    except MtpgoError as error:  # the scores are worth having without it
        print(f"  no page: {error}", flush=True)
        return None
    return path


def _report(content: Json, rate_hz: float, folder: Path) -> str:
    """Write the report; return its name, or in brackets why there is none."""
    try:
        from mtpgo_training.demo.demo_page import write_demo_page
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("matplotlib", "jinja2"):
            raise
        return f"(no report: {error.name} is missing, it comes with the extra 'training')"
    return str(write_demo_page(content, rate_hz, folder).relative_to(folder.parent))


def _draw(moments: Sequence[Moment], path: Path) -> str:
    """Draw the picture; return its name, or in brackets why there is none."""
    if not moments:
        return "(no picture: no moving road user was predicted by the model)"
    try:
        from mtpgo_training.reports.scene_plot import draw_picture
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        return "(no picture: matplotlib is missing, it comes with the extra 'training')"
    print("  drawing", flush=True)
    draw_picture(moments, path)
    return f"and {path.name}"


def _read(sources: Sequence[DataSource]) -> list[Recording]:
    """Return the recordings, under names that differ.

    Raises:
        MtpgoError: they cannot be read.
    """
    return [
        dataclasses.replace(recording, name=name) if recording.name != name else recording
        for name, recording in named_recordings(sources)
    ]


def _require_replaceable(output: Path, sources: Sequence[DataSource]) -> None:
    """Check that nothing but the results of an earlier demo will be deleted.

    Raises:
        ConfigurationError: other files have the names of results, or recordings are among them.
    """
    names = (*_FOLDERS, REPORT, "summary.json", PICTURE, PAGE)
    found = [name for name in names if (output / name).exists()]
    if found and not (output / _MARK).is_file():
        raise ConfigurationError(
            f"the output folder {output} has {found[0]!r}, which is of no earlier demo and would "
            "be replaced, expected another folder"
        )
    replaced = {Path(os.path.realpath(output / name)) for name in found}
    for source in sources:
        place = Path(os.path.realpath(source.directory))
        if replaced & {place, *place.parents}:
            raise ConfigurationError(
                f"{source.directory} is among the results of an earlier demo in the output folder "
                f"{output}, which are replaced, expected another folder"
            )


def _make_folders(output: Path) -> tuple[Path, Path, Path]:
    """Return folders for the bags, the recorded bag and the logs; delete an earlier run's results.

    Raises:
        ConfigurationError: the output folder cannot be written.
    """
    bags, recorded, logs = (output / name for name in _FOLDERS)
    try:
        output.mkdir(parents=True, exist_ok=True)
        for name in ("summary.json", PICTURE, PAGE):
            (output / name).unlink(missing_ok=True)
        for folder in (bags, recorded, output / REPORT, logs):  # the mark is in the last one
            if folder.exists():
                shutil.rmtree(folder)
        logs.mkdir()
        (output / _MARK).touch()
        bags.mkdir()
    except OSError as error:
        raise ConfigurationError(
            f"the output folder {output} cannot be written: {error.strerror}"
        ) from error
    return bags, recorded, logs


def _print_plan(plan: PlaybackPlan, task: TaskDescription, model: Path) -> None:
    number = len(plan.recordings)
    names = ", ".join(recording.name for recording in plan.recordings)
    print(
        f"mtpgo demo: {number} recording{'s' if number > 1 else ''} ({names}), "
        f"{plan.duration_s:.0f} s of traffic, through the model {task.name} ({model.name})"
    )
    if plan.left_out:
        print(
            f"  {len(plan.left_out)} left out, the model was trained or chosen with them (--all "
            f"or ALL=1 plays them too): {', '.join(plan.left_out)}"
        )


def score_recordings(
    plan: PlaybackPlan, recorded: RecordedMessages, task: TaskDescription, rate_hz: float
) -> tuple[report.DemoResult, list[report.DemoResult]]:
    """Score the recorded predictions against the recordings.

    Args:
        plan: the recordings that were played.
        recorded: what ``record`` wrote.
        task: description of the model.
        rate_hz: configured predictions per second (Hz).

    Returns:
        The result of all recordings together, and the result of each.

    Raises:
        RecordingError: a prediction has a stamp that is in no recording.
    """
    by_recording: list[list[ReceivedPrediction]] = [[] for _ in plan.recordings]
    for received in recorded.predictions:
        index = plan.at(received.prediction.stamp_ns)
        if index is None:
            raise RecordingError(
                f"a prediction is stamped {received.prediction.stamp_ns} ns, which no observation "
                "is, expected the stamp of its observation"
            )
        by_recording[index].append(received)
    whole = ScoreTable()
    parts = []
    for recording, predictions in zip(plan.recordings, by_recording, strict=True):
        book = ScoreTable()
        for target in (book, whole):
            add_scores(
                target,
                [received.prediction for received in predictions],
                recording,
                history=task.history,
                name=report.MODEL,
                protocol=report.PROTOCOL,
            )
        observed = {states.stamp_ns: sort_keys(states.key) for states in recording.states()}
        predicted = [
            (
                received.prediction.stamp_ns,
                received.received_ns,
                sort_keys(received.prediction.key),
            )
            for received in predictions
        ]
        own = timing(observed, recorded.observed, predicted, rate_hz)
        parts.append(report.DemoResult(recording.name, predictions, own, book.averages()))
    together = merge_timings([part.timing for part in parts])
    return report.DemoResult("all", recorded.predictions, together, whole.averages()), parts


def _print_results(content: Json, options: DemoOptions, output: Path, drawn: str) -> None:
    print()
    print(report.terminal_table(content))
    print()
    live: list[Json] = content["live"]
    print(to_text(live_comparison_table(live)))
    for sentence in difference_sentences(live):
        print(sentence)
    print()
    effect = calibration_effect_table(content["calibration"])
    if effect is not None:
        print(f"{to_text(effect)}\n")
    for sentence in report.sentences(content, options.rate_hz):
        print(sentence)
    print(f"Written to {output}: summary.json {drawn}, the bags and the logs.")
