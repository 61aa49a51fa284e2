# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs an exported model: scenes in, predictions in the fixed frame out.

The TorchScript file contains everything that is needed (see
:mod:`mtpgo_core.task.task_description`), so the network's code is not imported. Its
``forward(features, valid, static, initial_covariance)``, with ``trails`` as a further argument if
the task has ``scene.trails``, returns log weights [B, N, M], means [B,
N, M, H, S] and covariances [B, N, M, H, S, S] in the scene frames.
"""

from __future__ import annotations

import dataclasses
import io
import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from mtpgo_core.errors import ModelFileError
from mtpgo_core.frames import rotate_covariance
from mtpgo_core.prediction.calibrated_prediction import calibrate, weight_temperatures
from mtpgo_core.prediction.constant_velocity import usable_covariances
from mtpgo_core.prediction.graph_check import faults
from mtpgo_core.prediction.output_assembly import ModelOutput, assemble, spread
from mtpgo_core.prediction.paths.forward_motion import without_reversing
from mtpgo_core.prediction.paths.path_smoothing import PathSmoother
from mtpgo_core.scene.trails.trail_branches import BRANCHES
from mtpgo_core.scene.trails.trail_context import COLUMNS
from mtpgo_core.schema import Float32Array, HistoryWindow, IndexArray, Prediction, SceneBatch
from mtpgo_core.task.calibration import Calibration
from mtpgo_core.task.model_file import ModelFile, find_model, is_shipped, load_task, read_model
from mtpgo_core.task.model_trial import try_out
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_core.task.torchscript import torchscript

__all__ = ["ModelRunner", "find_model", "load_task"]

_ROWS_AT_ONCE = 128
"""Most graphs x agents per call of the model, which needs some 0.35 MB for each (measured); larger
batches are split into several calls, at no cost in time."""

_PAIRS_AT_ONCE = 32_768
"""Most graphs x agents x agents per call: the attention needs some 4 kB for each (measured)."""


class ModelRunner:
    """A loaded model.

    Args:
        module: the TorchScript module.
        task: its task description.
        path: its file, for error messages.
        sha256: SHA-256 of the bytes that were loaded.

    Attributes:
        task: as above.
        path: as above.
        calibration: what is applied to the output, by default the task's; may be replaced.
        sha256: as above.
    """

    def __init__(
        self,
        module: torch.jit.ScriptModule,
        task: TaskDescription,
        path: Path,
        sha256: str = "",
    ) -> None:
        self._module = module
        self.task = task
        self.path = path
        self.calibration = task.calibration
        self.sha256 = sha256

    @classmethod
    def load(
        cls,
        path: str | Path,
        num_threads: int | None = 1,
        *,
        sha256: str = "",
        trusted: bool = False,
        stopped: Callable[[], bool] | None = None,
    ) -> ModelRunner:
        """Read a model file, which is checked before torch sees it, and load it.

        Args:
            path: the file.
            num_threads: see :meth:`load_file`.
            sha256: SHA-256 that the file must have, empty for any.
            trusted: see :meth:`load_file`.
            stopped: see :meth:`load_file`.

        Raises:
            ModelFileError: see :func:`mtpgo_core.task.model_file.read_model` and
                :meth:`load_file`.
        """
        file = read_model(path, sha256)
        return cls.load_file(file, num_threads, trusted=trusted, stopped=stopped)

    @classmethod
    def load_file(
        cls,
        file: ModelFile,
        num_threads: int | None = 1,
        *,
        trusted: bool = False,
        stopped: Callable[[], bool] | None = None,
    ) -> ModelRunner:
        """Load a model file that was read, and warm it up.

        It is tried in another process unless it is one of the package's own, and then loaded from
        the bytes that were checked.

        Args:
            file: the file.
            num_threads: threads of torch in this process; None keeps the present number.
            trusted: the file need not be tried: this program wrote it, or tried it already.
            stopped: whether this process shall end, which interrupts the trial.

        Raises:
            ModelFileError: see :func:`mtpgo_core.task.model_trial.try_out`, or the model does not
                compute what its task description says.
        """
        if not trusted and not is_shipped(file.path):
            try_out(file.archive, stopped)
        if num_threads is not None and torch.get_num_threads() != num_threads:
            torch.set_num_threads(num_threads)
        runner = cls.of(file)
        runner.warm_up()
        return runner

    def uncalibrated(self) -> ModelRunner:
        """Return the same model without its calibration."""
        runner = ModelRunner(self._module, self.task, self.path, self.sha256)
        runner.calibration = Calibration()
        return runner

    @classmethod
    def of(cls, file: ModelFile) -> ModelRunner:
        """Load a model file that was read and check its graph; nothing of ``forward`` runs.

        Raises:
            ModelFileError: torch cannot load it, or the graph does what a model may not do.
        """
        try:
            with torchscript():
                module = torch.jit.load(io.BytesIO(file.archive.data), map_location="cpu").eval()
            fault = next(faults(module), None)
        except Exception as error:  # torch raises whatever it likes on a foreign file
            raise ModelFileError(
                f"model file {file.path} is damaged, no TorchScript or of another version than"
                f" torch {torch.__version__}: {_first_line(error)}"
            ) from error
        if fault is not None:
            raise ModelFileError(f"model file {file.path} {fault}")
        return cls(module, file.task, file.path, file.archive.sha256)

    def warm_up(self, scenes: Sequence[int] = (8,)) -> None:
        """Run the model on standing agents, so that the first real call is as fast as later ones.

        Args:
            scenes: numbers of agents.

        Raises:
            ModelFileError: it fails, or its output has other shapes than the task description
                says, or numbers that are not finite.
        """
        for agents in scenes:
            self._try(agents)

    def _try(self, agents: int) -> None:
        """Run the model on standing agents and check its output."""
        task = self.task
        steps, modes, states = task.horizon_steps, task.modes, len(task.states)
        features = np.zeros((1, agents, task.history.steps, len(task.scene.features)), np.float32)
        features[0, :, :, 0] = 10.0 * np.arange(agents)[:, None]
        features[..., 6] = 1.0
        valid = np.ones(features.shape[:3], dtype=bool)
        static = np.zeros((1, agents, len(task.scene.static_features)), dtype=np.float32)
        expected = (
            (1, agents, modes),
            (1, agents, modes, steps, states),
            (1, agents, modes, steps, states, states),
        )
        trails = None
        if task.scene.trails:
            trails = np.zeros((1, agents, BRANCHES, steps, COLUMNS), dtype=np.float32)
        unknown = np.full((1, agents, states, states), np.nan, dtype=np.float32)
        for covariance in (None, unknown):
            try:
                output = self._forward(features, valid, static, covariance, trails)
                given = tuple(tuple(tensor.shape) for tensor in output)
                kinds = {tensor.dtype for tensor in output}
                finite = all(bool(torch.isfinite(tensor).all()) for tensor in output)
            except Exception as error:  # a model raises what it likes
                raise ModelFileError(
                    f"model file {self.path} does not run on the input that its task description "
                    f"asks for: {_first_line(error)}"
                ) from error
            if given != expected:
                raise ModelFileError(
                    f"model file {self.path} gives an output of shapes {given}, its task "
                    f"description says {expected}"
                )
            if kinds != {torch.float32}:
                raise ModelFileError(
                    f"model file {self.path} gives an output of {sorted(map(str, kinds))}, "
                    "expected float32"
                )
            if not finite:
                raise ModelFileError(
                    f"model file {self.path} gives an output that is not finite for a scene of "
                    f"standing agents ({agents}), expected numbers"
                )

    def predict(
        self,
        window: HistoryWindow,
        batch: SceneBatch,
        initial_covariance: bool = False,
        smoother: PathSmoother | None = None,
    ) -> Prediction:
        """Return the prediction of every agent of the window; arguments as :meth:`predict_served`.

        Rows of agents that are primary in no graph, or whose output is not usable, are NaN; the
        caller provides a fallback.
        """
        served, prediction = self.predict_served(window, batch, initial_covariance, smoother)
        return spread(prediction, served, window)

    def predict_served(
        self,
        window: HistoryWindow,
        batch: SceneBatch,
        initial_covariance: bool = False,
        smoother: PathSmoother | None = None,
    ) -> tuple[IndexArray, Prediction]:
        """Return the predictions of the primary agents of the scenes.

        Args:
            window: the window of the scenes.
            batch: the scenes, built with this task's configuration.
            initial_covariance: start from the tracker's covariances where the window has usable
                ones, instead of the model's own.
            smoother: of the paths from cycle to cycle, if any.

        Returns:
            Their positions in the window, ascending, and one row for each of them, in the fixed
            frame, modes sorted by descending weight, calibrated as ``calibration`` says; no moving
            vehicle reverses. Rows whose output is not usable are NaN.
        """
        covariance = self._tracked(window, batch) if initial_covariance else None
        pieces = [
            self._piece(batch, piece, covariance)
            for piece in _pieces(batch.valid.shape[0], batch.valid.shape[1])
        ]
        modes, steps, states = self.task.modes, self.task.horizon_steps, len(self.task.states)
        empty = (
            np.zeros((0, modes), np.float32),
            np.zeros((0, modes, steps, states), np.float32),
            np.zeros((0, modes, steps, 2, 2), np.float32),
        )
        joined = [np.concatenate(parts) for parts in zip(empty, *pieces, strict=True)]
        served = np.unique(batch.agent[batch.primary])
        own = window.select(served)
        place = np.searchsorted(served, batch.agent)
        prediction = assemble(
            own,
            dataclasses.replace(batch, agent=place),
            ModelOutput(*joined),
            self.task.history.dt_s,
            smoother,
            None if smoother is None else weight_temperatures(own, self.calibration),
            self.task.least_mode_spread,
        )
        calibrated = calibrate(prediction, self.calibration, own.velocity[:, -1])
        return served, without_reversing(calibrated, own)

    def _piece(
        self, batch: SceneBatch, piece: slice, covariance: Float32Array | None
    ) -> tuple[Float32Array, Float32Array, Float32Array]:
        """Return log weights, means and position covariances of some scenes' primary agents."""
        most = max(1, int((batch.agent[piece] >= 0).sum(axis=1).max(initial=0)))
        log_weight, mean, cov = self._forward(
            batch.features[piece, :most],
            batch.valid[piece, :most],
            batch.static[piece, :most],
            None if covariance is None else covariance[piece, :most],
            None if batch.trails is None else batch.trails[piece, :most],
        )
        # Whole rows are copied faster than a part of each.
        rows = torch.from_numpy(np.flatnonzero(batch.primary[piece, :most]))
        log_weights, means, covs = (
            x.flatten(0, 1).index_select(0, rows).numpy() for x in (log_weight, mean, cov)
        )
        return log_weights, means, covs[..., :2, :2]

    def _forward(
        self,
        features: Float32Array,
        valid: np.ndarray,
        static: Float32Array,
        covariance: Float32Array | None,
        trails: Float32Array | None,
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Call the module once, on the current thread.

        Torch's optimisation of the graph is disabled: it takes seconds during the second call
        and saves nothing measurable afterwards.
        """
        given = [features, valid, static, covariance]
        if trails is not None:
            given.append(trails)
        with torch.inference_mode(), torch.jit.optimized_execution(False):
            log_weight, mean, cov = self._module(
                *(None if a is None else torch.from_numpy(np.ascontiguousarray(a)) for a in given)
            )
        return log_weight, mean, cov

    def _tracked(self, window: HistoryWindow, batch: SceneBatch) -> Float32Array:
        """Return tracker covariances [B, N, S, S] in the scene frames, NaN where unusable."""
        states = len(self.task.states)
        usable = usable_covariances(window.covariance[:, :states, :states])
        turned = rotate_covariance(usable[batch.agent], -batch.rotation[:, None])
        return turned.astype(np.float32)


def _pieces(graphs: int, agents: int) -> list[slice]:
    """Return ranges of graphs of about equal length, one per call of the model."""
    rows = max(1, agents)
    at_once = max(1, min(_ROWS_AT_ONCE // rows, _PAIRS_AT_ONCE // (rows * rows)))
    calls = -(-graphs // at_once)
    bounds = [graphs * call // max(1, calls) for call in range(calls + 1)]
    return [slice(first, last) for first, last in itertools.pairwise(bounds)]


def _first_line(error: Exception) -> str:
    """Return the line of a torch error that names the cause; the rest is a C++ stack."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    picked = next((x for x in reversed(lines) if "Error" in x), lines[0] if lines else "")
    return picked[:200] or type(error).__name__
