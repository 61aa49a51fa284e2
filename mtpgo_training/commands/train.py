# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo train``: train a network on recordings, into a run folder with checkpoints."""

from __future__ import annotations

import argparse
import dataclasses
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

from mtpgo_core.completion import completed_by
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task.model_file import find_checkpoint
from mtpgo_training.commands.arguments.argument_types import positive_number, require_one_rate
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
from mtpgo_training.commands.arguments.sweep_arguments import add_sweep_arguments, is_sweep
from mtpgo_training.training.recipes.named_configs import config_names, find_config, named_configs
from mtpgo_training.training.training_config import PRECISIONS, TrainingConfig, load_config


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo train`` to the command line."""
    parser = subparsers.add_parser("train", help="train a model on recordings")
    completed_by(
        parser.add_argument(
            "config", help="YAML configuration of the training, or the name of one (--list)"
        ),
        config_names,
    )
    parser.add_argument(
        "--list", action=ListConfigs, nargs=0, help="list the configurations by name, and exit"
    )
    add_data_arguments(parser, required=True)
    parser.add_argument("--out", type=Path, required=True, help="run folder")
    parser.add_argument("--resume", action="store_true", help="continue an interrupted run")
    parser.add_argument(
        "--init-from",
        metavar="CHECKPOINT",
        help="start from these weights: shipped model, checkpoint or run folder, of the same "
        "architecture",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="overrides any value of the configuration, for instance model.order=1; repeatable",
    )
    parser.add_argument(
        "--find-lr",
        action="store_true",
        help="take the learning rate from a range test of 100 steps before the first epoch",
    )
    parser.add_argument("--name", help="name of the resulting model, overrides name")
    parser.add_argument(
        "--model", metavar="NETWORK", help="overrides network, and appends it to name"
    )
    parser.add_argument("--epochs", type=int, help="overrides optimisation.epochs")
    parser.add_argument("--seed", type=int, help="overrides seed")
    parser.add_argument(
        "--devices", type=int, help="overrides trainer.devices; on a CPU: processes"
    )
    parser.add_argument(
        "--precision", help=f"overrides trainer.precision: {', '.join(PRECISIONS)}"
    )
    limits = parser.add_mutually_exclusive_group()
    limits.add_argument(
        "--minutes",
        type=positive_number,
        metavar="MIN",
        help="time of everything (min), reading and validation included: the schedule of a new "
        "run is shortened to fit, and the run ends with a validated checkpoint",
    )
    limits.add_argument(
        "--max-minutes",
        type=positive_number,
        metavar="MIN",
        help="the same without a change of the schedule, whose rest --resume trains",
    )
    add_sweep_arguments(parser)
    add_cache_arguments(parser)
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.set_defaults(run=run)


class ListConfigs(argparse.Action):
    """``--list``: print the names, as ``--help`` prints the help."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: Any, values: Any, option: Any = None
    ) -> None:
        """Print the configurations and exit."""
        configs = named_configs()
        width = max(len(config.name) for config in configs)
        for config in configs:
            print(f"{config.name:<{width}}  {config.summary}")
        parser.exit()


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo train``."""
    started_s = time.monotonic()
    # Set before torch is loaded: DDP would warn that parameters are unused, which is intended.
    os.environ.setdefault("TORCH_CPP_LOG_LEVEL", "ERROR")
    config = overridden(load_config(find_config(args.config), args.set), args)
    require_one_rate(args.find_lr, args.set, "--set")
    if args.init_from is not None and args.resume:
        raise ConfigurationError(
            "--init-from is given with --resume, expected one: a resumed run has its weights"
        )
    init_from = None if args.init_from is None else find_checkpoint(args.init_from)
    sources = data_sources(args.data_options)
    cache = cache_from(args)
    require_sources(sources)
    require_training_modules()
    if init_from is not None:
        from mtpgo_training.export.shipped_checkpoint import require_pair

        require_pair(args.init_from, init_from)
    if is_sweep(args):
        from mtpgo_training.commands.sweep.sweep_command import run_sweep

        return run_sweep(args, config, init_from, sources, cache)
    # Imported here: torch and Fabric take seconds to load, and the parser does not need them.
    from mtpgo_training.commands.arguments.stride_warnings import warn_of_data_strides
    from mtpgo_training.data.data_sources import read_all
    from mtpgo_training.training.console import summary
    from mtpgo_training.training.loop.device_setup import is_first_process
    from mtpgo_training.training.run_folder import RunFolder
    from mtpgo_training.training.trainer import require_startable, train

    require_folder(args.out)
    require_startable(config, RunFolder(args.out), resume=args.resume, init_from=init_from)
    recordings = read_all(sources, cache)
    if is_first_process():
        warn_of_data_strides(args.set, [config], recordings)
    result = train(
        config,
        recordings,
        RunFolder(args.out),
        resume=args.resume,
        init_from=init_from,
        find_rate=args.find_lr,
        max_minutes=args.minutes if args.minutes is not None else args.max_minutes,
        shorten=args.minutes is not None,
        started_s=started_s,
        cache=cache,
        verbose=not args.quiet,
        progress=not args.quiet and sys.stderr.isatty(),
    )
    if not result.is_global_zero:
        return 0
    if not args.quiet:
        again = same_command(args, "--resume", without=["--init-from"])
        print(summary(result, args.out, again))
    received = result.received_signal
    return 0 if received is None else 128 + signal.Signals(received)


def overridden(config: TrainingConfig, args: argparse.Namespace) -> TrainingConfig:
    """Return the configuration with the values given on the command line.

    Raises:
        ConfigurationError: the configuration does not allow a value.
    """

    def given(**values: Any) -> dict[str, Any]:
        return {key: value for key, value in values.items() if value is not None}

    if args.model is not None:
        from mtpgo_training.training.networks import options_for

        options = options_for(args.model, config.model)
        name = f"{config.name}-{args.model}"
        config = dataclasses.replace(config, name=name, network=args.model, model=options)
    return dataclasses.replace(
        config,
        **given(name=args.name, seed=args.seed),
        optimisation=dataclasses.replace(config.optimisation, **given(epochs=args.epochs)),
        trainer=dataclasses.replace(
            config.trainer, **given(devices=args.devices, precision=args.precision)
        ),
    )
