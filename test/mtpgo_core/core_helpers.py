# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Short constructors of observations, and a TorchScript model with a known output."""

import warnings

import numpy as np
import torch

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import HistoryWindow, tracked_states
from mtpgo_core.task.task_description import TASK_FILE, SceneConfig, TaskDescription

S_NS = 1_000_000_000
MODES, HORIZON = 3, 5


class StraightModel(torch.nn.Module):
    """Constant velocity; mode m drifts by m * drift along the scene's x, weights 1:2:3.

    The covariance grows from P_0 (given, or the unit matrix) by k on the scene's y axis. An agent
    whose x velocity exceeds 60 m/s gets NaN, as a failing model would give.
    """

    def __init__(self, order: int, horizon: int, modes: int, dt_s: float):
        super().__init__()
        self.states = 2 * order
        self.horizon = horizon
        self.modes = modes
        self.dt_s = dt_s

    def forward(
        self,
        features: torch.Tensor,
        valid: torch.Tensor,
        static: torch.Tensor,
        initial_covariance: torch.Tensor | None = None,
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        b, n = features.shape[0], features.shape[1]
        now = features[:, :, -1]
        time = self.dt_s * torch.arange(1, self.horizon + 1, dtype=features.dtype)
        mode = torch.arange(self.modes, dtype=features.dtype)
        reach = now[:, :, None, 2:4] * time[None, None, :, None]
        path = now[:, :, None, 0:2] + reach
        mean = path[:, :, None].repeat(1, 1, self.modes, 1, 1)
        mean[..., 0] += mode[None, None, :, None] * time
        if self.states == 4:
            velocity = now[:, :, None, None, 2:4].repeat(1, 1, self.modes, self.horizon, 1)
            velocity[..., 0] += mode[None, None, :, None]
            mean = torch.cat([mean, velocity], dim=-1)
        bad = now[:, :, 2] > 60.0
        mean[bad] = float("nan")
        log_weight = torch.log((mode + 1.0) / (mode + 1.0).sum()).repeat(b, n, 1)
        first = torch.eye(self.states).repeat(b, n, 1, 1)
        if initial_covariance is not None:
            known = torch.isfinite(initial_covariance).all(-1).all(-1)
            first[known] = initial_covariance[known]
        covariance = first[:, :, None, None].repeat(1, 1, self.modes, self.horizon, 1, 1)
        covariance[..., 1, 1] += torch.arange(1, self.horizon + 1, dtype=features.dtype)
        return log_weight, mean, covariance


class TrailModel(torch.nn.Module):
    """Mode m goes where branch m of the trails does, in the scene's axes around its origin."""

    def __init__(self, horizon: int):
        super().__init__()
        self.horizon = horizon

    def forward(
        self,
        features: torch.Tensor,
        valid: torch.Tensor,
        static: torch.Tensor,
        initial_covariance: torch.Tensor | None = None,
        trails: torch.Tensor | None = None,
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        b, n = features.shape[0], features.shape[1]
        assert trails is not None
        mean = trails[..., :2]
        log_weight = torch.log(torch.tensor([0.5, 0.3, 0.2])).repeat(b, n, 1)
        covariance = torch.eye(2).repeat(b, n, 3, self.horizon, 1, 1)
        return log_weight, mean, covariance


def write_trail_model(path, **changes):
    """Write the trail model as a model file and return its task."""
    task = TaskDescription(
        name="trails",
        states=("x", "y"),
        horizon_steps=HORIZON,
        modes=3,
        scene=SceneConfig(frame="site_origin", trails=True),
        **changes,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        module = torch.jit.script(TrailModel(HORIZON))
    _save(module, path, task)
    return task


def _save(module, path, task):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.jit.save(module, str(path), _extra_files={TASK_FILE: task.to_json()})


def write_model(path, order=2, task=None, **changes):
    """Write the straight model as a model file and return its task."""
    names = ("x", "y", "vx", "vy")[: 2 * order]
    task = task or TaskDescription(
        name="straight", states=names, horizon_steps=HORIZON, modes=MODES, **changes
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        module = torch.jit.script(StraightModel(order, HORIZON, MODES, task.history.dt_s))
    _save(module, path, task)
    return task


def states_of(stamp_s, ids, position, frame="map", **more):
    """Return tracked states of integer ids; ``stamp_s`` in seconds."""
    position = np.asarray(position, dtype=float).reshape(-1, 2)
    more = {k: np.asarray(v) for k, v in more.items()}
    return tracked_states(round(stamp_s * S_NS), frame, keys_from_integers(ids), position, **more)


def window_of(position, velocity, yaw, valid=None, acceleration=None, size=None):
    """Return a window of the given arrays [n, T, ...], at time 0."""
    position = np.asarray(position, dtype=float)
    n, steps = position.shape[:2]
    valid = np.ones((n, steps), dtype=bool) if valid is None else np.asarray(valid)
    zero = np.zeros((n, steps, 2))

    def where_valid(value):
        value = np.array(value, dtype=float)
        value[~valid] = np.nan
        return value

    return HistoryWindow(
        stamp_ns=0,
        frame_id="map",
        key=keys_from_integers(range(n)),
        agent_class=np.zeros(n, dtype=np.uint8),
        z=np.zeros(n),
        size=np.full((n, 2), np.nan) if size is None else np.asarray(size, dtype=float),
        position=where_valid(position),
        velocity=where_valid(velocity),
        acceleration=where_valid(zero if acceleration is None else acceleration),
        yaw=where_valid(yaw),
        valid=valid,
        covariance=np.full((n, 4, 4), np.nan),
    )
