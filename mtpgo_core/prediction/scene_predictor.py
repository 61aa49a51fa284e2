# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From a history window to predictions: scenes, model and fallback.

The node and the offline evaluation run this code on the windows of a
:class:`~mtpgo_core.history.track_history.TrackHistory`. Every agent present at the common time is
predicted in every cycle: by the model or, where the model cannot serve, at constant velocity. The
source of each prediction is part of it.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mtpgo_core.history.track_index import find_names, names_of
from mtpgo_core.options import check_options, option
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.output_assembly import merge, select
from mtpgo_core.scene.graph_selection import GraphState
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.schema import BoolArray, HistoryWindow, KeyArray, Prediction
from mtpgo_core.task.task_description import GRAPH_POLICIES, SceneConfig, TaskDescription

if TYPE_CHECKING:
    from mtpgo_core.prediction.model_runner import ModelRunner

_KEEP = 0.8
"""An agent served by the model counts as this much nearer when the places are few, so that two at
the limit do not take turns."""


@dataclass(frozen=True)
class PredictorOptions:
    """What may differ from the model's task, and change while running.

    Attributes:
        policy: graph policy, None for the task's.
        max_neighbours: agents of a graph beside its centre, None for the task's.
        radius_m: radius of a graph (m), None for the task's.
        max_agents: so many agents are served by the model, those nearest to the ego or, without
            one, to the middle of all; the others at constant velocity.
        use_tracker_covariance: start from the tracker's covariance where it gives one.
    """

    policy: str | None = option(None, choices=GRAPH_POLICIES)
    max_neighbours: int | None = option(None, low=0)
    radius_m: float | None = option(None, above=0.0)
    max_agents: int = option(128, low=0)
    use_tracker_covariance: bool = False

    def __post_init__(self) -> None:
        check_options(self)


@dataclass(frozen=True)
class PredictionReport:
    """How the last prediction came about.

    Attributes:
        agents: agents predicted.
        by_model: of these, by the model.
        over_limit: at constant velocity because of ``max_agents``.
        unusable: at constant velocity because the model's numbers could not be used.
        graphs: graphs given to the model.
        largest_graph: agents in the largest of them.
    """

    agents: int = 0
    by_model: int = 0
    over_limit: int = 0
    unusable: int = 0
    graphs: int = 0
    largest_graph: int = 0


class ScenePredictor:
    """Predicts the agents of history windows.

    It remembers the graphs of the last cycle, so that agents keep theirs from cycle to cycle.
    ``fallback`` uses no state and may be called from any thread.

    Args:
        runner: the model, None to serve constant velocity alone.
        options: deviations from the task.
        task: what to serve without a runner; with one it is the runner's.
        lanes: lane lines in the fixed frame, for models whose context is ``lanes``.

    Attributes:
        options: may be replaced at any time; takes effect with the next prediction.
        lanes: likewise.
        task: in effect.
        last_report: of the last prediction.
    """

    def __init__(
        self,
        runner: ModelRunner | None,
        *,
        options: PredictorOptions = PredictorOptions(),
        task: TaskDescription | None = None,
        lanes: LaneMap | None = None,
    ) -> None:
        self._runner = runner
        self.task = runner.task if runner is not None else task or TaskDescription()
        self.options = options
        self.lanes = lanes
        self.last_report = PredictionReport()
        self._graphs = GraphState()
        self._graphs_ns: int | None = None

    @property
    def modes(self) -> int:
        """M of every prediction: the model's, or 1 without one."""
        return self.task.modes if self._runner is not None else 1

    def reset(self) -> None:
        """Forget the graphs of the last cycle, as after a jump of the clock."""
        self._graphs = GraphState()

    def fallback(self, window: HistoryWindow) -> Prediction:
        """Constant velocity for every agent present at the window's time; any thread."""
        return self._constant(window.select(window.valid[:, -1]))

    def predict(self, window: HistoryWindow, *, ego_key: KeyArray | None = None) -> Prediction:
        """Predict every agent present at the window's time.

        Args:
            window: see :meth:`~mtpgo_core.history.track_history.TrackHistory.window`.
            ego_key: [4] the ego's identity, for the policy ``ego`` and for ``max_agents``.

        Returns:
            One row for each agent present, in the order of the window.

        Raises:
            ConfigurationError: the model's context is ``lanes`` and no lane lines are known.
        """
        present = window.select(window.valid[:, -1])
        constant = self._constant(present)
        if self._runner is None or len(present) == 0:
            self.last_report = PredictionReport(agents=len(present))
            return constant
        options, state = self.options, self._memory(present.stamp_ns)
        served = self._served(present, options.max_agents, ego_key, state)
        if not served.any():
            self.last_report = PredictionReport(agents=len(present), over_limit=len(present))
            return constant
        scenes_of = present if served.all() else present.select(served)
        batch = build_scenes(
            scenes_of,
            self._scene(options),
            ego_key=ego_key,
            previous=state,
            lanes=self.lanes,
        )
        modelled = self._runner.predict(scenes_of, batch, options.use_tracker_covariance)
        if not served.all():
            row = np.clip(np.cumsum(served) - 1, 0, None)  # any row where not served
            modelled = select(modelled, row)
        usable = served & np.isfinite(modelled.weight).all(axis=1)
        self.last_report = PredictionReport(
            agents=len(present),
            by_model=int(usable.sum()),
            over_limit=int((~served).sum()),
            unusable=int((served & ~usable).sum()),
            graphs=batch.valid.shape[0],
            largest_graph=int((batch.agent >= 0).sum(axis=1).max(initial=0)),
        )
        return modelled if usable.all() else merge(constant, modelled, usable)

    def _memory(self, stamp_ns: int) -> GraphState:
        """What the last cycle left, if it is not so old that even the history forgot it.

        Identities may be given anew after a pause, and a stream's predictions must not depend on
        what was seen before it.
        """
        span_ns = round(self.task.history.steps * self.task.history.dt_s * 1e9)
        if self._graphs_ns is not None and abs(stamp_ns - self._graphs_ns) > span_ns:
            self._graphs = GraphState()
        self._graphs_ns = stamp_ns
        return self._graphs

    def _scene(self, options: PredictorOptions) -> SceneConfig:
        """The task's scene with the options' deviations."""
        scene = self.task.scene
        return dataclasses.replace(
            scene,
            policy=options.policy or scene.policy,
            max_neighbours=(
                scene.max_neighbours if options.max_neighbours is None else options.max_neighbours
            ),
            radius_m=options.radius_m or scene.radius_m,
        )

    def _constant(self, present: HistoryWindow) -> Prediction:
        return predict_constant_velocity(
            present,
            horizon_steps=self.task.horizon_steps,
            dt_s=self.task.history.dt_s,
            modes=self.modes,
        )

    @staticmethod
    def _served(
        present: HistoryWindow, most: int, ego_key: KeyArray | None, state: GraphState
    ) -> BoolArray:
        """[n] the agents that the model serves: the nearest, those served before first."""
        n = len(present)
        if n <= most:
            return np.ones(n, dtype=bool)
        position, names = present.position[:, -1], names_of(present.key)
        middle = position.mean(axis=0)
        if ego_key is not None:
            ego = np.flatnonzero(names == names_of(ego_key.reshape(1, 4))[0])
            middle = position[ego[0]] if ego.shape[0] else middle
        distance = np.linalg.norm(position - middle, axis=1)
        distance[find_names(state.agent, names) >= 0] *= _KEEP
        served = np.zeros(n, dtype=bool)
        served[np.argsort(distance, kind="stable")[:most]] = True
        return served
