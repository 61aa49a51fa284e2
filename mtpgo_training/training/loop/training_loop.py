# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The epochs of a training, on Lightning Fabric for devices, processes and precision."""

from __future__ import annotations

import copy
import time

import torch
from lightning_fabric import Fabric
from torch import Tensor
from torch.utils.tensorboard import SummaryWriter
from torch_geometric.data import Batch
from tqdm import tqdm

from mtpgo_core.quality.metrics import headline_time_s
from mtpgo_training.training.checkpointing import (
    restore_optimiser,
    save_checkpoint,
    save_unfinished,
)
from mtpgo_training.training.console import epoch_line, title_line
from mtpgo_training.training.data_loading import Scenes, epoch_loader
from mtpgo_training.training.interruption import Interruption
from mtpgo_training.training.loop.device_setup import quiet_fabric
from mtpgo_training.training.loop.trained_parts import calibrated_parts, train_only
from mtpgo_training.training.losses.ewta_loss import observed_agents
from mtpgo_training.training.losses.schedules import learning_rate
from mtpgo_training.training.run_folder import Checkpoint, RunFolder
from mtpgo_training.training.run_loss import BatchLoss
from mtpgo_training.training.run_state import Row, TrainingRun
from mtpgo_training.training.trial.epoch_cost import measure_validation
from mtpgo_training.training.trial.time_limit import TimeLimit
from mtpgo_training.training.validation import validate_epoch

TENSORBOARD_STEPS = 10
"""Steps between two points of the loss in TensorBoard (chosen: small files)."""


