# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo study``: the paper's four studies, beside the paper's figures."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.commands.arguments.argument_types import (
    positive_integer,
    positive_number,
    require_given,
    require_none,
    require_one_budget,
    require_one_rate,
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

if TYPE_CHECKING:
    from mtpgo_training.study.study_rows import Study, StudyRow
    from mtpgo_training.training.training_config import TrainingConfig

DATA_SET_OF_LAYOUT = {"highd": "highd", "exid": "highd", "round": "round", "ind": "ind"}
"""Data set of the paper that recordings of a layout are compared with, where it has figures."""

STRIDE_S = 1.0
"""Time between two scored instants by default (s)."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo study`` to the command line."""
    parser = subparsers.add_parser(
        "study",
        help="the paper's tables by one command",
        description="Train and score all rows of one of the paper's tables, beside the paper's "
        "figures. The same command continues what was interrupted. docs/study.md explains it.",
    )
    add = parser.add_argument
    add("study", nargs="?", help="layers, static, comparison or ablation")
    add("--list", action="store_true", help="list the rows and what each costs, and exit")
    add(
        "--measure",
        action="store_true",
        help="with --list: measure a training step of each row on this machine (seconds each) and "
        "say how long a training of the paper's data sets takes",
    )
    add_data_arguments(parser)
    add("--out", type=Path, metavar="DIR", help="folder of the results and of all runs")
    add(
        "--rows",
        action="extend",
        nargs="+",
        metavar="ROW",
        help="rows to run, by name (default: all)",
    )
    add("--seeds", type=positive_integer, default=10, metavar="N", help="trainings of a row (10)")
    add(
        "--data-set",
        metavar="NAME",
        help="highd, round or ind: whose configurations and figures of the paper are taken "
        "(default: by the layout)",
    )
    add(
        "--config",
        metavar="CONFIG",
        help="configuration that all rows begin with, a file or a name (default: the paper's, "
        "which needs the paper's amount of data)",
    )
    add(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="overrides any value of the configuration of all rows; repeatable",
    )
    add(
        "--minutes-per-run",
        type=positive_number,
        metavar="MIN",
        help="processor time of each training (min): the schedule is shortened to fit",
    )
    add(
        "--steps-per-run",
        type=positive_integer,
        metavar="N",
        help="the same with a number of optimisation steps, which fits any machine",
    )
    add(
        "--epochs-per-run",
        type=positive_integer,
        metavar="N",
        help="epochs of each training (default: the configuration's, or as many as fit)",
    )
    add(
        "--patience",
        type=positive_integer,
        metavar="N",
        help="early stop: end a training after N epochs without a better validation",
    )
    add("--find-lr", action="store_true", help="learning rate of each run by a range test")
    add(
        "--stride",
        type=positive_number,
        metavar="S",
        help="time between two scored instants, in whole frames of the recordings (s; default 1)",
    )
    add(
        "--extrapolate",
        type=positive_number,
        metavar="S",
        help="also score this horizon (s; the paper: 7) where the network allows it",
    )
    add("--jobs", type=positive_integer, default=1, metavar="N", help="runs at the same time (1)")
    add(
        "--gpus",
        type=positive_integer,
        metavar="N",
        help="deal the runs out to N GPUs, one for each run",
    )
    add(
        "--part",
        metavar="I/N",
        help="run the I-th of N parts of the runs only, for instance as a task of a SLURM job "
        "array with the same --out",
    )
    add_cache_arguments(parser)
    add("--quiet", action="store_true", help="print the table and errors only")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo study``."""
    if args.list:
        return _list(args)
    part = _check(args)
    require_training_modules()
    # Imported here: torch and Fabric take seconds to load, and the parser does not need them.
    from mtpgo_training.commands.arguments.stride_warnings import (
        warn_of_data_strides,
        warn_of_scored_stride,
    )
    from mtpgo_training.crossval.fold_processes import failures_text
    from mtpgo_training.data.data_sources import read_all
    from mtpgo_training.study.output.study_output import write_results
    from mtpgo_training.study.output.study_page import write_page
    from mtpgo_training.study.output.study_tables import gaps, main_table
    from mtpgo_training.study.study_data import study_data
    from mtpgo_training.study.study_folder import StudyFolder
    from mtpgo_training.study.study_progress import StudyProgress, run_all
    from mtpgo_training.study.study_results import results
    from mtpgo_training.study.study_rows import StudyError, find_study
    from mtpgo_training.study.study_run import StudyRun
    from mtpgo_training.table_format import to_text
    from mtpgo_training.training.trial.schedule_plan import Budget

    study = find_study(args.study)
    rows = study.chosen(args.rows)
    data_set = _data_set(args, study)
    configs, refused = _configs(args, study.rows, rows, data_set)
    first = next(iter(configs.values()))
    _check_extrapolation(args, first)
    sources, cache = tuple(data_sources(args.data_options)), cache_from(args)
    require_sources(sources)
    require_folder(args.out)
    folder = StudyFolder(args.out)
    folder.require_usable()
    data = study_data(study, first, read_all(sources, cache))
    budget = Budget(args.minutes_per_run, args.epochs_per_run, args.steps_per_run)
    stride_s = STRIDE_S if args.stride is None else args.stride
    folder.start(
        {
            "study": study.name,
            "data_set": data_set,
            "stride_s": stride_s,
            "extrapolate_s": args.extrapolate,
            "find_lr": args.find_lr,
        },
        data,
        configs,
        budget,
    )
    warn_of_scored_stride(args.stride, data.splits.test)
    warn_of_data_strides(args.set, configs.values(), data.recordings)
    seeds = range(1, args.seeds + 1)
    wanted = [(row, seed) for seed in seeds for row in rows if row.name in configs]
    mine = wanted[part[0] - 1 :: part[1]]
    jobs = [
        StudyRun(
            study,
            row,
            seed,
            configs[row.name],
            first,
            sources,
            None if cache is None else cache.folder,
            folder.run(row.name, seed).path,
            budget,
            stride_s,
            args.extrapolate,
            args.find_lr,
            None if args.gpus is None else number % args.gpus,
        )
        for number, (row, seed) in enumerate(mine)
        if not folder.run(row.name, seed).done
    ]
    del data

    def write() -> dict[str, Any]:
        content = results(study, data_set, folder, rows, seeds, refused)
        write_results(folder.path, content)
        return content

    progress = StudyProgress(len(mine), len(mine) - len(jobs), args.jobs, quiet=args.quiet)

    for name, text in refused.items():
        progress.failed(name, text, count=False)
    received_signal, failures = run_all(jobs, args.jobs, progress, write)
    content = write()
    page = write_page(folder, content)
    print(f"\n{to_text(main_table(content))}\n")
    for text in gaps(content):
        print(f"gap: {text}")
    if not args.quiet:
        print(f"written to {folder.path}: result.md, .tex, .csv, .json, and {page.name}")
    if received_signal is not None:
        if not args.quiet:
            print(f"interrupted; to continue: {same_command(args)}")
        return 128 + received_signal
    if jobs and not any(row["seeds"] for row in content["rows"]):
        raise StudyError(f"no run of the study is done: {progress.last_error}")
    if failures:
        sys.stdout.flush()
        raise StudyError(failures_text("runs", failures, len(mine)))
    return 0


def _check(args: argparse.Namespace) -> tuple[int, int]:
    """Check the arguments before anything is loaded; return the part and the number of parts.

    Raises:
        ConfigurationError: one sentence.
    """
    given = {"the study": args.study, "--out": args.out, "--data": args.data_options}
    require_given(given, "--list")
    if args.measure:
        raise ConfigurationError("--measure is given without --list, expected both")
    require_one_rate(args.find_lr, args.set, "--set")
    require_one_budget("run", args.minutes_per_run, args.steps_per_run)
    if args.part is None:
        return 1, 1
    first, _, count = args.part.partition("/")
    if not (first.isdecimal() and count.isdecimal() and 1 <= int(first) <= int(count)):
        raise ConfigurationError(
            f"--part is {args.part!r}, expected I/N with I from 1 to N, such as 1/4"
        )
    return int(first), int(count)


def _check_extrapolation(args: argparse.Namespace, config: TrainingConfig) -> None:
    """Check that the longer horizon is longer.

    Raises:
        ConfigurationError: it is not.
    """
    from mtpgo_training.training.networks import horizon_steps

    horizon_s = horizon_steps(config.model) * config.history.dt_s
    if args.extrapolate is not None and args.extrapolate < horizon_s + 0.5 * config.history.dt_s:
        raise ConfigurationError(
            f"--extrapolate is {args.extrapolate:g} s, expected more than the horizon of the "
            f"training, {horizon_s:g} s"
        )


def _data_set(args: argparse.Namespace, study: Study) -> str:
    """Return the data set of the paper.

    Raises:
        ConfigurationError: the study has no figures for the one that is named.
    """
    if args.data_set is not None:
        if args.data_set not in study.data_sets:
            raise ConfigurationError(
                f"--data-set is {args.data_set!r}, expected for the study {study.name} "
                + " or ".join(study.data_sets)
            )
        return str(args.data_set)
    layouts = [value for name, value in args.data_options if name == "layout"]
    sets = [DATA_SET_OF_LAYOUT.get(str(layout), "") for layout in layouts]
    return next((name for name in sets if name in study.data_sets), study.data_sets[0])


def _configs(
    args: argparse.Namespace, known: Sequence[StudyRow], rows: Sequence[StudyRow], data_set: str
) -> tuple[dict[str, TrainingConfig], dict[str, str]]:
    """Return the configurations of the rows by name, and why others have none.

    Raises:
        ConfigurationError: no row has one.
    """
    from mtpgo_training.study.study_rows import row_config

    configs: dict[str, TrainingConfig] = {}
    refused: dict[str, str] = {}
    trained = [row for row in rows if row.is_trained]
    if not trained:
        raise ConfigurationError(
            f"--rows names {' '.join(row.name for row in rows)}, expected a row that is trained, "
            "whose road users the others are scored on: "
            + ", ".join(row.name for row in known if row.is_trained)
        )
    settings = list(args.set)
    if args.patience is not None:
        settings.append(f"trainer.patience_epochs={args.patience}")
    for row in trained:
        try:
            configs[row.name] = row_config(row, data_set, args.config, settings)
        except ConfigurationError as error:
            refused[row.name] = str(error)
    if not configs:
        raise ConfigurationError(next(iter(refused.values())))
    return configs, refused


def _list(args: argparse.Namespace) -> int:
    given = {
        "--rows": args.rows is not None,
        "--data-set": args.data_set is not None,
        "--config": args.config is not None,
        "--set": bool(args.set),
        "--data": bool(args.data_options),
        "--out": args.out is not None,
        "--minutes-per-run": args.minutes_per_run is not None,
        "--steps-per-run": args.steps_per_run is not None,
        "--epochs-per-run": args.epochs_per_run is not None,
    }
    require_none(given, "--list", "which lists all rows of the paper's configurations")
    from mtpgo_training.study.study_costs import costs_table
    from mtpgo_training.study.study_rows import STUDIES, find_study
    from mtpgo_training.table_format import to_text
    from mtpgo_training.training.torch_process import prepare_process

    prepare_process(1)  # as the runs of a study
    for study in [find_study(args.study)] if args.study else STUDIES.values():
        print(f"{study.name} (paper: {', '.join(study.data_sets)})")
        print(to_text(costs_table(study, measure=args.measure)), end="\n\n")
    return 0
