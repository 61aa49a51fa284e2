# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From a history window to predictions: scenes, model and fallback.

The node and the offline evaluation run this code on the windows of a
:class:`~mtpgo_core.history.track_history.TrackHistory`. Every agent present at the common time is
predicted in every cycle: by the model or, where the model gives no usable output, at constant
velocity. Each prediction states its source.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mtpgo_core.history.nearest_tracks import centre_of, nearest
from mtpgo_core.history.track_index import find_sort_keys, sort_keys
from mtpgo_core.options import check_options, option
from mtpgo_core.prediction.agent_limit import AgentLimit
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.output_assembly import replace_rows, select, with_heaviest_modes
from mtpgo_core.prediction.paths.path_smoothing import LONGEST_MEMORY_S, PathSmoother
from mtpgo_core.scene.graph_selection import GraphState
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.scene.trails.trail_context import TrailContext
from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_core.schema import BoolArray, HistoryWindow, KeyArray, Prediction
from mtpgo_core.task.task_description import GRAPH_POLICIES, SceneConfig, TaskDescription

if TYPE_CHECKING:
    from mtpgo_core.prediction.model_runner import ModelRunner


@dataclass(frozen=True)
class PredictorOptions:
    """Settings that may differ from the model's task and change while running.

    Attributes:
        policy: graph policy, None for the task's.
        max_neighbours: agents of a graph besides its centre, None for the task's.
        radius_m: radius of a graph (m), None for the task's.
        max_agents: most agents that the model predicts, those nearest to the ego or, without an
            ego, to the median position; the others are predicted at constant velocity and are seen
            by the model as neighbours of those.
        max_points: most agents x modes x steps of a prediction; with more, the heaviest modes of
            every agent are kept, at least one.
        use_tracker_covariance: start from the tracker's covariance where there is one.
        path_smoothing_s: memory of the farthest predicted points over the cycles (s), 0 for none.
        trails: let models with ``scene.trails`` see where earlier road users went; without, they
            are told that none has been there.
    """

    policy: str | None = option(None, choices=GRAPH_POLICIES)
    max_neighbours: int | None = option(None, low=0)
    radius_m: float | None = option(None, above=0.0)
    max_agents: int = option(128, low=0)
    max_points: int = option(1 << 40, low=1)
    use_tracker_covariance: bool = False
    path_smoothing_s: float = option(0.0, low=0.0, high=LONGEST_MEMORY_S)
    trails: bool = True

    def __post_init__(self) -> None:
        check_options(self)


@dataclass(frozen=True)
class PredictionReport:
    """Statistics of one prediction.

    Attributes:
        agents: agents predicted.
        by_model: of these, predicted by the model.
        over_limit: predicted at constant velocity because of ``max_agents`` or the time limit.
        agent_limit: most agents that the model predicts in time, None for any number.
        modes: modes of every agent, fewer than the model's because of ``max_points``.
        unusable: predicted at constant velocity because the model's output was not usable.
        graphs: graphs in the model's input.
        largest_graph: agents in the largest of them.
    """

    agents: int = 0
    by_model: int = 0
    over_limit: int = 0
    agent_limit: int | None = None
    modes: int = 0
    unusable: int = 0
    graphs: int = 0
    largest_graph: int = 0


