# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The live calibration of a configured node, and the file in which it survives. No ROS in here."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mtpgo_core.errors import ConfigurationError, reason_of
from mtpgo_core.history.stream_guard import UpdateReport
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.live_calibration.calibration_file import restore, save
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import BEST
from mtpgo_core.live_calibration.path_equations import KINDS
from mtpgo_core.quality.metrics import TIMES_S
from mtpgo_core.schema import HistoryWindow, Prediction, Source
from mtpgo_core.task.calibration import GROUPS
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_core.whole_file import user_path
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

_SAVE_EVERY_S = 30.0
"""Time between two writings of the file (s); chosen: what is lost in a crash is learned again in
that time."""

_FileState = tuple[int, int]
"""What tells one writing of a file from another: its inode, and when it was written (ns)."""


class LiveCalibrator:
    """Corrects predictions while the node runs, and keeps what was learned in a file.

    Args:
        parameters: the options, and the file.
        task: of the model.
        keeps_file: the file is used; not without a model, whose factors it has.

    Attributes:
        parameters: as given, or as configured since.
        live: the calibration.
        file_error: why the file was not used or not written when that was tried last, or that
            another process writes it as well; empty if all is well.
    """

    def __init__(
        self,
        parameters: PredictorParameters,
        task: TaskDescription,
        *,
        keeps_file: bool = True,
    ) -> None:
        self.parameters, self._task = parameters, task
        self.live = LiveCalibration(parameters.live_options, task.history, task.horizon_steps)
        self.file_error = ""
        self._path: Path | None = None
        self._restored = False
        self._seen: _FileState | None = None
        self._saved_s = time.monotonic()
        self._writer: threading.Thread | None = None
        if keeps_file and parameters.calibration_file and self.live.options.watches:
            self._path = user_path(parameters.calibration_file)
            try:
                self._restored = restore(self.live, task.weights_sha256, self._path)
            except ConfigurationError as error:
                self.file_error = f"{error}; the shipped calibration is used"
            self.look_at_file()

    def look_at_file(self) -> None:
        """Accept the present state of the file as written by this calibrator."""
        if self._path is not None:
            self._seen = _state_of(self._path)

    def configure(self, parameters: PredictorParameters) -> None:
        """Use other parameters from the next observation on."""
        self.parameters = parameters
        self.live.configure(parameters.live_options)

    def serve(self, prediction: Prediction, window: HistoryWindow) -> Prediction:
        """Return the prediction to publish; any thread."""
        return self.live.serve(prediction, window)

    def observe(self, history: TrackHistory, report: UpdateReport) -> None:
        """Learn from the last observation, and write the file from time to time."""
        self.live.observe(history, report)
        now_s = time.monotonic()
        if self._path is None or now_s - self._saved_s < _SAVE_EVERY_S:
            return
        self._saved_s = now_s
        if self._writer is None or not self._writer.is_alive():
            # A slow disk must not delay the observations.
            self._writer = threading.Thread(target=self._save, name="calibration file")
            self._writer.start()

    def close(self) -> None:
        """Write the file."""
        if self._writer is not None:
            self._writer.join()
        if self._path is not None:
            self._save()

    def _save(self) -> None:
        assert self._path is not None
        found = _state_of(self._path)
        try:
            save(self.live, self._task.weights_sha256, self._path)
        except ConfigurationError as error:
            self.file_error = str(error)
            return
        except OSError as error:
            self.file_error = (
                f"calibration file {self._path} cannot be written: {reason_of(error)}"
            )
            return
        foreign = found is not None and found != self._seen
        self.file_error = (
            f"calibration file {self._path} was written by another process as well, expected one"
            " file for each node"
            if foreign
            else ""
        )
        self.look_at_file()

    @property
    def preferred(self) -> list[str]:
        """Groups that constant velocity serves because it has been better."""
        if self.live.options.prefer != BEST:
            return []  # A file may know of some from another time.
        chosen = self.live.preference.constant_velocity
        return [name for name, preferred in zip(GROUPS, chosen, strict=True) if preferred]

    def values(self) -> dict[str, str]:
        """Return the values of the diagnostics: for groups with outcomes, factors on sigma."""
        live, options = self.live, self.live.options
        values = {
            "calibration": options.calibration,
            "correct_paths": str(options.correct_paths).lower(),
            "prefer": options.prefer,
            "calibration_file": str(self._path or ""),
            "restored": str(self._restored).lower(),
            "times_s": " ".join(map(str, TIMES_S)),
        }
        tracker = live.tracker
        agents, sigma = tracker.agents, np.exp(tracker.log_sigma)
        steps = [
            min(max(0, round(time_s / self._task.history.dt_s) - 1), sigma.shape[-1] - 1)
            for time_s in TIMES_S
        ]
        for group, name in enumerate(GROUPS):
            if options.learns_factors and (agents[group] > 0.0).any():
                values[f"agents_{name}"] = f"{agents[group].max():.1f}"
                for source in (Source.MODEL, Source.CONSTANT_VELOCITY):
                    for level, percent in enumerate((50, 90)):
                        factors = sigma[source, level, group, steps]
                        key = f"{source.name.lower()}_sigma_{percent}_{name}"
                        values[key] = " ".join(f"{factor:.3f}" for factor in factors)
            error_m = live.preference.error_m[group]
            if np.isfinite(error_m).all():
                served = live.preference.constant_velocity[group]
                values[f"error_m_model_and_cv_{name}"] = f"{error_m[0]:.3f} {error_m[1]:.3f}"
                values[f"served_by_{name}"] = "constant velocity" if served else "model"
        if options.learns_paths:
            values |= self._path_values(steps)
        return values

    def _path_values(self, steps: Sequence[int]) -> dict[str, str]:
        """Return the shares of the path correction that are applied, by class and direction.

        Args:
            steps: horizon steps for which they are given.
        """
        values = {}
        belief = self.live.paths.equations.fit.belief
        for kind, name in enumerate(KINDS):
            for axis, direction in enumerate(("along", "across")):
                if belief[kind, axis].any():
                    shares = belief[kind, axis, steps]
                    values[f"path_{direction}_{name}"] = " ".join(f"{s:.2f}" for s in shares)
        return values


def _state_of(path: Path) -> _FileState | None:
    """Return which writing of a file there is, None without a file."""
    try:
        about = os.stat(path)
    except (OSError, ValueError):
        return None
    return about.st_ino, about.st_mtime_ns
