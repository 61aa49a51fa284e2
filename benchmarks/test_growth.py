# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How the time of a node's cycle grows with the scene, and how much of it is the model."""

from typing import Any

import pytest

from msg_adapters.registry import output_adapter
from mtpgo_training.benchmark.growth_benchmark import Pipeline


@pytest.fixture
def pipeline(reference_file):
    return lambda agents, graph="cover": Pipeline(reference_file, agents, graph)


def test_cover_grows_linearly(in_turns, pipeline) -> None:
    """Twice the road users take twice the time, with a margin for the whole number of graphs."""
    small, large = pipeline(128), pipeline(256)
    assert in_turns(small.predict, large.predict, rounds=15) <= 2.6


def test_the_input_hardly_grows(in_turns, pipeline) -> None:
    """Sixteen times the objects take at most four times as long: no Python code runs per agent."""
    few, many = pipeline(8), pipeline(128)
    ratio = in_turns(
        lambda: few.observe(few.message()), lambda: many.observe(many.message()), rounds=300
    )
    assert ratio <= 4.0


def test_the_model_is_what_takes_the_time(in_turns, pipeline) -> None:
    """A whole cycle (input, graphs, frames, model, message) takes at most 1.25 times the model."""
    whole = pipeline(64, "scene")
    batches: list[Any] = []
    runner = whole.predictor._runner
    forward = runner._forward
    runner._forward = lambda *batch: batches.append(batch) or forward(*batch)
    whole.predict()
    (batch,) = batches

    def cycle() -> None:
        whole.observe(whole.message())
        whole.encode()

    assert in_turns(lambda: forward(*batch), cycle, rounds=20) <= 1.25


def test_serialized_markers_are_far_cheaper_than_objects(in_turns, pipeline) -> None:
    scene = pipeline(16, "scene")
    prediction = scene.predict()
    adapter = output_adapter("markers")
    octets = adapter.writer(scene.types, serialized=True)
    objects = adapter.writer(scene.types)
    assert in_turns(lambda: octets(prediction), lambda: objects(prediction), rounds=10) >= 5.0
