# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The training loop, on Lightning Fabric for devices, processes and precision.

Only ``mtpgo train`` imports this module, when it runs: Fabric comes with the extra ``training``
and takes seconds to load.
"""

from __future__ import annotations

import copy
import dataclasses
import logging
import os
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path

import torch
from lightning_fabric import Fabric
from lightning_fabric.utilities.exceptions import MisconfigurationException
from torch import Tensor, nn
from torch.utils.tensorboard import SummaryWriter
from torch_geometric.data import Batch
from torch_geometric.loader import DataLoader
from tqdm import tqdm

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import only_writer
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.scenes.scene_dataset import dense
from mtpgo_training.training.checkpointing import (
    all_recordings,
    resume_from,
    save_checkpoint,
    save_unfinished,
    start_from,
)
from mtpgo_training.training.console import epoch_line, setting_text, title_line
from mtpgo_training.training.data_loading import Scenes, epoch_loader, prepare_scenes, reweighted
from mtpgo_training.training.interruption import Interruption
from mtpgo_training.training.losses.ewta_loss import observed_agents
from mtpgo_training.training.losses.schedules import learning_rate
from mtpgo_training.training.networks import build_network, weights_hash
from mtpgo_training.training.recipes.configured_origins import with_site_origins
from mtpgo_training.training.run_folder import Checkpoint, RunFolder, load_checkpoint
from mtpgo_training.training.run_loss import BatchLoss
from mtpgo_training.training.run_state import Row, TrainingRun
from mtpgo_training.training.torch_process import prepare_process
from mtpgo_training.training.training_config import TrainingConfig, load_config
from mtpgo_training.training.trial.epoch_cost import measure_validation
from mtpgo_training.training.trial.learning_rate_range import (
    RangeTest,
    learning_rate_range_test,
)
from mtpgo_training.training.trial.schedule_plan import SchedulePlan
from mtpgo_training.training.trial.time_limit import TimeLimit, plan_for_time, plan_text
from mtpgo_training.training.validation import validate_epoch

RANGE_TEST_FILE = "learning_rate_test.csv"
"""Points of the range test, in the run folder."""

PLAN_FILE = "plan.json"
"""Schedule that was made for a time limit, in the run folder."""

STATISTICS_SCENES = 512
"""Scenes from which the scales of the network's inputs are taken (chosen)."""

CALIBRATED_PARTS = ("noise", "initial_covariance")
"""Parts of the networks that give their covariances: MTP-GO has both, baselines and ablations the
first. Weights trained on which mode is nearest made the heaviest mode's ADE 7 % larger (measured);
they get a temperature when the model is exported."""

TENSORBOARD_STEPS = 10
"""Steps between two points of the loss in TensorBoard (chosen: small files)."""