class ScenePredictor:
    """Predicts the agents of history windows.

    It keeps the graphs of the last cycle, so that agents stay in theirs from cycle to cycle, the
    paths of the last cycle, so that they do not jump, and, for tasks with ``scene.trails``, a
    memory of where the road users of all windows went.
    ``fallback`` uses no state and may be called from any thread.

    Args:
        runner: the model, None for constant velocity only.
        options: deviations from the task.
        task: the task without a runner; with one, the runner's task is used.
        lanes: lane lines in the fixed frame, for models whose context is ``lanes``.
        site: name of the site, for models with an origin for each of several sites.

    Raises:
        ConfigurationError: the model has origins by site, and none for this one.

    Attributes:
        options: may be replaced at any time; takes effect with the next prediction.
        lanes: may be replaced at any time; takes effect with the next prediction.
        allowed_s: time for the model (s); if it takes longer, it gets fewer agents the next time.
            None: it gets all, whatever time it takes.
        task: the task in effect.
        last_report: report on the last prediction.
    """

    def __init__(
        self,
        runner: ModelRunner | None,
        *,
        options: PredictorOptions = PredictorOptions(),
        task: TaskDescription | None = None,
        lanes: LaneMap | None = None,
        site: str | None = None,
    ) -> None:
        self._runner = runner
        self.task = runner.task if runner is not None else task or TaskDescription()
        self.task = dataclasses.replace(self.task, scene=self.task.scene.at_site(site))
        self.options = options
        self.lanes = lanes
        self.allowed_s: float | None = None
        self.last_report = PredictionReport()
        self._limit = AgentLimit()
        self._graphs = GraphState()
        self._graphs_ns: int | None = None
        self._trails = self._no_trails()
        self._smoother: PathSmoother | None = None

    @property
    def modes(self) -> int:
        """Number of modes M of a prediction: the model's, or 1 without a model."""
        return self.task.modes if self._runner is not None else 1

    def reset(self) -> None:
        """Forget graphs, trails and paths, for example after a jump of the clock; any thread."""
        self._graphs, self._trails = GraphState(), self._no_trails()
        self._smoother = None

    def _no_trails(self) -> TrailMemory:
        """Return an empty memory of trails, preallocated if the model uses trails."""
        return TrailMemory(reserved=self._runner is not None and self.task.scene.trails)

    def continue_from(self, other: ScenePredictor) -> None:
        """Take over options, lanes, graphs and trails of a predictor of the same history."""
        self.options, self.lanes = other.options, other.lanes
        self.last_report = other.last_report
        self._graphs, self._graphs_ns = other._graphs, other._graphs_ns
        self._trails = other._trails

    def fallback(self, window: HistoryWindow) -> Prediction:
        """Return constant velocity for every agent present at the window's time; any thread."""
        return self._constant(window.select(window.valid[:, -1]))

    def predict(self, window: HistoryWindow, *, ego_key: KeyArray | None = None) -> Prediction:
        """Return the prediction of every agent present at the window's time.

        Under load the model predicts fewer agents, the nearest to the ego or the middle first, and
        fewer modes are returned; see ``allowed_s`` and ``PredictorOptions.max_points``.

        Args:
            window: see :meth:`~mtpgo_core.history.track_history.TrackHistory.window`.
            ego_key: [4] the ego's identity, for the policy ``ego`` and for ``max_agents``.

        Returns:
            One row for each agent present, in the order of the window.

        Raises:
            ConfigurationError: the model's context is ``lanes`` and there are no lane lines.
        """
        begun_s = time.perf_counter()
        trails = self._observe_trails(window)
        present = window.select(window.valid[:, -1])
        n, modes = len(present), self._kept_modes(len(present))
        if self._runner is None or n == 0:
            self.last_report = PredictionReport(agents=n, modes=modes)
            return self._constant(present)
        options, state = self.options, self._graph_state(present.stamp_ns)
        wanted = min(n, options.max_agents)
        most = wanted if self._limit.agents is None else min(wanted, self._limit.agents)
        selected = self._select_agents(present, most, ego_key, state)
        if not selected.any():
            self.last_report = PredictionReport(agents=n, over_limit=n, modes=modes)
            return self._constant(present)
        here = window.valid[:, -1]
        seen, served = present, selected
        if self.task.scene.departed_agents:
            seen, served = window, here.copy()
            served[here] = selected
        batch = build_scenes(
            seen,
            self._scene(options),
            ego_key=ego_key,
            previous=state,
            served=served,
            lanes=self.lanes,
            trails=trails,
        )
        predicted, modelled = self._runner.predict_served(
            seen, batch, options.use_tracker_covariance, self._path_smoother(options)
        )
        if seen is window:
            predicted = np.searchsorted(np.flatnonzero(here), predicted)
        usable = np.asarray(np.isfinite(modelled.weight).all(axis=1))
        if self.allowed_s is not None:
            took_s = time.perf_counter() - begun_s
            self._limit.add(most, wanted, took_s, self.allowed_s)
        self.last_report = PredictionReport(
            agents=n,
            by_model=int(usable.sum()),
            over_limit=n - most,
            agent_limit=self._limit.agents,
            modes=modes,
            unusable=int((~usable).sum()),
            graphs=batch.valid.shape[0],
            largest_graph=int((batch.agent >= 0).sum(axis=1).max(initial=0)),
        )
        modelled = with_heaviest_modes(modelled, modes)
        if len(predicted) == n and usable.all():
            return modelled
        return replace_rows(self._constant(present), predicted[usable], select(modelled, usable))

    def observe(self, window: HistoryWindow) -> None:
        """Remember where the road users of a window went, without a prediction.

        For callers whose predictions are farther apart than the history is long: without it they
        would miss what lies between two windows, as the node does at a rate below 0.3 Hz.
        """
        self._observe_trails(window)

    def _observe_trails(self, window: HistoryWindow) -> TrailContext | None:
        """Add a window, of all agents, to the memory of trails, if the task has one."""
        if not self.task.scene.trails:
            return None
        memory, dt_s = self._trails, self.task.history.dt_s
        memory.add(window, dt_s)
        since_ns = None if self.options.trails else window.stamp_ns + 1
        return TrailContext(memory, self.task.horizon_steps, dt_s, since_ns)

    def _path_smoother(self, options: PredictorOptions) -> PathSmoother | None:
        """Return the smoother with the paths of the last cycle, None if there is no smoothing."""
        tau_s = options.path_smoothing_s
        if not tau_s:
            self._smoother = None
        elif self._smoother is None or self._smoother.tau_s != tau_s:
            self._smoother = PathSmoother(tau_s)
        return self._smoother

    def _graph_state(self, stamp_ns: int) -> GraphState:
        """Return the graphs of the last cycle, unless they are older than the history.

        Identities may be reused after a pause, and the predictions of a stream must not depend on
        an earlier stream.
        """
        span_ns = round(self.task.history.steps * self.task.history.dt_s * 1e9)
        if self._graphs_ns is not None and abs(stamp_ns - self._graphs_ns) > span_ns:
            self._graphs = GraphState()
        self._graphs_ns = stamp_ns
        return self._graphs

    def _scene(self, options: PredictorOptions) -> SceneConfig:
        """Return the task's scene configuration with the options applied."""
        scene = self.task.scene
        policy = options.policy or scene.policy
        radius_m = options.radius_m or scene.radius_m
        neighbours = options.max_neighbours
        if neighbours is None:
            neighbours = scene.max_neighbours
        if (policy, neighbours, radius_m) == (scene.policy, scene.max_neighbours, scene.radius_m):
            return scene  # making a configuration checks all of its options
        return dataclasses.replace(
            scene, policy=policy, max_neighbours=neighbours, radius_m=radius_m
        )

    def _constant(self, present: HistoryWindow) -> Prediction:
        return predict_constant_velocity(
            present,
            horizon_steps=self.task.horizon_steps,
            dt_s=self.task.history.dt_s,
            modes=self._kept_modes(len(present)),
        )

    def _kept_modes(self, agents: int) -> int:
        """Return the most modes with which this number of agents stays within ``max_points``."""
        points = max(1, agents) * self.task.horizon_steps
        return max(1, min(self.modes, self.options.max_points // points))

    @staticmethod
    def _select_agents(
        present: HistoryWindow, max_agents: int, ego_key: KeyArray | None, state: GraphState
    ) -> BoolArray:
        """Return [n] the agents that the model predicts: the nearest, with hysteresis."""
        if len(present) <= max_agents:
            return np.ones(len(present), dtype=bool)
        position, keys = present.position[:, -1], sort_keys(present.key)
        kept = find_sort_keys(state.agent, keys) >= 0
        return nearest(position, centre_of(position, keys, ego_key), max_agents, kept)
