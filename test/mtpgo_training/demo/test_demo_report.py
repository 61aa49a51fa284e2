# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction

from mtpgo_core.schema import Source
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.demo.demo_pipeline import score_recordings
from mtpgo_training.demo.demo_report import (
    results_table,
    sentences,
    summary,
    terminal_table,
    to_json,
)
from mtpgo_training.demo.playback_plan import make_plan
from mtpgo_training.demo.recorded_messages import ReceivedPrediction, RecordedMessages

REQUIRED = {
    "predictions_published",
    "scenes",
    "agents_max",
    "deadline_misses",
    "latency_ms_p50",
    "latency_ms_p99",
    "ade_m",
    "fde_m",
    "nll",
    "cv_ade_m",
    "cv_fde_m",
}


def recorded_messages(plan, drop=None):
    """Perfect predictions of every second frame, 20 ms after the observation."""
    recorded = RecordedMessages()
    for index, recording in enumerate(plan.recordings):
        for frame in recording.frames.tolist():
            stamp_ns = recording.stamp_ns(frame)
            recorded.observed[stamp_ns] = stamp_ns + 1
            if frame % 2 == 0 and (index, frame) != drop:
                prediction = perfect_prediction(recording, frame)
                recorded.predictions.append(ReceivedPrediction(prediction, stamp_ns + 20_000_001))
    recorded.processing_ms = [12.0, 14.0]
    recorded.diagnostics = {"predictor: timing": {"deadline_misses": "3"}}
    return recorded


def content_of(plan, recorded):
    task = TaskDescription(name="made", weights_sha256="ff")
    total, parts = score_recordings(plan, recorded, task, 5.0)
    return summary(total, parts, task, recorded)


@pytest.fixture(scope="module")
def content():
    plan = make_plan([make_recording("a"), make_recording("b", 6.0)], {}, play_all=False)
    return content_of(plan, recorded_messages(plan, drop=(1, 20)))


def test_the_summary_has_the_required_keys(content):
    assert set(content) >= REQUIRED
    back = json.loads(to_json(content))
    assert back["model"] == {"name": "made", "version": "", "weights_sha256": "ff"}
    assert back["versions"]["torch"].startswith("2.")


def test_every_key_is_documented(content):
    page = (Path(__file__).parents[3] / "docs" / "demo.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([a-z_0-9]+)(?:_\*)?`", page))
    for key in [*content, *content["recordings"]["a"]]:
        stem, _, last = key.rpartition("_")
        known = key in named or f"_{last}" in named or stem in named
        assert known or key.partition("_")[0] in named, key


def test_perfect_predictions_score_zero_and_their_known_likelihood(content):
    assert content["ade_m"] == pytest.approx(0.0, abs=1e-9)
    assert content["fde_m"] == pytest.approx(0.0, abs=1e-9)
    assert content["miss_rate"] == 0.0
    # A mixture of 0.75 N(0, diag(4, 1)) and 0.25 N((0, 1), diag(4, 1)) at zero.
    density = (0.75 + 0.25 * np.exp(-0.5)) / (2.0 * np.pi * 2.0)
    assert content["nll"] == pytest.approx(-np.log(density))
    # The car that turns is where constant velocity fails.
    assert content["cv_ade_m"] > 0.5
    assert content["cv_fde_m"] > content["cv_ade_m"]


def test_counts_are_those_of_the_messages(content):
    # Frames 0, 2 ... 120 and 0, 2 ... 60 but for 20; two road users each.
    assert content["scenes"] == 61 + 30
    assert content["predictions_published"] == 2 * 91
    assert content["cycles"] == 92
    assert content["missed_cycles"] == content["deadline_misses"] == 1
    assert content["missing_predictions"] == content["fallback_predictions"] == 0
    assert content["node_deadline_misses"] == 3
    assert content["latency_ms_p50"] == pytest.approx(20.0)
    assert content["node_processing_ms_p50"] == pytest.approx(13.0)
    assert content["recordings"]["a"]["scenes"] == 61
    assert content["recordings"]["b"]["missed_cycles"] == 1


def test_the_table_has_a_line_for_each_recording_and_one_for_all(content):
    lines = terminal_table(content).splitlines()
    assert [line.split()[0] for line in lines if not line.startswith("-")] == [
        "recording",
        "a",
        "b",
        "all",
    ]
    assert len({len(line) for line in lines}) == 1
    text = " ".join(sentences(content, 5.0))
    assert "91 of 92 cycles answered at 5 Hz" in text
    assert "20.0 ms median" in text
    assert "constant velocity, so" not in text


def test_the_coverage_is_that_of_moving_road_users_at_five_seconds(content):
    assert content["coverage_90_moving_5s"] == 1.0
    moving = {f"coverage_90_moving_{t}s": t / 10.0 for t in (1, 3, 5)}
    parts = {name: row | moving for name, row in content["recordings"].items()}
    given = content | moving | {"recordings": parts}
    for known, head, cell in ((5, "moving 90% 5s", "0.50"), (3, "moving 90% 3s", "0.30")):
        table = results_table(given)
        place = list(table.heads).index(head)
        assert [row.cells[place - 1] for row in table.rows] == [cell] * 3
        assert head in terminal_table(given)
        # A horizon that ends earlier has no value.
        given |= {f"coverage_90_moving_{known}s": None}


def test_scores_that_are_not_the_models_are_not_shown_without_a_word():
    plan = make_plan([make_recording("a")], {}, play_all=False)
    content = content_of(plan, recorded_messages(plan))
    few = content | {"fallback_predictions": content["predictions_published"] // 20}
    many = content | {"fallback_predictions": content["predictions_published"] // 2}
    assert "say little about the model" not in " ".join(sentences(few, 5.0))
    assert "50% are by constant velocity" in " ".join(sentences(many, 5.0))


def test_the_fallback_and_a_missing_road_user_show():
    plan = make_plan([make_recording("a")], {}, play_all=False)
    recorded = recorded_messages(plan)
    first = recorded.predictions[0].prediction
    first = dataclasses.replace(
        first,
        **{
            name: getattr(first, name)[:1]
            for name in (
                *("key", "agent_class", "z", "size", "initial", "initial_yaw"),
                *("weight", "mean", "yaw", "covariance"),
            )
        },
        source=np.array([Source.CONSTANT_VELOCITY], dtype=np.uint8),
    )
    recorded.predictions[0] = ReceivedPrediction(first, recorded.predictions[0].received_ns)
    content = content_of(plan, recorded)
    assert content["fallback_predictions"] == 1
    assert content["missing_predictions"] == 1
    assert len(terminal_table(content).splitlines()) == 3