class TrainingLoop:
    """Trains the remaining epochs, validates after each, writes checkpoints and the log.

    Args:
        fabric: the devices, launched.
        run: the run; it is changed.
        scenes: what it is trained and validated on.
        folder: the run's folder.
        splits: the recordings of this run and of those that it began with.
        checkpoint: where the run is resumed, what it had then.
        interruption: says when to end.
        limit: of the time.
        verbose: print a line per epoch.
        progress: show progress bars.
    """

    def __init__(
        self,
        fabric: Fabric,
        run: TrainingRun,
        scenes: Scenes,
        folder: RunFolder,
        *,
        splits: list[dict[str, str]],
        checkpoint: Checkpoint | None,
        interruption: Interruption,
        limit: TimeLimit,
        verbose: bool,
        progress: bool,
    ) -> None:
        self._fabric, self._run, self._scenes, self._folder = fabric, run, scenes, folder
        self._splits, self._interruption, self._limit = splits, interruption, limit
        self._verbose, self._progress = verbose, progress
        options = run.config.optimisation
        self._optimiser = torch.optim.AdamW(
            run.model.parameters(), lr=options.learning_rate, weight_decay=options.weight_decay
        )
        with quiet_fabric():
            self._loss, self._fabric_optimiser = fabric.setup(BatchLoss(run), self._optimiser)
        run.average.to(fabric.device)
        self._precision = fabric.strategy.precision
        if checkpoint:
            restore_optimiser(self._optimiser, self._precision, checkpoint, folder.last)
        self._writer: SummaryWriter | None = None
        self._clock_s = self._saved_s = 0.0
        self._headline_s = headline_time_s(run.model.config.horizon_steps, run.model.config.dt_s)

    def fit(self) -> None:
        """Train until the run is finished, or is to stop after the current step."""
        run, state = self._run, self._run.state
        if run.is_global_zero:
            self._writer = SummaryWriter(str(self._folder.path / "tensorboard"))
        self._clock_s = self._saved_s = time.monotonic()
        if self._verbose:
            print(title_line(self._headline_s), flush=True)
        first_step = state.step
        while not (run.finished or run.stopping):
            if self._limit.is_set and state.step > first_step:
                is_up = self._limit.is_up(self._validation_s)
                run.out_of_time = run.stopping = bool(self._fabric.broadcast(is_up))
                if run.stopping:
                    break
            if not self._train_epoch():
                break
            self._finish_epoch()
        complete = state.batch == 0 and bool(state.rows) and "all_ade" in state.rows[-1]
        if run.out_of_time and not complete:
            self._finish_unfinished_epoch()
        if self._writer is not None:
            self._writer.close()

    def _train_epoch(self) -> bool:
        """Do the remaining steps of the current epoch; return whether all of them are done."""
        run, state, config = self._run, self._run.state, self._run.config
        options, fabric = config.optimisation, self._fabric
        trained = calibrated_parts(run.model) if run.calibrates else options.train_only
        train_only(run.model, trained)
        loader, steps = epoch_loader(
            self._scenes.training, run, fabric.global_rank, fabric.world_size
        )
        title = f"epoch {state.epoch + 1}/{options.epochs} {run.loss_weights().name}"
        bar = tqdm(
            loader, title, steps, initial=state.batch, leave=False, disable=not self._progress
        )
        for batch in bar:
            self._step(batch, steps)
            due = self._clock_s - self._saved_s > 60.0 * config.trainer.checkpoint_minutes
            if (due or run.stopping) and state.batch < steps:
                self._save(best=False)
            bar.set_postfix(loss=f"{state.mean_loss():.3f}", refresh=False)
            if run.stopping:
                break
        bar.close()
        return state.batch >= steps

    def _step(self, batch: Batch, steps: int) -> None:
        """Do one step of an epoch of ``steps``."""
        run, state, fabric = self._run, self._run.state, self._fabric
        stop = self._interruption.requested()
        run.received_signal = self._interruption.received_signal
        late = self._limit.is_up(self._validation_s)
        self._set_learning_rate(steps)
        # Random numbers follow from seed, epoch and batch alone, so that a resumed run draws
        # the same ones. The factors are primes above any number of epochs and batches.
        torch.manual_seed((run.config.seed * 7919 + state.epoch) * 1_000_003 + state.batch)
        run.model.train()
        teacher_forcing = bool(torch.rand(()) < run.teacher_forcing_probability())

        batch = fabric.to_device(batch)
        loss = self._loss(batch, teacher_forcing)
        loss, mean_loss, agents, signalled, run.out_of_time = _share(
            fabric, loss, batch, stop=stop, late=late, by_agent=run.averages_agents
        )
        run.stopping = signalled or run.out_of_time
        self._optimiser.zero_grad()
        fabric.backward(loss)
        norm = fabric.clip_gradients(
            self._loss,
            self._optimiser,
            max_norm=run.config.optimisation.clip_norm,
            error_if_nonfinite=False,
        )
        if norm is None or not bool(torch.isfinite(norm)):
            self._optimiser.zero_grad()  # a step without gradients moves nothing
            mean_loss = float("nan")
        self._fabric_optimiser.step()
        state.count_step(mean_loss, agents)
        run.update_average()

        self._count_time()
        if self._writer is not None and state.step % TENSORBOARD_STEPS == 0:
            self._writer.add_scalar("loss", state.mean_loss(), state.step)
            self._writer.add_scalar("learning_rate", self._learning_rate(), state.step)

    def _set_learning_rate(self, steps: int) -> None:
        """Set the learning rate of the next step of an epoch of ``steps``."""
        run, state, options = self._run, self._run.state, self._run.config.optimisation
        peak, first, epochs = options.learning_rate, 0, options.main_epochs
        if run.calibrates:
            first, epochs = options.main_epochs, options.calibration_epochs
            peak = options.calibration_learning_rate
        done = (state.epoch - first + state.batch / steps) / epochs
        for group in self._optimiser.param_groups:
            group["lr"] = learning_rate(
                state.step,
                done,
                peak=peak,
                schedule=options.learning_rate_schedule,
                warmup_steps=options.warmup_steps,
                floor=options.learning_rate_floor,
            )

    def _learning_rate(self) -> float:
        return float(self._optimiser.param_groups[0]["lr"])

    def _finish_epoch(self) -> None:
        """Validate where that is due, and keep the weights and the row of the epoch."""
        run, state = self._run, self._run.state
        number, every = state.epoch + 1, run.config.trainer.validate_every_epochs
        if number == run.config.optimisation.epochs or number % every == 0:
            row, better = self._validated()
        else:
            row, better = self._row(), False
        self._count_time()
        state.finish_epoch(row)
        self._save(best=better)
        if self._writer is not None:
            for key, value in state.rows[-1].items():
                if isinstance(value, int | float):
                    self._writer.add_scalar(f"epoch/{key}", value, state.step)
            self._writer.flush()
        if self._verbose:
            print(epoch_line(state.rows[-1], self._headline_s), flush=True)

    def _finish_unfinished_epoch(self) -> None:
        """Validate and keep the weights of an epoch for which the time was too short."""
        row, better = self._validated()
        self._count_time()
        row["total_seconds"] = round(self._run.state.total_seconds, 2)
        if self._run.is_global_zero:
            save_unfinished(self._run, self._folder, self._splits, row, best=better)
        if self._verbose:
            print(epoch_line(row, self._headline_s), flush=True)

    def _row(self) -> Row:
        """Return the line of the log for the current epoch, without scores."""
        state = self._run.state
        return {
            "epoch": state.epoch + 1,
            "objective": self._run.loss_weights().name,
            "loss": state.mean_loss(),
            "learning_rate": self._learning_rate(),
            "steps": state.step,
            "skipped": state.skipped,
            "agents": int(state.agents),
            "seconds": round(state.epoch_seconds, 2),
        }

    def _validated(self) -> tuple[Row, bool]:
        """Return the line of the log with scores, and whether they are the best so far."""
        start_s = time.monotonic()
        scores, better = validate_epoch(
            self._run, self._scenes.validation, self._fabric.global_rank, self._fabric.world_size
        )
        self._limit.count_validation(time.monotonic() - start_s)
        return self._row() | scores, better

    def _validation_s(self) -> float:
        """Return how long a validation takes (s), measured on some scenes."""
        trial = TrainingRun(copy.deepcopy(self._run.average), self._run.config)
        return measure_validation(trial, self._scenes, time.monotonic) / self._fabric.world_size

    def _count_time(self) -> None:
        now_s = time.monotonic()
        self._run.state.epoch_seconds += now_s - self._clock_s
        self._clock_s = now_s

    def _save(self, *, best: bool) -> None:
        self._saved_s = time.monotonic()
        if self._run.is_global_zero:
            save_checkpoint(
                self._run,
                self._folder,
                self._splits,
                optimiser=self._optimiser.state_dict(),
                precision=self._precision.state_dict(),
                best=best,
            )


def _share(
    fabric: Fabric, loss: Tensor, batch: Batch, *, stop: bool, late: bool, by_agent: bool
) -> tuple[Tensor, float, float, bool, bool]:
    """Weight a process's loss so that the average over the processes is that of the whole batch.

    Each process has a different number of agents. The same message distributes the request to
    stop, so that all processes end after the same step.

    Args:
        fabric: of the processes.
        loss: of this process's part of the batch.
        batch: that part.
        stop: this process was asked to stop.
        late: its time is up.
        by_agent: the loss is an average over observed agents, else over agent-steps.

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
