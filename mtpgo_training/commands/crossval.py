# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo crossval``: train without some sites, test on them, until each was left out."""

from __future__ import annotations

import argparse
import dataclasses
import signal
import sys
from pathlib import Path

from mtpgo_core.completion import completed_by
from mtpgo_core.errors import ConfigurationError
from mtpgo_training.commands.arguments.argument_types import (
    positive_integer,
    positive_number,
    require_given,
    require_none,
    require_one_budget,
)
from mtpgo_training.commands.arguments.data_arguments import (
    add_cache_arguments,
    add_data_arguments,
    cache_from,
    data_sources,
)
from mtpgo_training.commands.arguments.early_checks import (
    require_folder,
    require_sources,
    require_training_modules,
)
from mtpgo_training.commands.arguments.next_command import same_command
from mtpgo_training.scenes.tracker.tracker_config import OBSERVATIONS
from mtpgo_training.table_format import to_text
from mtpgo_training.training.recipes.named_configs import config_names

STRIDE_S = 1.0
"""Time between two scored instants by default (s)."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo crossval`` to the command line."""
    parser = subparsers.add_parser(
        "crossval",
        help="train without some sites and test on them, until each was left out",
        description="Train without the sites of a fold, score on each of them, fold by fold; by "
        "default each site is a fold. The same command continues what was interrupted. "
        "docs/training.md explains the tables.",
    )
    add = parser.add_argument
    completed_by(
        add("config", nargs="?", help="YAML configuration of the training, or the name of one"),
        config_names,
    )
    add_data_arguments(parser)
    add("--out", type=Path, metavar="DIR", help="folder of the results and of all folds")
    add(
        "--folds",
        action="extend",
        nargs="+",
        metavar="NAME",
        help="folds to run, each by its name or that of a site in it (default: all); the "
        "configuration's crossval.sites names sites, crossval.folds what is left out together",
    )
    add(
        "--minutes-per-fold",
        type=positive_number,
        metavar="MIN",
        help="processor time of each training (min): the schedule is shortened to fit",
    )
    add(
        "--steps-per-fold",
        type=positive_integer,
        metavar="N",
        help="the same with a number of optimisation steps, which fits any machine",
    )
    add(
        "--epochs-per-fold",
        type=positive_integer,
        metavar="N",
        help="epochs of each training (default: the configuration's, or as many as fit)",
    )
    add(
        "--init-from",
        type=Path,
        metavar="DIR",
        help="another cross-validation: each training begins with the weights of its fold there, "
        "or of one that left out all of its sites, and others",
    )
    add(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="overrides any value of the configuration, for instance model.order=1; repeatable",
    )
    add("--seed", type=int, help="overrides seed")
    add(
        "--stride",
        type=positive_number,
        metavar="S",
        help="time between two scored instants, in whole frames of the recordings (s; default 1)",
    )
    add(
        "--tracker",
        nargs="+",
        choices=OBSERVATIONS,
        default=list(OBSERVATIONS),
        help="score what is predicted from the recordings as they are, or as a simulated tracker "
        "reports them (both)",
    )
    add("--jobs", type=positive_integer, default=1, metavar="N", help="folds at the same time (1)")
    add(
        "--compare",
        nargs=2,
        type=Path,
        metavar="DIR",
        help="do not train: print two earlier results side by side",
    )
    add("--manoeuvres", action="store_true", help="print the manoeuvres as well")
    add(
        "--since-start",
        action="store_true",
        help="print moving and turning road users by the time since the recording's start as well",
    )
    add_cache_arguments(parser)
    add("--quiet", action="store_true", help="print the tables and errors only")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo crossval``."""
    if args.compare:
        return _compare(args)
    _check(args)
    # Imported here: torch and Fabric take seconds to load, and the parser does not need them.
    require_training_modules()
    sources, cache = tuple(data_sources(args.data_options)), cache_from(args)
    require_sources(sources)
    require_folder(args.out)
    from mtpgo_training.commands.arguments.stride_warnings import (
        warn_of_data_strides,
        warn_of_scored_stride,
    )
    from mtpgo_training.crossval.crossval_folder import CALIBRATION_HEADING, CrossvalFolder
    from mtpgo_training.crossval.fold import FoldJob
    from mtpgo_training.crossval.fold_processes import FoldError, failures_text, run_folds
    from mtpgo_training.crossval.fold_progress import FoldProgress
    from mtpgo_training.crossval.site_folds import (
        chosen_folds,
        find_folds,
        find_sites,
        without_fold,
    )
    from mtpgo_training.data.data_sources import read_all
    from mtpgo_training.training.interruption import Interruption
    from mtpgo_training.training.recipes.configured_origins import with_site_origins
    from mtpgo_training.training.recipes.named_configs import find_config
    from mtpgo_training.training.run_loss import trainable_network
    from mtpgo_training.training.training_config import load_config
    from mtpgo_training.training.trial.schedule_plan import Budget

    config = load_config(find_config(args.config), args.set)
    if args.seed is not None:
        config = dataclasses.replace(config, seed=args.seed)
    trainable_network(config)
    folder = CrossvalFolder(args.out)
    folder.require_usable()
    if args.init_from is not None and not args.init_from.is_dir():
        raise ConfigurationError(
            f"--init-from is {args.init_from}, which is no folder, expected a cross-validation"
        )
    recordings = read_all(sources, cache)
    config = with_site_origins(config, recordings)
    sites = find_sites(recordings, config.crossval.sites)
    folds = find_folds(sites, config.crossval.folds)
    chosen = chosen_folds(folds, args.folds)
    for fold in chosen:
        without_fold(config, recordings, fold)  # its errors, before anything is trained
    initial = {}
    if args.init_from is not None:
        initial = CrossvalFolder(args.init_from).runs(chosen, recordings)
    budget = Budget(args.minutes_per_fold, args.epochs_per_fold, args.steps_per_fold)
    trackers = tuple(dict.fromkeys(args.tracker))
    stride_s = STRIDE_S if args.stride is None else args.stride
    folder.start(config, folds, recordings, budget, stride_s, trackers, args.init_from)
    scored = {name for fold in chosen for name in fold.recordings}
    warn_of_scored_stride(args.stride, [one for one in recordings if one.name in scored])
    warn_of_data_strides(args.set, [config], recordings)
    cache_folder = None if cache is None else cache.folder
    jobs = [
        FoldJob(
            fold,
            config,
            sources,
            cache_folder,
            folder.fold(fold.name).path,
            budget,
            stride_s,
            trackers,
            initial.get(fold.name),
        )
        for fold in chosen
        if not folder.fold(fold.name).done
    ]
    del recordings
    progress = FoldProgress(folder, trackers[0], quiet=args.quiet)
    progress.say(f"{len(chosen)} of {len(folds)} folds, {len(chosen) - len(jobs)} done before")
    with Interruption() as interruption:
        run_folds(
            jobs,
            args.jobs,
            interruption,
            started=progress.started,
            finished=progress.finished,
            failed=progress.failed,
        )
    content = folder.write_results()
    if content["folds"]:
        _print_results(content, manoeuvres=args.manoeuvres, since_start=args.since_start)
        calibrated = folder.calibration()
        if calibrated is not None:
            print(f"\n{CALIBRATION_HEADING}\n{to_text(calibrated)}\n")
        progress.say(f"written to {folder.result} and {folder.markdown}")
    if interruption.received_signal is not None:
        progress.say(f"interrupted; to continue: {same_command(args)}")
        return 128 + signal.Signals(interruption.received_signal)
    if progress.failures:
        raise FoldError(failures_text("folds", progress.failures, len(jobs)))
    return 0


def _print_results(content: dict[str, object], *, manoeuvres: bool, since_start: bool) -> None:
    from mtpgo_training.crossval.crossval_tables import (
        NOTE,
        scores_table,
        trainings_table,
        unscored_sites,
    )

    for sentence in unscored_sites(content):
        print(f"mtpgo: warning: {sentence}", file=sys.stderr)
    print(f"\n{to_text(trainings_table(content))}\n")
    trackers = content["mean_of_sites"]
    assert isinstance(trackers, dict)
    for tracker in trackers:
        table = scores_table(content, tracker, manoeuvres=manoeuvres, since_start=since_start)
        print(f"observations: {tracker}\n{to_text(table)}\n")
    print(NOTE)


def _compare(args: argparse.Namespace) -> int:
    from mtpgo_training.crossval.crossval_folder import read_results
    from mtpgo_training.crossval.crossval_tables import comparison_table, differences

    if args.config is not None or args.data_options or args.out is not None:
        raise ConfigurationError(
            "--compare is given with a configuration, --data or --out, expected two folders only"
        )
    given = {
        "--folds": args.folds is not None,
        "--minutes-per-fold": args.minutes_per_fold is not None,
        "--steps-per-fold": args.steps_per_fold is not None,
        "--epochs-per-fold": args.epochs_per_fold is not None,
        "--init-from": args.init_from is not None,
        "--set": bool(args.set),
        "--seed": args.seed is not None,
        "--stride": args.stride is not None,
        "--tracker": args.tracker != list(OBSERVATIONS),
        "--jobs": args.jobs != 1,
    }
    require_none(given, "--compare", "which trains and scores nothing")
    first, second = map(read_results, args.compare)
    names = [path.resolve().name for path in args.compare]
    table = comparison_table(
        first, second, names, manoeuvres=args.manoeuvres, since_start=args.since_start
    )
    print(to_text(table))
    for sentence in differences(first, second):
        print(f"Note: {sentence}.")
    return 0


def _check(args: argparse.Namespace) -> None:
    """Check the arguments before anything is loaded.

    Raises:
        ConfigurationError: one sentence.
    """
    given = {"a configuration": args.config, "--out": args.out, "--data": args.data_options}
    require_given(given, "--compare")
    require_one_budget("fold", args.minutes_per_fold, args.steps_per_fold)