def train(
    config: TrainingConfig,
    recordings: Sequence[NamedRecording],
    folder: RunFolder,
    *,
    resume: bool = False,
    init_from: Path | None = None,
    find_rate: bool = False,
    max_minutes: float | None = None,
    shorten: bool = False,
    started_s: float | None = None,
    cache: RecordingCache | None = None,
    scenes: Scenes | None = None,
    verbose: bool = False,
    progress: bool = False,
) -> TrainingRun:
    """Train a network.

    Args:
        config: the configuration.
        recordings: all recordings; the configuration says how they are split.
        folder: the run's folder, new unless ``resume``.
        resume: continue the run in the folder; its configuration and data must be the same.
        init_from: checkpoint of the same architecture whose weights to start from.
        find_rate: take the learning rate from a range test before the first epoch, see
            :mod:`mtpgo_training.training.trial.learning_rate_range`; a resumed run has its own.
        max_minutes: time limit (min). The current step is completed, and the weights are
            validated within the limit unless they were already.
        shorten: make the schedule of a new run fit into ``max_minutes``; a resumed run keeps the
            schedule that it has.
        started_s: ``time.monotonic()`` from which ``max_minutes`` counts, by default now.
        cache: keeps what is expensive to compute from the recordings.
        scenes: the scenes of these recordings with this configuration, if they were prepared.
        verbose: print the setting of the run and a line per epoch.
        progress: show progress bars.

    Returns:
        The run in its final state.

    Raises:
        ConfigurationError: the configuration, the split, the folder, a checkpoint or the device
            cannot be used.
    """
    limit = TimeLimit(max_minutes, started_s)
    prepare_process(_threads(config))
    plan_file = folder.path / PLAN_FILE
    if resume and plan_file.is_file():
        config = SchedulePlan.load(plan_file).applied(config, recordings)
    if find_rate and resume and (folder.path / "config.yaml").is_file():
        stored = load_config(folder.path / "config.yaml")
        config = _with_rate(config, stored.optimisation.learning_rate)
    config = with_site_origins(config, recordings)
    torch.manual_seed(config.seed)
    model = build_network(config.network, config.model, config.history, config.scene)
    _freeze(model, config.optimisation.train_only)
    horizon = model.config.horizon_steps
    splits = split(recordings, config.data, config.seed, window_s(config.history, horizon))
    run = TrainingRun(model, config)
    initial = load_checkpoint(init_from) if init_from else None
    checkpoint: Checkpoint | None = None
    if resume:
        folder.check_same(config, splits.describe())
        checkpoint = load_checkpoint(folder.last) if folder.last.exists() else None
    if init_from and initial:
        start_from(run, initial, init_from)
    if checkpoint:
        resume_from(run, checkpoint, folder.last)

    fabric = _fabric(config)
    run.is_global_zero = fabric.is_global_zero
    verbose, progress = verbose and run.is_global_zero, progress and run.is_global_zero
    creates_folder = run.is_global_zero and not resume
    if creates_folder:
        folder.require_new()
    if shorten and not resume:
        _require_own_processes(fabric, config)
        if not run.is_global_zero:  # the first process made the plan before it started this one
            config = run.config = SchedulePlan.load(plan_file).applied(config, recordings)
    if scenes is None:
        scenes = prepare_scenes(config, splits, horizon, cache=cache, progress=progress)
    if not (checkpoint or initial):
        _fit_statistics(run, scenes)
    _require_shares(fabric.world_size, config, len(scenes.training))
    range_test: RangeTest | None = None
    if find_rate and not resume:
        range_test = _range_test(run, scenes, fabric)
        config = run.config = _with_rate(config, range_test.suggestion)
    plan: SchedulePlan | None = None
    epochs = config.optimisation.epochs
    if shorten and creates_folder and limit.is_set:
        plan = plan_for_time(run, scenes, limit.left_s, fabric.world_size)
        config = run.config = plan.applied(config, recordings)
        scenes = reweighted(scenes, splits, config)
        if not initial:
            _fit_statistics(run, scenes)  # as every process finds them, and a run of this config
    if creates_folder:
        start_hash = weights_hash(run.average) if initial else ""
        files = {} if range_test is None else {RANGE_TEST_FILE: range_test.to_csv()}
        if plan is not None:
            files[PLAN_FILE] = plan.to_json()
        folder.start(config, splits.describe(), start_hash, files)
    if verbose:
        device, processes = fabric.device, fabric.world_size
        print(setting_text(run, scenes, splits, folder.path, device, processes), flush=True)
        if range_test is not None:
            print(
                f"rate       {config.optimisation.learning_rate:.3g} from a range test of "
                f"{len(range_test.rates)} steps, see {folder.path / RANGE_TEST_FILE}",
                flush=True,
            )
        if plan is not None and max_minutes is not None:
            print(plan_text(plan, epochs, max_minutes), flush=True)
    if not run.finished:
        with _quiet():
            fabric.launch()
        prepare_process(_threads(config))  # launching several processes sets torch's threads
        held = only_writer(folder.path) if run.is_global_zero else nullcontext()
        with held, Interruption() as interruption:
            _fit(
                fabric,
                run,
                scenes,
                folder,
                checkpoint["splits"] if checkpoint else all_recordings(splits.describe(), initial),
                checkpoint,
                interruption,
                limit,
                verbose,
                progress,
            )
    return run


