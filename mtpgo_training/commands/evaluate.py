# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo evaluate``: scores of models or recorded predictions on recordings."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from mtpgo_core.completion import completed_by
from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.live_calibration.live_options import (
    BEST,
    CALIBRATIONS,
    ONLINE,
    PREFERENCES,
    SHIPPED,
)
from mtpgo_core.live_calibration.live_options import MODEL as PREFER_MODEL
from mtpgo_core.prediction.paths.path_smoothing import LONGEST_CYCLE_S, LONGEST_MEMORY_S
from mtpgo_core.task.model_file import shipped_models
from mtpgo_core.task.task_description import GRAPH_POLICIES
from mtpgo_training.atomic_files import require_writable, write_text
from mtpgo_training.commands.arguments.argument_types import require_none
from mtpgo_training.commands.arguments.data_arguments import (
    add_cache_arguments,
    add_data_arguments,
    bag_options,
    cache_from,
    data_sources,
)
from mtpgo_training.commands.arguments.early_checks import (
    files_of_bag,
    files_of_recordings,
    require_apart,
    require_bags,
    require_models,
    require_modules,
    require_sources,
)
from mtpgo_training.commands.arguments.pool_arguments import (
    add_pool_arguments,
    failures_text,
    pool_from,
)
from mtpgo_training.data.data_sources import SourceJob, named_recordings, site_of
from mtpgo_training.data.readers.reading_options import AS_USUAL
from mtpgo_training.parallel.fork_server import start_fork_server
from mtpgo_training.scenes.tracker.tracker_config import OBSERVATIONS, RECORDED, SIMULATED

if TYPE_CHECKING:
    from mtpgo_core.prediction.model_runner import ModelRunner
    from mtpgo_training.evaluation.bags.bag_evaluation import BagResult
    from mtpgo_training.evaluation.evaluator import Settings
    from mtpgo_training.parallel.pool_options import PoolOptions


STRIDE_S = 0.2
"""Time between two scored instants by default (s)."""

OF_A_RUN: dict[str, object] = {
    "policy": None,
    "stride": None,
    "one_sample": False,
    "without_trails": False,
    "without_lanes": False,
    "tracker": RECORDED,
    "tracker_seed": None,
    "unknown_classes": False,
    "calibration": None,
    "prefer": None,
    "no_correct_paths": False,
    "kde_samples": 0,
    "path_smoothing": 0.0,
    "no_centre": False,
    "min_future": 0.0,
    "seeds": False,
    "jobs": 1,
    "cluster": "",
    "resume": None,
}
"""Options that say how models are run and scored, with their defaults."""

