# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The task description: there and back, and every wrong value by its sentence."""

import dataclasses
import json

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_core.task.task_description import (
    TRACK_FEATURES,
    HistoryConfig,
    SceneConfig,
    TaskDescription,
)


def test_there_and_back():
    task = TaskDescription(
        name="x",
        states=("x", "y"),
        history=HistoryConfig(dt_s=0.1, steps=31, velocity_source="estimated"),
        scene=SceneConfig(policy="ego", frame="site_origin", site_origin=(3.5, -2.0), classes=()),
        metrics={"a": {"b": [1, 2.5, None]}},
    )
    assert TaskDescription.from_json(task.to_json()) == task


def test_sizes_summaries_and_trails_there_and_back():
    scene = SceneConfig(classes=("car", "bus"), sizes=True, track_summary=True, trails=True)
    task = TaskDescription(scene=scene)
    again = TaskDescription.from_json(task.to_json())
    assert again == task
    sizes = ("length", "width", "size_known")
    assert again.scene.static_features == ("car", "bus", *sizes, *TRACK_FEATURES)
    assert SceneConfig(classes=("car", "bus")).static_features == ("car", "bus")


def test_a_file_from_before_sizes_summaries_and_trails_has_none():
    data = json.loads(TaskDescription().to_json())
    del data["scene"]["sizes"], data["scene"]["track_summary"], data["scene"]["trails"]
    scene = TaskDescription.from_json(json.dumps(data)).scene
    assert (scene.sizes, scene.track_summary, scene.trails) == (False, False, False)


def test_whole_numbers_serve_as_floats_and_lists_as_tuples():
    scene = from_dict(SceneConfig, {"radius_m": 50, "site_origin": [1, 2]}, "scene")
    assert scene.radius_m == 50.0
    assert isinstance(scene.radius_m, float)
    assert scene.site_origin == (1.0, 2.0)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "scene is [], expected a mapping"),
        ({"color": 1}, "scene has the unknown field 'color'"),
        ({"policy": "star"}, "scene.policy is 'star', expected one of 'ego'"),
        ({"policy": 3}, "scene.policy is 3, expected str"),
        ({"frame": "moon"}, "scene.frame is 'moon'"),
        ({"context": "sky"}, "scene.context is 'sky'"),
        ({"max_neighbours": -1}, "scene.max_neighbours is -1, expected at least 0"),
        ({"max_neighbours": True}, "scene.max_neighbours is True, expected int"),
        ({"max_neighbours": 2.5}, "scene.max_neighbours is 2.5, expected int"),
        ({"radius_m": float("nan")}, "scene.radius_m is nan, expected at least 0"),
        ({"radius_m": "far"}, "scene.radius_m is 'far', expected float"),
        ({"site_origin": [1.0]}, "scene.site_origin is [1.0], expected 2 values"),
        ({"site_origin": 7}, "scene.site_origin is 7, expected a list"),
        ({"classes": ["car", 3]}, "scene.classes[1] is 3, expected str"),
    ],
)
def test_wrong_values_are_named(data, message):
    with pytest.raises(ConfigurationError) as caught:
        from_dict(SceneConfig, data, "scene")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "changes",
    [
        {"dt_s": 0.0},
        {"steps": 0},
        {"max_gap_s": -0.1},
        {"max_speed_mps": 0.0},
        {"velocity_source": "radar"},
    ],
)
def test_histories_that_cannot_be_are_errors(changes):
    with pytest.raises(ConfigurationError, match=f"history.{next(iter(changes))}"):
        HistoryConfig(**changes)


@pytest.mark.parametrize("text", ["", "[1]", "null", '{"schema_version": 0}', "{}", "[" * 100_000])
def test_text_that_is_no_task_is_an_error(text):
    with pytest.raises(ConfigurationError, match="the task description"):
        TaskDescription.from_json(text)


def test_half_a_character_is_no_text():
    data = json.loads(TaskDescription().to_json())
    data["name"] = "\ud800"
    with pytest.raises(ConfigurationError, match=r"task\.name is '.ud800', expected text without"):
        TaskDescription.from_json(json.dumps(data))


def test_nested_errors_name_the_place():
    data = json.loads(TaskDescription().to_json())
    data["history"]["steps"] = "many"
    with pytest.raises(ConfigurationError, match=r"task\.history\.steps is 'many', expected int"):
        TaskDescription.from_json(json.dumps(data))


def test_features_follow_the_context():
    assert SceneConfig().features[-1] == "sin_yaw"
    polar = dataclasses.replace(SceneConfig(), context="polar").features
    assert polar[8:] == ("r", "cos_theta", "sin_theta")