def require_startable(
    config: TrainingConfig, folder: RunFolder, *, resume: bool, init_from: Path | None
) -> None:
    """Check what can be checked of a run before its recordings are read.

    Args:
        config: the configuration.
        folder: the run's folder.
        resume: continue the run in the folder.
        init_from: checkpoint whose weights to start from.

    Raises:
        ConfigurationError: network, folder or checkpoint cannot be used.
    """
    if resume:
        folder.require_run()
    elif _is_first_process():
        folder.require_new()
    network = build_network(config.network, config.model, config.history, config.scene)
    if init_from is not None:
        start_from(TrainingRun(network, config), load_checkpoint(init_from), init_from)


def _is_first_process() -> bool:
    """Return whether this process was not started to share a training with an earlier one."""
    names = ("RANK", "LOCAL_RANK", "NODE_RANK", "GROUP_RANK", "SLURM_PROCID")
    return all(os.environ.get(name, "0") == "0" for name in names)


def _range_test(run: TrainingRun, scenes: Scenes, fabric: Fabric) -> RangeTest:
    """Return the range test of a run.

    Raises:
        ConfigurationError: there are several processes, which could find different rates.
    """
    if fabric.world_size > 1:
        raise ConfigurationError(
            f"--find-lr is given with {fabric.world_size} processes, expected one: find the rate "
            "with --devices 1 and give it as optimisation.learning_rate"
        )
    return learning_rate_range_test(run, scenes, fabric.device)


def _with_rate(config: TrainingConfig, rate: float) -> TrainingConfig:
    """Return the configuration with another learning rate."""
    options = dataclasses.replace(config.optimisation, learning_rate=rate)
    return dataclasses.replace(config, optimisation=options)


