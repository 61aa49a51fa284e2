# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Live topics: what is listened to, what is logged as it comes, and a page made of two seconds."""

import dataclasses
import importlib.util
from pathlib import Path

import numpy as np
import pytest
from viewed_bags import PREDICTIONS, write_bag

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.bags.live.growing_bag import FollowedMessage
from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.maps.lane_file import read_lane_file
from mtpgo_training.data.data_sources import DataSource
from mtpgo_training.processes.child_process import ChildProcess
from mtpgo_training.view.live_view import LiveScene, LiveTopics, live_topics, view_live
from mtpgo_training.view.view_source import ViewOptions


@pytest.fixture(scope="module")
def bag(recording, tmp_path_factory):
    return write_bag(tmp_path_factory.mktemp("bag") / "drive.mcap", recording)


@pytest.mark.parametrize(
    ("given", "objects", "predictions", "expected"),
    [
        ("/objects", "", None, LiveTopics("/objects", PREDICTIONS)),
        ("/robot1/objects", "", "/robot1/p", LiveTopics("/robot1/objects", "/robot1/p")),
        ("/a/predictions", "", None, LiveTopics("/objects", "/a/predictions")),
        ("/a/predictions", "/tracks", None, LiveTopics("/tracks", "/a/predictions")),
    ],
)
def test_a_topic_of_either_kind_finds_the_other(given, objects, predictions, expected):
    assert live_topics(given, objects, predictions) == expected


class Noted:
    """Stands for the viewer of rerun."""

    def __init__(self):
        self.states, self.predictions, self.lanes = [], [], []

    def log_states(self, time_s, states, names):
        self.states.append((time_s, names))

    def log_prediction(self, time_s, prediction):
        self.predictions.append((time_s, len(prediction)))

    def log_lanes(self, lanes):
        self.lanes.append(lanes)


def test_messages_are_logged_as_they_come(bag):
    noted = Noted()
    scene = LiveScene(noted, LiveTopics("/objects", PREDICTIONS))
    with DecodingBagReader(bag) as reader:
        for connection, time_ns, message in reader.messages(reader.connections):
            came = FollowedMessage(connection.topic, connection.msgtype, time_ns, message)
            scene.add(came)
            scene.add(came._replace(topic="/other"))
            scene.add(came._replace(message=object(), topic="/objects"))
    assert len(noted.states) == 121
    assert noted.states[-1] == (pytest.approx(12.0), ["7", "8"])
    assert noted.predictions[-1] == (pytest.approx(10.0), 2)
    assert len(noted.predictions) == 51


@pytest.mark.parametrize("with_file", [False, True])
def test_the_lanes_of_a_file_are_shown_in_place_of_the_topics(recording, tmp_path, with_file):
    path = tmp_path / "a.json"
    path.write_text('{"type": "LineString", "coordinates": [[0, 5], [900, 5]]}')
    lanes = read_lane_file(path) if with_file else None
    noted = Noted()
    scene = LiveScene(noted, LiveTopics("/objects", PREDICTIONS), lanes)
    own = dataclasses.replace(recording, lanes=(np.array([[0.0, -12.0], [120.0, -12.0]]),))
    with DecodingBagReader(write_bag(tmp_path / "a.mcap", own)) as reader:
        for connection, time_ns, message in reader.messages(reader.connections):
            scene.add(FollowedMessage(connection.topic, connection.msgtype, time_ns, message))
    ((line,),) = noted.lanes
    np.testing.assert_allclose(line[:, 1], 5.0 if with_file else -12.0)


@pytest.mark.parametrize("outputs", [{}, {"html": Path("a.html")}, {"rerun": Path("a.rrd")}])
def test_a_file_needs_an_end(outputs):
    with pytest.raises(ConfigurationError, match="expected --seconds N"):
        view_live("/objects", DataSource(Path("/objects"), "bag"), ViewOptions(), outputs, None)


@pytest.mark.skipif(importlib.util.find_spec("rclpy") is None, reason="rclpy is not installed")
def test_a_topic_without_a_publisher_is_an_error(monkeypatch, tmp_path):
    monkeypatch.setattr("mtpgo_training.view.live_view.FIRST_S", 0.5)
    outputs = {"html": tmp_path / "a.html"}
    with pytest.raises(RecordingError, match="nothing came on /silent or /predictor/predictions"):
        view_live("/silent", DataSource(Path("/silent"), "bag"), ViewOptions(), outputs, 2.0)


@pytest.mark.timeout(300)
@pytest.mark.skipif(importlib.util.find_spec("rclpy") is None, reason="rclpy is not installed")
def test_a_page_of_a_live_topic(bag, tmp_path, capsys):
    page = tmp_path / "live.html"
    playing = [str(bag), "--wait-for-subscribers", "1", "--no-progress", "--clock-rate", "0"]
    with ChildProcess("replay", [*playing, "--loop"], tmp_path / "replay.log", {}) as replay:
        source = DataSource(Path("/objects"), "bag")
        assert view_live("/objects", source, ViewOptions(), {"html": page}, 5.0) == 0
        replay.check()
    told = capsys.readouterr().out
    assert "2 road users" in told
    assert int(told.split(" predictions, ")[0].split()[-1]) > 0
    assert page.stat().st_size > 10_000
