# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo benchmark growth``: how time grows with the road users and with the input's rate."""

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
from mtpgo_training.benchmark.benchmark_model import model_file
from mtpgo_training.benchmark.machine import heading, markdown, write_json
from mtpgo_training.benchmark.node_benchmark import check_able, node_table, run_cases
from mtpgo_training.benchmark.node_case import Case

INPUT_HZ, RATE_HZ = 25.0, 5.0
_STAMP_NS = 10**18
_FILL_S = 3.2
"""Until every history is full (s)."""

SELDOM_HZ = 0.1
"""The lowest rate of predictions: what the node then spends, it spends on its input."""


@dataclass(frozen=True)
class Stages:
    """Median times of one size of scene, in this process, without ROS.

    Attributes:
        agents: road users.
        graphs: graphs given to the model.
        observe_ms: decoding one message and taking it into the history.
        predict_ms: window, graphs, model, back into the fixed frame.
        encode_ms: the message of the prediction.
    """

    agents: int
    graphs: int
    observe_ms: float
    predict_ms: float
    encode_ms: float


class Pipeline:
    """History, scenes, model and messages on made-up traffic, driven step by step.

    Args:
        model: file of the model.
        agents: road users.
        graph: policy.
    """

    def __init__(self, model: Path, agents: int, graph: str = "cover") -> None:
        # Only here: torch takes a second to load.
        from mtpgo_core.prediction.model_runner import ModelRunner
        from mtpgo_training.data.recording_bag import bag_typestore

        self.types: Types = TypestoreTypes(bag_typestore())
        options = PredictorOptions(policy=graph, max_agents=agents)
        self.predictor = ScenePredictor(ModelRunner.load(model, 1), options=options)
        self.history = TrackHistory(self.predictor.task.history)
        self._traffic = RingTraffic(agents)
        self._time_s = 0.0
        while self._time_s < _FILL_S:
            self.observe(self.message())

    def message(self) -> object:
        """The next observation as a message."""
        stamp_ns = _STAMP_NS + round(self._time_s * 1e9)
        states = self._traffic.at(self._time_s, stamp_ns)
        self._time_s += 1.0 / INPUT_HZ
        return states_to_pointcloud2(states, self.types)

    def observe(self, message: object) -> None:
        """What the node does with a message in which no prediction is due."""
        self.history.update(decode_cloud(message).states)

    def predict(self) -> Prediction:
        """The prediction at the newest observation."""
        return self.predictor.predict(self.history.window())

    def encode(self) -> object:
        """A prediction and its message."""
        return prediction_to_pointcloud2(self.predict(), self.types)


def stages(model: Path, agents: int, graph: str, seconds: float) -> Stages:
    """Times of the stages for one size of scene, over some seconds, three cycles at least."""
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
    return Stages(
        agents=agents,
        graphs=pipeline.predictor.last_report.graphs,
        observe_ms=1e3 * float(np.median(observe_s)),
        predict_ms=1e3 * float(np.median(predict_s)),
        encode_ms=1e3 * float(np.median(encode_s)),
    )


@dataclass(frozen=True)
class GrowthPlan:
    """What is measured.

    Attributes:
        agents: sizes of the scenes.
        graph: policy.
        input_rates: Hz.
        input_agents: objects in each message of these.
        seconds: for each size of the pipeline, and for each case of the node (s).
        with_node: the node as well, not only the pipeline.
    """

    agents: tuple[int, ...] = (8, 16, 32, 64, 128, 256, 512)
    graph: str = "cover"
    input_rates: tuple[float, ...] = (5.0, 10.0, 25.0, 50.0, 100.0)
    input_agents: int = 128
    seconds: float = 10.0
    with_node: bool = True

    def node_cases(self) -> list[Case]:
        """The node against the agents: seldom enough that even the largest scene has its time."""
        return [Case(n, self.graph, rate=1.0, duration_s=self.seconds) for n in self.agents]

    def input_cases(self) -> list[Case]:
        """The node's input alone."""
        return [
            Case(self.input_agents, self.graph, SELDOM_HZ, rate, self.seconds)
            for rate in self.input_rates
        ]

    def marker_cases(self) -> list[Case]:
        """The same load, markers unheard and heard."""
        quiet = Case(64, self.graph, duration_s=self.seconds)
        return [quiet, dataclasses.replace(quiet, markers=True)]


def print_growth(
    plan: GrowthPlan, model: str, command: str, output: Path | None
) -> dict[str, object]:
    """Measure, print the tables, write them.

    Raises:
        MtpgoError: no ROS, no such model, a file that cannot be written, or a failed process.
    """
    if plan.with_node:
        check_able(output)
    print(heading(command))
    with model_file(model) as path:
        found = [stages(path, n, plan.graph, plan.seconds) for n in plan.agents]
    print(f"The way of a prediction without ROS, graph {plan.graph}, one thread:\n")
    print(stages_table(found))
    result: dict[str, object] = {
        "command": command,
        "model": model,
        "pipeline": [dataclasses.asdict(row) for row in found],
    }
    if plan.with_node:
        print("\nThe whole node, one prediction a second:\n")
        result["node"] = _node(plan.node_cases(), model)
        print("\nIts input alone (one prediction in ten seconds):\n")
        result["input"] = _node(plan.input_cases(), model)
        print("\nMarkers not listened to, listened to, and not in `output` at all:\n")
        unheard, heard = plan.marker_cases()
        without = run_cases([unheard], model, ["output:=[pointcloud2]"])
        rows = [*run_cases([unheard, heard], model), *without]
        print(node_table(rows))
        result["markers"] = [dataclasses.asdict(row) for row in rows]
    if output is not None:
        write_json(output, result)
    return result


def _node(cases: Sequence[Case], model: str) -> list[dict[str, object]]:
    rows = run_cases(cases, model)
    print(node_table(rows))
    return [dataclasses.asdict(row) for row in rows]


def stages_table(rows: Sequence[Stages]) -> str:
    """The rows in Markdown."""
    head = ["agents", "graphs", "observe ms", "predict ms", "of it per agent ms", "encode ms"]
    cells = [
        [
            str(row.agents),
            str(row.graphs),
            f"{row.observe_ms:.2f}",
            f"{row.predict_ms:.1f}",
            f"{row.predict_ms / row.agents:.2f}",
            f"{row.encode_ms:.2f}",
        ]
        for row in rows
    ]
    return markdown(head, cells)