def _fit(
    fabric: Fabric,
    run: TrainingRun,
    scenes: Scenes,
    folder: RunFolder,
    splits: list[dict[str, str]],
    checkpoint: Checkpoint | None,
    interruption: Interruption,
    limit: TimeLimit,
    verbose: bool,
    progress: bool,
) -> None:
    """Train the remaining epochs, validate after each, write checkpoints and the log."""
    config, options, state = run.config, run.config.optimisation, run.state
    rank, processes = fabric.global_rank, fabric.world_size
    optimiser = torch.optim.AdamW(
        run.model.parameters(), lr=options.learning_rate, weight_decay=options.weight_decay
    )
    with _quiet():
        loss_module, fabric_optimiser = fabric.setup(BatchLoss(run), optimiser)
    run.average.to(fabric.device)
    precision = fabric.strategy.precision
    if checkpoint:
        optimiser.load_state_dict(checkpoint["optimiser"])
        precision.load_state_dict(checkpoint["precision"])
    writer = SummaryWriter(str(folder.path / "tensorboard")) if run.is_global_zero else None
    clock = saved = time.monotonic()

    def count_time() -> None:
        nonlocal clock
        now = time.monotonic()
        state.epoch_seconds += now - clock
        clock = now

    def save(*, best: bool) -> None:
        nonlocal saved
        saved = time.monotonic()
        if writer is not None:
            save_checkpoint(
                run,
                folder,
                splits,
                optimiser=optimiser.state_dict(),
                precision=precision.state_dict(),
                best=best,
            )

    def validation_s() -> float:
        trial = TrainingRun(copy.deepcopy(run.average), config)
        return measure_validation(trial, scenes, time.monotonic) / processes

    def row() -> Row:
        return {
            "epoch": state.epoch + 1,
            "objective": run.loss_weights().name,
            "loss": state.mean_loss(),
            "learning_rate": optimiser.param_groups[0]["lr"],
            "steps": state.step,
            "skipped": state.skipped,
            "agents": int(state.agents),
            "seconds": round(state.epoch_seconds, 2),
        }

    def validated() -> tuple[Row, bool]:
        start_s = time.monotonic()
        scores, better = validate_epoch(run, scenes.validation, rank, processes)
        limit.count_validation(time.monotonic() - start_s)
        return row() | scores, better

    if verbose:
        print(title_line(), flush=True)
    first_step = state.step
    while not (run.finished or run.stopping):
        if limit.is_set and state.step > first_step:
            run.out_of_time = run.stopping = bool(fabric.broadcast(limit.is_up(validation_s)))
            if run.stopping:
                break
        _freeze(run.model, calibrated_parts(run.model) if run.calibrates else options.train_only)
        loader, steps = epoch_loader(scenes.training, config, state, rank, processes)
        title = f"epoch {state.epoch + 1}/{options.epochs} {run.loss_weights().name}"
        bar = tqdm(loader, title, steps, initial=state.batch, leave=False, disable=not progress)
        for batch in bar:
            stop = interruption.requested()
            run.received_signal = interruption.received_signal
            late = limit.is_up(validation_s)
            peak, first, epochs = options.learning_rate, 0, options.main_epochs
            if run.calibrates:
                first, epochs = options.main_epochs, options.calibration_epochs
                peak = options.calibration_learning_rate
            done = (state.epoch - first + state.batch / steps) / epochs
            for group in optimiser.param_groups:
                group["lr"] = learning_rate(
                    state.step,
                    done,
                    peak=peak,
                    schedule=options.learning_rate_schedule,
                    warmup_steps=options.warmup_steps,
                    floor=options.learning_rate_floor,
                )
            # Random numbers follow from seed, epoch and batch alone, so that a resumed run draws
            # the same ones. The factors are primes above any number of epochs and batches.
            torch.manual_seed((config.seed * 7919 + state.epoch) * 1_000_003 + state.batch)
            run.model.train()
            teacher_forcing = bool(torch.rand(()) < run.teacher_forcing_probability())

            batch = fabric.to_device(batch)
            loss = loss_module(batch, teacher_forcing)
            loss, mean_loss, agents, signalled, run.out_of_time = _share(
                fabric, loss, batch, stop, late, by_agent=run.averages_agents
            )
            run.stopping = signalled or run.out_of_time
            optimiser.zero_grad()
            fabric.backward(loss)
            norm = fabric.clip_gradients(
                loss_module, optimiser, max_norm=options.clip_norm, error_if_nonfinite=False
            )
            if norm is None or not bool(torch.isfinite(norm)):
                optimiser.zero_grad()  # a step without gradients moves nothing
                mean_loss = float("nan")
            fabric_optimiser.step()
            state.count_step(mean_loss, agents)
            run.update_average()

            count_time()
            if writer is not None and state.step % TENSORBOARD_STEPS == 0:
                writer.add_scalar("loss", state.mean_loss(), state.step)
                writer.add_scalar("learning_rate", optimiser.param_groups[0]["lr"], state.step)
            due = clock - saved > 60.0 * config.trainer.checkpoint_minutes
            if (due or run.stopping) and state.batch < steps:
                save(best=False)
            bar.set_postfix(loss=f"{state.mean_loss():.3f}", refresh=False)
            if run.stopping:
                break
        bar.close()
        if state.batch < steps:
            break

        number = state.epoch + 1
        if number == options.epochs or number % config.trainer.validate_every_epochs == 0:
            line, better = validated()
        else:
            line, better = row(), False
        count_time()
        state.finish_epoch(line)
        save(best=better)
        if writer is not None:
            for key, value in state.rows[-1].items():
                if isinstance(value, int | float):
                    writer.add_scalar(f"epoch/{key}", value, state.step)
            writer.flush()
        if verbose:
            print(epoch_line(state.rows[-1]), flush=True)
    complete = state.batch == 0 and bool(state.rows) and "all_ade" in state.rows[-1]
    if run.out_of_time and not complete:
        line, better = validated()
        count_time()
        line["total_seconds"] = round(state.total_seconds, 2)
        if run.is_global_zero:
            save_unfinished(run, folder, splits, line, best=better)
        if verbose:
            print(epoch_line(line), flush=True)
    if writer is not None:
        writer.close()