WITHOUT_EFFECT = (
    (("policy",), "whose graphs were chosen by the node"),
    (("stride", "no_centre"), "all of which are scored as the node published them"),
    (("without_trails",), "which were made with the trails that the node knew"),
    (("without_lanes",), "which were made with the lanes that the node knew"),
    (("one_sample",), "which have a past"),
    (("unknown_classes",), "whose classes were those that the node received"),
    (("calibration", "prefer", "no_correct_paths"), "which were calibrated by the node"),
    (("path_smoothing",), "which are scored as the node published them"),
)
"""Options without effect on recorded predictions, and the reasons."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo evaluate`` to the command line."""
    parser = subparsers.add_parser(
        "evaluate",
        help="score models or recorded predictions on recordings",
        description="Score models, or predictions that were recorded into bags, on recordings. "
        "docs/evaluation.md explains the values.",
    )
    add = parser.add_argument
    completed_by(
        add(
            "--model",
            action="extend",
            nargs="+",
            default=[],
            metavar="FILE",
            help="model files or names of shipped models",
        ),
        shipped_models,
    )
    add_data_arguments(
        parser,
        topic_help="topic of the tracked objects in the bags of this directory; with "
        "--predictions, topic of the recorded predictions, found automatically by default",
    )
    add_cache_arguments(parser)
    add(
        "--predictions",
        action="extend",
        nargs="+",
        type=Path,
        default=[],
        metavar="BAG",
        help="bags of recorded predictions; without --data, what they observed is the truth",
    )
    add("--policy", choices=GRAPH_POLICIES, help="graph policy, the model's own by default")
    add(
        "--stride",
        type=float,
        metavar="S",
        help="time between two instants, in whole frames of the recordings (s; default 0.2)",
    )
    add("--min-future", type=float, default=0.0, help="leave out agents observed for less (s)")
    add(
        "--one-sample",
        action="store_true",
        help="forget the past before each instant, as if all agents were new",
    )
    add(
        "--without-trails",
        action="store_true",
        help="hide from models with scene.trails where earlier road users went",
    )
    add(
        "--without-lanes",
        action="store_true",
        help="hide from models with scene.lane_ways the lanes of the recordings",
    )
    add(
        "--tracker",
        choices=OBSERVATIONS,
        default=RECORDED,
        help="observe the recordings as they are, or as a simulated tracker reports them, with "
        "noise, lag and gaps; the truth is the recording (recorded)",
    )
    add(
        "--tracker-seed",
        type=int,
        metavar="N",
        help="seed of the simulated tracker, of which each recording gets another (0)",
    )
    add(
        "--unknown-classes",
        action="store_true",
        help="observe every road user as one of an unknown class; the scores are by its own",
    )
    add(
        "--calibration",
        choices=CALIBRATIONS,
        help="what is applied to the models' output: nothing (off), the calibration in their "
        "files, or that one corrected while the recording goes on, as the node does (shipped)",
    )
    add(
        "--prefer",
        choices=PREFERENCES,
        help="best: constant velocity predicts groups of road users in which it has been better, "
        "as the node does (model)",
    )
    add(
        "--no-correct-paths",
        action="store_true",
        help="the online calibration corrects covariances alone, as the node does with "
        "correct_paths:=false",
    )
    add(
        "--kde-samples",
        type=int,
        default=0,
        metavar="N",
        help="also the likelihood by a kernel density estimate from N samples of each prediction, "
        "as Trajectron++ is scored (0: not; published: 2000)",
    )
    add(
        "--path-smoothing",
        type=float,
        default=0.0,
        metavar="S",
        help="memory of the farthest predicted points of moving vehicles, as the node's "
        "path_smoothing (s; 0 for none)",
    )
    add("--no-centre", action="store_true", help="score only all agents")
    add(
        "--seeds",
        action="store_true",
        help="the models differ only in their seed: intervals over them (automatic for names "
        "that end in -seed1, -seed2)",
    )
    add("--json", type=Path, metavar="FILE", help="also write all results to this file")
    add("--report", type=Path, metavar="DIR", help="write a page with figures to this folder")
    add("--markdown", action="store_true", help="print the table of a model card")
    add(
        "--results",
        action="extend",
        nargs="+",
        type=Path,
        metavar="JSON",
        help="do not evaluate: print the table of a model card from earlier --json files",
    )
    add_pool_arguments(parser)
    add("--quiet", action="store_true", help="no progress bar")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo evaluate``."""
    if args.results:
        _print_results(args)
        return 0
    topic = _predictions_topic(args)
    _check(args)
    pool = pool_from(args)
    jobs: list[SourceJob] = []
    if _with_data(args) or not args.predictions:
        jobs = require_sources(data_sources(args.data_options))
    require_bags(args.predictions)
    models = require_models(args.model)
    bags = [file for bag in args.predictions for file in files_of_bag(bag)]
    require_apart([("--json", args.json)], [*models, *bags, *files_of_recordings(jobs)])
    if args.report is not None:
        require_modules("matplotlib", "jinja2")
        # Only here: pictures need matplotlib and jinja2, and the folder must be writable.
        from mtpgo_training.reports.page import prepare_folder, write_report

        prepare_folder(args.report)
    if args.json is not None:
        require_writable(args.json)
    start_fork_server(pool, "mtpgo_training.evaluation.parallel_evaluation")
    # Imported here: torch takes seconds to load, and the parser does not need it.
    from mtpgo_training.evaluation.evaluator import load_models
    from mtpgo_training.evaluation.summary import summarise

    runners = load_models(args.model)
    if args.without_trails:
        _require_scene_option(runners, "--without-trails", "trails", "see trails")
    if args.without_lanes:
        _require_scene_option(runners, "--without-lanes", "lane_ways", "follow lanes")
    settings = _settings(args)
    if args.predictions:
        result = _from_bags(args, runners, topic)
    else:
        result = _from_models(args, runners, jobs, settings, pool)
    if not result.evaluation.scores:
        raise RecordingError(
            "nothing could be scored: no agent of the recordings is predicted and observed "
            "afterwards"
        )
    content = summarise(
        result,
        runners,
        settings,
        layouts=[str(value) for key, value in args.data_options if key == "layout"],
        from_bags=bool(args.predictions),
        same_recipe=args.seeds,
    )
    for sentence in content["warnings"]:
        print(f"mtpgo: warning: {sentence}", file=sys.stderr)
    if args.json is not None:
        write_text(args.json, json.dumps(content, indent=2, allow_nan=False) + "\n")
    if args.markdown:
        from mtpgo_training.reports.markdown import markdown_table

        print(markdown_table([("", content)]))
    else:
        if not settings.trails:
            print("without trails: no earlier road user is known\n")
        if not settings.lanes:
            print("without lanes: models with scene.lane_ways see none\n")
        if settings.tracker_seed is not None:
            print(f"observed by a simulated tracker, seed {settings.tracker_seed}\n")
        if settings.unknown_classes:
            print("every road user observed as one of an unknown class\n")
        if settings.path_smoothing_s:
            print(f"paths smoothed with a memory of {settings.path_smoothing_s:g} s\n")
        if settings.live.watches or settings.calibration != SHIPPED:
            print(f"calibration {settings.calibration}, prefer {settings.prefer}\n")
        if not settings.correct_paths:
            print("the online calibration corrects covariances alone\n")
        from mtpgo_training.reports.terminal import print_result

        print_result(content, result)
    if args.report is not None:
        page = write_report(args.report, content, result.evaluation.scenes)
        print(f"Report written to {page}.")
    if result.failures:
        print(f"mtpgo: {failures_text(result.failures, len(jobs))}", file=sys.stderr)
        return 1
    return 0


def _require_scene_option(
    runners: Mapping[str, ModelRunner], option: str, key: str, what_it_does: str
) -> None:
    """Check that a model has what an option hides from it.

    Args:
        runners: the models by name.
        option: that was given.
        key: of the scene's configuration, which is true for such a model.
        what_it_does: such a model, in words.

    Raises:
        ConfigurationError: no model has it.
    """
    if not any(getattr(runner.task.scene, key) for runner in runners.values()):
        raise ConfigurationError(
            f"{option} is given with {', '.join(runners)}, which do not {what_it_does}, "
            f"expected a model with scene.{key}"
        )


def _print_results(args: argparse.Namespace) -> None:
    """Print the table of earlier evaluations (``--results``).

    Raises:
        ConfigurationError: options of an evaluation are given as well, or a file is not one.
    """
    if args.model or args.predictions or args.data_options or args.json or args.report:
        raise ConfigurationError(
            "--results is given with --model, --data, --predictions, --json or --report"
        )
    require_none(_given(args, OF_A_RUN), "--results", "which are of earlier evaluations")
    from mtpgo_training.reports.markdown import markdown_table, read_results

    print(markdown_table([(path.stem, read_results(path)) for path in args.results]))


def _settings(args: argparse.Namespace) -> Settings:
    """Return what is scored, and how, as the options say."""
    from mtpgo_training.evaluation.evaluator import Settings

    return Settings(
        policy=args.policy,
        stride_s=STRIDE_S if args.stride is None else args.stride,
        centre=not args.no_centre,
        min_future_s=args.min_future,
        one_sample=args.one_sample,
        trails=not args.without_trails,
        lanes=not args.without_lanes,
        tracker_seed=(args.tracker_seed or 0) if args.tracker == SIMULATED else None,
        calibration=args.calibration or SHIPPED,
        prefer=args.prefer or PREFER_MODEL,
        correct_paths=not args.no_correct_paths,
        kde_samples=args.kde_samples,
        path_smoothing_s=args.path_smoothing,
        unknown_classes=args.unknown_classes,
        online_effect=not (args.calibration or args.prefer or args.one_sample),
    )


def _from_models(
    args: argparse.Namespace,
    runners: dict[str, ModelRunner],
    jobs: list[SourceJob],
    settings: Settings,
    pool: PoolOptions,
) -> BagResult:
    """Run the models on the recordings and score their predictions.

    Raises:
        RecordingError: none of the recordings can be read.
    """
    from mtpgo_training.evaluation.bags.bag_evaluation import BagResult
    from mtpgo_training.evaluation.parallel_evaluation import evaluate_sources
    from mtpgo_training.scenes.taken_strides import rounding_sentences

    evaluation, failures = evaluate_sources(
        runners,
        jobs,
        settings,
        pool=pool,
        cache=cache_from(args),
        resume=args.resume,
        draw=list(runners) if args.report is not None else [],
        progress=not args.quiet and sys.stderr.isatty(),
    )
    if len(failures) == len(jobs):
        raise RecordingError(failures[0].reason)
    warnings = []
    if args.stride is not None:
        warnings = rounding_sentences(
            "--stride", args.stride, evaluation.rounded, "instants are scored"
        )
    return BagResult(evaluation, warnings=warnings, failures=failures)


def _check_path_smoothing(args: argparse.Namespace) -> None:
    if not 0.0 <= args.path_smoothing <= LONGEST_MEMORY_S:
        raise ConfigurationError(
            f"--path-smoothing is {args.path_smoothing:g}, expected 0 to {LONGEST_MEMORY_S:g} s"
        )
    stride = STRIDE_S if args.stride is None else args.stride
    if args.path_smoothing and stride > LONGEST_CYCLE_S:
        raise ConfigurationError(
            f"--path-smoothing is given with --stride {stride:g}, expected at most "
            f"{LONGEST_CYCLE_S:g} s: predictions farther apart are not combined"
        )


def _given(args: argparse.Namespace, names: Iterable[str]) -> dict[str, bool]:
    """Return the flags of these options, and whether each is given."""
    return {f"--{name.replace('_', '-')}": getattr(args, name) != OF_A_RUN[name] for name in names}


def _with_data(args: argparse.Namespace) -> bool:
    """Return whether a directory of recordings is given."""
    return any(name == "data" for name, _ in args.data_options)


def _check(args: argparse.Namespace) -> None:
    """Check the arguments before anything is loaded.

    Raises:
        ConfigurationError: one sentence.
    """
    if not args.model and not args.predictions:
        raise ConfigurationError("neither --model nor --predictions is given, expected one")
    if args.model and not args.predictions and not args.data_options:
        raise ConfigurationError("--model is given without --data, expected recordings")
    if args.stride is not None and not args.stride > 0:
        raise ConfigurationError(f"--stride is {args.stride}, expected more than 0")
    if not args.min_future >= 0:
        raise ConfigurationError(f"--min-future is {args.min_future}, expected at least 0")
    if args.kde_samples and not 10 <= args.kde_samples <= 100_000:
        raise ConfigurationError(
            f"--kde-samples is {args.kde_samples}, expected 0, or 10 to 100000 samples"
        )
    if args.kde_samples and args.predictions:
        raise ConfigurationError(
            "--kde-samples is given with --predictions, expected models that are run here"
        )
    _check_path_smoothing(args)
    if args.policy == "ego":
        raise ConfigurationError("--policy is 'ego' but a recording has no ego, expected another")
    if args.predictions:
        for names, why in WITHOUT_EFFECT:
            require_none(_given(args, names), "--predictions", why)
    if args.seeds and len(args.model) < 2:
        raise ConfigurationError(
            f"--seeds is given with {len(args.model)} model(s), expected several of one recipe"
        )
    if args.one_sample and args.path_smoothing:
        raise ConfigurationError(
            "--one-sample is given with --path-smoothing, which needs a past, expected one of them"
        )
    if args.one_sample and (args.calibration == ONLINE or args.prefer == BEST):
        raise ConfigurationError(
            "--one-sample is given with --calibration online or --prefer best, which learn from a "
            "past"
        )
    if args.no_correct_paths and (args.one_sample or args.calibration not in (None, ONLINE)):
        other = "--one-sample" if args.one_sample else f"--calibration {args.calibration}"
        raise ConfigurationError(
            f"--no-correct-paths is given with {other}, by which no path is corrected, expected "
            "one of them"
        )
    if args.predictions and args.tracker == SIMULATED:
        raise ConfigurationError(
            "--tracker simulated is given with --predictions, whose observations were recorded"
        )
    if args.resume is not None and args.report is not None:
        raise ConfigurationError(
            "--resume is given with --report, whose pictures need all recordings, expected one"
        )
    if args.predictions and (args.jobs > 1 or args.cluster or args.resume is not None):
        raise ConfigurationError(
            "--jobs, --cluster or --resume is given with --predictions, which one process scores"
        )
    if args.tracker_seed is not None and args.tracker != SIMULATED:
        raise ConfigurationError("--tracker-seed is given without --tracker simulated")
    if args.tracker_seed is not None and args.tracker_seed < 0:
        raise ConfigurationError(f"--tracker-seed is {args.tracker_seed}, expected at least 0")


def _predictions_topic(args: argparse.Namespace) -> str | None:
    """Take the topic of the recorded predictions from the options of the recordings."""
    if not args.predictions:
        return None
    found = [value for name, value in args.data_options if name == "topic"]
    args.data_options = [item for item in args.data_options if item[0] != "topic"]
    return found[-1] if found else None


def _from_bags(
    args: argparse.Namespace, runners: dict[str, ModelRunner], topic: str | None
) -> BagResult:
    from mtpgo_training.evaluation.bags.bag_evaluation import evaluate_bags, observed_recordings

    with_data, sites = _with_data(args), {}
    reading = AS_USUAL if with_data else bag_options(args.data_options)
    if with_data:
        recordings = dict(named_recordings(data_sources(args.data_options), cache_from(args)))
        sites = {name: site_of(recording, name) for name, recording in recordings.items()}
    else:
        recordings = observed_recordings(args.predictions, reading, topic)
    return evaluate_bags(
        args.predictions,
        recordings,
        runners,
        sites=sites,
        topic=topic,
        min_future_s=args.min_future,
        own_clock=with_data,
        options=reading,
        draw=args.report is not None,
    )
