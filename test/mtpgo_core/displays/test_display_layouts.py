# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The layouts follow namespace, node name, frame and topics."""

import json
import re

import pytest
import yaml

from mtpgo_core.displays.display_layouts import (
    DisplayNames,
    foxglove_layout,
    layout_texts,
    rviz_layout,
)
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.resources import find_resource

NAMES = DisplayNames("/robot1/", "p2", frame="odom", objects="tracks/near", risk="r2")
EXPECTED = {
    "/diagnostics",
    "/robot1/lane_markings",
    "/robot1/tracks/near",
    "/robot1/p2/predictions",
    "/robot1/p2/markers",
    "/robot1/p2/debug/processing_time_ms",
    "/robot1/p2/quality_table",
    "/robot1/p2/quality_markers",
    "/robot1/r2/markers",
    "/robot1/r2/occupancy",
    "/robot1/r2/risk_steps",
}


def rviz_topics(text: str) -> set[str]:
    displays = yaml.safe_load(text)["Visualization Manager"]["Displays"]
    return {display["Topic"]["Value"] for display in displays if "Topic" in display}


def test_the_default_names_give_the_files_that_ship():
    assert rviz_layout(DisplayNames()) == find_resource("config", "predictor.rviz").read_text()
    shipped = json.loads(find_resource("config", "foxglove.json").read_text())
    assert json.loads(foxglove_layout(DisplayNames())) == shipped


def test_every_topic_and_the_frame_follow():
    rviz, foxglove = layout_texts(NAMES).values()
    assert yaml.safe_load(rviz)["Visualization Manager"]["Global Options"]["Fixed Frame"] == "odom"
    panels = json.loads(foxglove)["configById"]
    shown = {topic.split(".")[0] for topic in re.findall(r'"(/[\w/.]+)', foxglove)}
    assert rviz_topics(rviz) | shown == EXPECTED
    assert '"/robot1/p2/quality_table.data[54]"' in foxglove
    assert panels["3D!predictor"]["followTf"] == "odom"
    assert panels["DiagnosticStatusPanel!quality"]["selectedName"] == "robot1/p2: quality"
    assert panels["DiagnosticStatusPanel!risk"]["selectedName"] == "robot1/r2: result"
    assert "map" not in {panel.get("followTf") for panel in panels.values()}


def test_the_panels_of_foxglove_have_their_titles_in_lichtblick_too():
    panels = json.loads(foxglove_layout(NAMES))["configById"].values()
    titles = [(p["foxglovePanelTitle"], p["lichtblickPanelTitle"]) for p in panels if "paths" in p]
    assert len(titles) == 3
    assert all(one == other for one, other in titles)


def test_north_is_up_in_both_viewers():
    views = yaml.safe_load(rviz_layout(NAMES))["Visualization Manager"]["Views"]
    camera = json.loads(foxglove_layout(NAMES))["configById"]["3D!predictor"]["cameraState"]
    assert views["Current"]["Angle"] == camera["thetaOffset"] == 0


def test_names_are_expanded_as_ros_does():
    names = DisplayNames(namespace="a/b", node="n")
    assert names.topic("x") == "/a/b/x"
    assert names.topic("~/x/y") == "/a/b/n/x/y"
    assert names.topic("/x") == "/x"
    assert DisplayNames(objects="/seen/by/radar").replaced("/objects") == "/seen/by/radar"
    # A display of the node risk, and of what all nodes share.
    assert names.replaced("/risk/markers") == "/a/b/risk/markers"
    assert names.replaced("/tf") == "/tf"


@pytest.mark.parametrize("frame", ["true", "1e5", "no", "-x", "robot1/odom", "a.b-c"])
def test_a_frame_stays_text_in_yaml(frame):
    if frame.startswith("-"):
        with pytest.raises(ConfigurationError, match="the frame is '-x', expected letters"):
            DisplayNames(frame=frame)
        return
    options = yaml.safe_load(rviz_layout(DisplayNames(frame=frame)))["Visualization Manager"]
    assert options["Global Options"]["Fixed Frame"] == frame


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"namespace": "robot 1"}, "the namespace is 'robot 1', expected names"),
        ({"namespace": "a//b"}, "the namespace is 'a//b', expected names"),
        ({"namespace": "1a"}, "the namespace is '1a', expected names"),
        ({"node": "a/b"}, "the node name is 'a/b', expected letters"),
        ({"node": ""}, "the node name is '', expected letters"),
        ({"risk": "a b"}, "the node name is 'a b', expected letters"),
        ({"frame": ""}, "the frame is '', expected letters"),
        ({"objects": "a b"}, "the topic is 'a b', expected names"),
        ({"lane_markings": "/"}, "the topic is '/', expected names"),
    ],
)
def test_names_that_ros_does_not_allow_are_refused(given, sentence):
    with pytest.raises(ConfigurationError) as caught:
        DisplayNames(**given)
    assert sentence in str(caught.value)
