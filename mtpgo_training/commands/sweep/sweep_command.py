# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo train --sweep``: every combination of values, and one table."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.commands.arguments.argument_types import require_one_rate
from mtpgo_training.commands.arguments.early_checks import require_folder
from mtpgo_training.commands.arguments.next_command import command_text, same_command
from mtpgo_training.commands.arguments.stride_warnings import warn_of_data_strides
from mtpgo_training.crossval.fold_processes import FoldError, failures_text
from mtpgo_training.data.data_sources import DataSource, read_all
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.study.study_progress import StudyProgress, run_all
from mtpgo_training.sweep.sweep_folder import SweepFolder
from mtpgo_training.sweep.sweep_grid import GridPoint, grid_points, swept_keys
from mtpgo_training.sweep.sweep_results import (
    gaps,
    remark,
    results,
    results_table,
    write_results,
)
from mtpgo_training.sweep.sweep_run import (
    SweepOptions,
    SweepRun,
    for_one_process,
    same_split,
)
from mtpgo_training.table_format import to_text
from mtpgo_training.training.checkpointing import start_from
from mtpgo_training.training.networks import options_for
from mtpgo_training.training.recipes.named_configs import find_config
from mtpgo_training.training.run_folder import load_checkpoint
from mtpgo_training.training.run_loss import trainable_network
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.training_config import TrainingConfig, load_config

OPTIONS_OF_KEYS = {
    "seed": "seed",
    "name": "name",
    "network": "model",
    "optimisation.epochs": "epochs",
    "trainer.devices": "devices",
    "trainer.precision": "precision",
}
"""Key of the configuration -> option that overrides it."""

UNTRAINED_KEYS = ("attribution", "crossval", "licence", "name", "num_threads", "trainer")
"""Parts of the configuration that do not change what is trained."""


def run_sweep(
    args: argparse.Namespace,
    base: TrainingConfig,
    init_from: Path | None,
    sources: Sequence[DataSource],
    cache: RecordingCache | None,
) -> int:
    """Train every combination that is not done, and print the table.

    Args:
        args: of ``mtpgo train``.
        base: the configuration without the swept values.
        init_from: checkpoint whose weights to start from.
        sources: the directories of recordings.
        cache: of the recordings.

    Returns:
        0, or 128 and the number of the signal that ended it.

    Raises:
        MtpgoError: the sweep cannot be made, or a run failed.
    """
    jobs = args.jobs or 1
    _require_once(args)
    points = grid_points(args.sweep, base.seed)
    require_folder(args.out)
    folder = SweepFolder(args.out)
    folder.require_usable()
    base = for_one_process(base, jobs)
    configs = _configs(args, base, points, jobs, init_from)
    options = SweepOptions(
        base,
        not any(key == "data" or key.startswith("data.") for key in swept_keys(args.sweep)),
        tuple(sources),
        None if cache is None else cache.folder,
        init_from,
        args.find_lr,
        args.minutes,
        args.max_minutes,
    )
    recordings = read_all(sources, cache)
    if options.splits_once:
        same_split(base, base, recordings)  # its errors, before anything is trained
    folder.start(options, recordings)
    warn_of_data_strides([*args.set, *args.sweep], configs.values(), recordings)
    del recordings
    waiting = [
        SweepRun(point, configs[point], options, folder.run(point.name).path)
        for point in points
        if not folder.run(point.name).done
    ]

    def write() -> dict[str, Any]:
        content = results(folder, points)
        write_results(folder, content)
        return content

    progress = StudyProgress(len(points), len(points) - len(waiting), jobs, quiet=args.quiet)
    received_signal, failures = run_all(waiting, jobs, progress, write)
    content = write()
    print(f"\n{to_text(results_table(content))}\n\n{remark(content)}")
    for text in gaps(content):
        print(f"gap: {text}")
    if not args.quiet:
        print(f"written to {folder.path}: result.md, .csv and .json")
        if content["best"] is not None:
            best = folder.run(content["best"]).run
            print(f"next: {command_text('mtpgo', 'export', best, '-o', f'{base.name}.pt')}")
    if received_signal is not None:
        if not args.quiet:
            print(f"interrupted; to continue: {same_command(args)}")
        return 128 + received_signal
    if failures:
        sys.stdout.flush()
        raise FoldError(failures_text("runs", failures, len(points)))
    return 0


def _require_once(args: argparse.Namespace) -> None:
    """Check that nothing else sets a swept value.

    Raises:
        ConfigurationError: something does.
    """
    if args.devices is not None:
        raise ConfigurationError(
            f"--devices is {args.devices} with --sweep, whose runs have one process each; --jobs "
            "is the number of runs at the same time"
        )
    require_one_rate(args.find_lr, args.sweep, "--sweep")
    fixed = {setting.partition("=")[0]: "--set" for setting in args.set}
    for key, option in OPTIONS_OF_KEYS.items():
        if getattr(args, option) is not None:
            fixed[key] = f"--{option}"
    for key in swept_keys(args.sweep):
        if key in fixed:
            raise ConfigurationError(f"{key} is given with --sweep and {fixed[key]}, expected one")
        if key.partition(".")[0] in UNTRAINED_KEYS:
            raise ConfigurationError(
                f"--sweep names {key}, which does not change what is trained, expected a key of "
                "model, optimisation, data, scene or history, network or seed"
            )


def _configs(
    args: argparse.Namespace,
    base: TrainingConfig,
    points: Sequence[GridPoint],
    jobs: int,
    init_from: Path | None,
) -> dict[GridPoint, TrainingConfig]:
    """Return the configurations of all combinations, of each of which a network was built.

    Raises:
        ConfigurationError: values of a combination do not go together; the message names it. Or
            the checkpoint cannot be used.
    """
    # Imported here: the command imports this module.
    from mtpgo_training.commands.train import overridden

    path = find_config(args.config)
    initial = None if init_from is None else load_checkpoint(init_from)
    configs = {}
    for point in points:
        try:
            config = overridden(load_config(path, [*args.set, *point.overrides()]), args)
            if config.network != base.network:
                model = options_for(config.network, config.model)
                config = dataclasses.replace(config, model=model)
            config = dataclasses.replace(for_one_process(config, jobs), name=point.name)
            network = trainable_network(config)
            if initial is not None and init_from is not None:
                start_from(TrainingRun(network, config), initial, init_from)
        except ConfigurationError as error:
            raise ConfigurationError(f"--sweep {' '.join(point.overrides())}: {error}") from error
        configs[point] = config
    return configs