def _share(
    fabric: Fabric, loss: Tensor, batch: Batch, stop: bool, late: bool, *, by_agent: bool
) -> tuple[Tensor, float, float, bool, bool]:
    """Weight a process's loss so that the average over the processes is that of the whole batch.

    A loss is an average over agent-steps or, ``by_agent``, over observed agents, of which each
    process has a different number. The same message distributes the request to stop, so that all
    processes end after the same step.

    Returns:
        The weighted loss; the loss and the number of agents of the whole batch; whether any
        process asks to stop, and whether the time of any is up.
    """
    weight = observed_agents(batch.weight) if by_agent else batch.weight.sum()
    agents = batch.valid[:, -1].sum()
    if fabric.world_size == 1:
        return loss, float(loss.detach()), float(agents), stop, late
    total = fabric.all_reduce(
        torch.stack(
            [
                loss.detach() * weight,
                weight,
                agents,
                weight.new_tensor(stop),
                weight.new_tensor(late),
            ]
        ),
        reduce_op="sum",
    )
    assert isinstance(total, Tensor)
    whole = total[1].clamp(min=1e-6)
    loss = loss * (fabric.world_size * weight / whole)
    stopping, out_of_time = bool(total[3] > 0), bool(total[4] > 0)
    return loss, float(total[0] / whole), float(total[2]), stopping, out_of_time


def _fabric(config: TrainingConfig) -> Fabric:
    """Return Fabric for the configured devices.

    Raises:
        ConfigurationError: they are not available on this machine.
    """
    options = config.trainer
    strategy = options.strategy
    if options.devices != 1 or options.num_nodes > 1 or strategy == "ddp":
        # No covariance is computed in the first epochs, so its parameters get no gradient there.
        strategy = "ddp_find_unused_parameters_true"
    try:
        with _quiet():
            return Fabric(
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


def _require_own_processes(fabric: Fabric, config: TrainingConfig) -> None:
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


def _require_shares(processes: int, config: TrainingConfig, scenes: int) -> None:
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


def _threads(config: TrainingConfig) -> int:
    """Return the number of torch's threads; several processes on a CPU have one each."""
    options = config.trainer
    on_cpu = options.accelerator == "cpu" or (
        options.accelerator == "auto" and not torch.cuda.is_available()
    )
    return 1 if on_cpu and options.devices != 1 else config.num_threads


def calibrated_parts(model: nn.Module) -> list[str]:
    """Return those of :data:`CALIBRATED_PARTS` that a network has."""
    parts = {name.partition(".")[0] for name, _ in model.named_parameters()}
    return [part for part in CALIBRATED_PARTS if part in parts]


def _freeze(model: nn.Module, train_only: Sequence[str]) -> None:
    """Exclude all parameters from the training whose names have none of the prefixes.

    Raises:
        ConfigurationError: no parameter has a prefix.
    """
    names = [name for name, _ in model.named_parameters()]
    for prefix in train_only:
        if not any(name.startswith(f"{prefix}.") or name == prefix for name in names):
            parts = sorted({name.partition(".")[0] for name in names})
            raise ConfigurationError(
                f"optimisation.train_only names {prefix!r}, expected parts of the network: "
                + ", ".join(parts)
            )
    for name, parameter in model.named_parameters() if train_only else ():
        parameter.requires_grad_(
            any(name.startswith(f"{prefix}.") or name == prefix for prefix in train_only)
        )


def _fit_statistics(run: TrainingRun, scenes: Scenes) -> None:
    """Set the scales of the network's inputs from random scenes of the first epoch."""
    order = torch.Generator().manual_seed(run.config.seed)
    loader = DataLoader(scenes.training, STATISTICS_SCENES, shuffle=True, generator=order)
    fields = dense(next(iter(loader)))
    run.model.fit_statistics(fields["x"], fields["valid"])
    run.model.fit_futures(fields["x"], fields["valid"], fields["target"], fields["weight"])
    run.average.load_state_dict(run.model.state_dict())


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress Fabric's tips and notes; this package prints what matters."""
    logging.getLogger("lightning_fabric").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"lightning_fabric\.")
        yield
