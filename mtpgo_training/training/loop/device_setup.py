# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Devices and processes of a training, by Lightning Fabric."""

from __future__ import annotations

import logging
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import torch
from lightning_fabric import Fabric
from lightning_fabric.plugins.environments import LightningEnvironment
from lightning_fabric.utilities.exceptions import MisconfigurationException

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.training_config import TrainingConfig


def fabric_for(config: TrainingConfig) -> Fabric:
    """Return Fabric for the configured devices.

    Raises:
        ConfigurationError: they are not available on this machine, or other machines are wanted
            and nothing says where they are.
    """
    options = config.trainer
    strategy = options.strategy
    if options.devices != 1 or options.num_nodes > 1 or strategy == "ddp":
        # No covariance is computed in the first epochs, so its parameters get no gradient there.
        strategy = "ddp_find_unused_parameters_true"
    try:
        with quiet_fabric():
            fabric = Fabric(
                accelerator=options.accelerator,
                devices=options.devices or "auto",
                num_nodes=options.num_nodes,
                strategy=strategy,
                precision=options.precision,  # type: ignore[arg-type]
            )
    except (MisconfigurationException, RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigurationError(
            f"the section trainer (accelerator {options.accelerator!r}, {options.devices} "
            f"device(s), precision {options.precision!r}) does not fit this machine: {reason}"
        ) from error
    environment = getattr(fabric.strategy, "cluster_environment", None)
    found = "MASTER_ADDR" in os.environ and {"NODE_RANK", "GROUP_RANK"} & os.environ.keys()
    if options.num_nodes > 1 and isinstance(environment, LightningEnvironment) and not found:
        # It would wait half an hour for processes that were never started.
        raise ConfigurationError(
            f"trainer.num_nodes is {options.num_nodes}, and neither torchrun, SLURM or MPI has "
            "started this process nor are MASTER_ADDR and NODE_RANK set, expected that, or "
            "one machine"
        )
    return fabric


def is_first_process() -> bool:
    """Return whether this process was not started to share a training with an earlier one."""
    names = ("RANK", "LOCAL_RANK", "NODE_RANK", "GROUP_RANK", "SLURM_PROCID")
    return all(os.environ.get(name, "0") == "0" for name in names)


def require_own_processes(fabric: Fabric, config: TrainingConfig) -> None:
    """Check that processes which share a plan are started by the one that makes it.

    Raises:
        ConfigurationError: another program has started them.
    """
    environment = getattr(fabric.strategy, "cluster_environment", None)
    started = environment is not None and environment.creates_processes_externally
    if config.trainer.num_nodes > 1 or (started and fabric.is_global_zero):
        raise ConfigurationError(
            "--minutes is given with processes that another program has started or that are on "
            "several machines, expected --max-minutes, which leaves the schedule as it is"
        )


def require_shares(processes: int, config: TrainingConfig, scenes: int) -> None:
    """Check that every process gets a scene of every batch.

    Raises:
        ConfigurationError: a process would not.
    """
    size = config.optimisation.batch_scenes
    if processes > 1 and min(size // 2, scenes) < processes:
        raise ConfigurationError(
            f"optimisation.batch_scenes is {size}, with {scenes} scenes an epoch, "
            f"expected at least {2 * processes} of both for {processes} processes"
        )


def torch_threads(config: TrainingConfig) -> int:
    """Return the number of torch's threads; several processes on a CPU have one each."""
    options = config.trainer
    on_cpu = options.accelerator == "cpu" or (
        options.accelerator == "auto" and not torch.cuda.is_available()
    )
    return 1 if on_cpu and options.devices != 1 else config.num_threads


@contextmanager
def quiet_fabric() -> Iterator[None]:
    """Suppress Fabric's tips and notes; this package prints what matters."""
    logging.getLogger("lightning_fabric").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"lightning_fabric\.")
        yield
