# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo benchmark growth``: time against the number of agents and the input rate."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from msg_adapters.inputs.object_cloud import decode_cloud, states_to_pointcloud2
from msg_adapters.predictions import prediction_to_pointcloud2
from msg_adapters.ring_traffic import RingTraffic
from msg_adapters.types import Types, TypestoreTypes
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.scene_predictor import PredictorOptions, ScenePredictor
from mtpgo_core.schema import Prediction
from mtpgo_training.benchmark.growth_plan import GrowthPlan
from mtpgo_training.benchmark.measurement.benchmark_model import model_file
from mtpgo_training.benchmark.measurement.machine import print_heading, table, write_json
from mtpgo_training.benchmark.node_benchmark import node_table, require_node_tools, run_cases
from mtpgo_training.benchmark.node_case import NodeRow

INPUT_HZ, RATE_HZ = 25.0, 5.0
"""Rates of observations and of predictions (Hz); the defaults of the node's benchmark."""


_STAMP_NS = 10**18
"""Stamp of the first observation (ns). Any time will do."""

_FILL_S = 3.2
"""Time until every history is full (s): 16 samples at 5 Hz."""

_STAGE_COLUMNS = {
    "agents": "{.agents}",
    "graphs": "{.graphs}",
    "observe ms": "{.observe_ms:.2f}",
    "predict ms": "{.predict_ms:.1f}",
    "of it per agent ms": "{.predict_ms_per_agent:.2f}",
    "encode ms": "{.encode_ms:.2f}",
}


@dataclass(frozen=True)
class StageTimes:
    """Median times of the stages of one prediction, in this process, without ROS.

    Attributes:
        agents: road users in the scene.
        graphs: graphs given to the model.
        observe_ms: decoding one message and adding it to the history (ms).
        predict_ms: window, graphs, model, transformation into the fixed frame (ms).
        encode_ms: making the message of the prediction (ms).
    """

    agents: int
    graphs: int
    observe_ms: float
    predict_ms: float
    encode_ms: float

    @property
    def predict_ms_per_agent(self) -> float:
        """``predict_ms`` over the number of agents (ms)."""
        return self.predict_ms / self.agents


class Pipeline:
    """History, scenes, model and messages on synthetic traffic, called step by step.

    Args:
        model: model file.
        agents: road users in the scene.
        graph: graph policy.
    """

    def __init__(self, model: Path, agents: int, graph: str = "cover") -> None:
        # Imported late: loading torch takes about a second.
        from msg_adapters.bags.bag_types import bag_typestore
        from mtpgo_core.prediction.model_runner import ModelRunner

        self.types: Types = TypestoreTypes(bag_typestore())
        options = PredictorOptions(policy=graph, max_agents=agents)
        self.predictor = ScenePredictor(ModelRunner.load(model, 1), options=options)
        self.history = TrackHistory(self.predictor.task.history)
        self._traffic = RingTraffic(agents)
        self._time_s = 0.0
        while self._time_s < _FILL_S:
            self.observe(self.message())

    def message(self) -> object:
        """Return the next observation as a message."""
        stamp_ns = _STAMP_NS + round(self._time_s * 1e9)
        states = self._traffic.at(self._time_s, stamp_ns)
        self._time_s += 1.0 / INPUT_HZ
        return states_to_pointcloud2(states, self.types)

    def observe(self, message: object) -> None:
        """Process a message as the node does when no prediction is due."""
        self.history.update(decode_cloud(message).states)

    def predict(self) -> Prediction:
        """Return the prediction at the newest observation."""
        return self.predictor.predict(self.history.window())

    def encode(self) -> object:
        """Predict and return the message of the prediction."""
        return prediction_to_pointcloud2(self.predict(), self.types)


def stage_times(model: Path, agents: int, graph: str, seconds: float) -> StageTimes:
    """Measure the stages of a prediction for one size of scene.

    Args:
        model: model file.
        agents: road users in the scene.
        graph: graph policy.
        seconds: measured time (s); three cycles at least.
    """
    pipeline = Pipeline(model, agents, graph)
    for _ in range(2):
        pipeline.encode()
    observe_s: list[float] = []
    predict_s: list[float] = []
    encode_s: list[float] = []
    until = time.perf_counter() + seconds
    while time.perf_counter() < until or len(predict_s) < 3:
        for _ in range(round(INPUT_HZ / RATE_HZ)):
            message = pipeline.message()
            begin = time.perf_counter()
            pipeline.observe(message)
            observe_s.append(time.perf_counter() - begin)
        begin = time.perf_counter()
        prediction = pipeline.predict()
        predicted = time.perf_counter()
        prediction_to_pointcloud2(prediction, pipeline.types)
        encode_s.append(time.perf_counter() - predicted)
        predict_s.append(predicted - begin)
    return StageTimes(
        agents=agents,
        graphs=pipeline.predictor.last_report.graphs,
        observe_ms=1e3 * float(np.median(observe_s)),
        predict_ms=1e3 * float(np.median(predict_s)),
        encode_ms=1e3 * float(np.median(encode_s)),
    )


def print_growth(
    plan: GrowthPlan, model: str, command: str, output: Path | None
) -> dict[str, object]:
    """Measure everything in the plan, print the tables and write them.

    Args:
        plan: what is measured.
        model: name or file of the model.
        command: command that repeats the measurement.
        output: JSON file, or None.

    Returns:
        What is written to the JSON file, without the machine.

    Raises:
        MtpgoError: ROS is missing, there is no such model, the file cannot be written, or one of
            the processes failed.
    """
    if plan.with_node:
        require_node_tools()
    print_heading(command, output)
    with model_file(model) as path:
        stages = [stage_times(path, n, plan.graph, plan.seconds) for n in plan.agents]
    print(f"Stages of a prediction without ROS, graph {plan.graph}, one thread:\n")
    print(table(stages, _STAGE_COLUMNS))
    result: dict[str, object] = {
        "command": command,
        "model": model,
        "pipeline": [dataclasses.asdict(row) for row in stages],
    }
    if plan.with_node:
        print("\nThe whole node, one prediction a second:\n")
        result["node"] = _printed(run_cases(plan.node_cases(), model))
        print("\nIts input alone (one prediction in ten seconds):\n")
        result["input"] = _printed(run_cases(plan.input_cases(), model))
        print("\nMarkers without a subscriber, with one, and not in `output`:\n")
        cases = plan.marker_cases()
        without_output = run_cases(cases[:1], model, ["output:=[pointcloud2]"])
        result["markers"] = _printed([*run_cases(cases, model), *without_output])
    write_json(output, result)
    return result


def _printed(rows: Sequence[NodeRow]) -> list[dict[str, object]]:
    """Print the table and return the rows as plain data."""
    print(node_table(rows))
    return [dataclasses.asdict(row) for row in rows]
