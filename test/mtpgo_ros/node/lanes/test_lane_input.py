# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines from a file and from markings, in the observations' frame; no ROS needed."""

import dataclasses
import json
import time

import numpy as np
import pytest
from ros_helpers import traffic

from mtpgo_core.errors import ConfigurationError, FrameError
from mtpgo_core.frames import Pose2
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_ros.node.lanes import lane_input
from mtpgo_ros.node.lanes.lane_input import LaneInput
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters


def lane_file(path, *heights):
    lines = [[[-500.0, y], [2000.0, y]] for y in heights or (2.0, -2.0)]
    path.write_text(json.dumps({"type": "MultiLineString", "coordinates": lines}))
    return path


def parameters(path="", **values):
    return dataclasses.replace(PredictorParameters(), lane_file=str(path), **values)


@pytest.fixture
def bench():
    """An input, the lines that it placed, its time, and what it said."""

    class Bench:
        def __init__(self):
            self.placed, self.said, self.now_s = [], [], 0.0
            self.lanes = LaneInput(self.placed.append, clock=lambda: self.now_s)
            self.lanes.on_read = lambda *said: self.said.append(said)

        def observe(self, frame_id="map", time_s=0.0):
            self.now_s += 2.0
            self.lanes.observe(traffic(time_s, frame_id=frame_id))

        def wait(self):
            self.lanes._reader.join(30.0)

        def d_l(self):
            return self.placed[-1].positions(np.array([[0.0, 1.0]]), np.zeros(1))[0, 0]

    return Bench()


def test_a_file_in_the_objects_frame_serves_at_once(bench, tmp_path):
    path = lane_file(tmp_path / "lanes.geojson")
    assert "2 lane lines" in bench.lanes.read(parameters(path))
    assert bench.d_l() == pytest.approx(-0.5)
    bench.observe()
    assert bench.lanes.limitations() == []
    assert bench.lanes.values()["lanes"] == str(path)
    assert not bench.lanes.from_topic


def test_a_file_that_cannot_be_used_is_an_error(bench, tmp_path):
    (tmp_path / "lanes").write_text("{}")
    with pytest.raises(ConfigurationError, match="expected GeoJSON"):
        bench.lanes.read(parameters(tmp_path / "lanes"))


def test_another_file_replaces_the_lines_while_the_node_runs(bench, tmp_path):
    path = lane_file(tmp_path / "lanes.geojson")
    bench.lanes.read(parameters(path))
    bench.lanes.configure(parameters(path))
    assert bench.lanes._reader is None  # nothing changed
    bench.lanes.configure(parameters(lane_file(tmp_path / "other", 3.0, 1.0, -1.0)))
    bench.wait()
    assert bench.d_l() == pytest.approx(-1.0)
    assert bench.said[-1][0].startswith("lane file: ")
    bad = tmp_path / "bad"
    bad.write_text("nothing")
    bench.lanes.configure(parameters(bad))
    bench.wait()
    assert bench.d_l() == pytest.approx(-1.0)  # the earlier ones stay
    assert bench.said[-1][1]
    (problem,) = bench.lanes.limitations()
    assert "neither XML nor JSON" in problem
    bench.lanes.configure(parameters(path, lane_offset="0, -1"))
    bench.wait()
    assert bench.lanes.limitations() == []
    assert bench.d_l() == pytest.approx(0.0)
    bench.lanes.configure(parameters())
    assert bench.lanes.from_topic
    assert len(bench.placed[-1]) == 0
    assert "nothing has come on lane_markings" in bench.lanes.limitations()[0]


def test_a_file_that_has_changed_is_read_again_when_it_is_set_again(bench, tmp_path):
    path = lane_file(tmp_path / "lanes.geojson")
    bench.lanes.read(parameters(path))
    lane_file(path, 3.0, 1.0, -1.0)
    bench.lanes.configure(parameters(path))
    bench.wait()
    assert bench.d_l() == pytest.approx(-1.0)
    path.write_text("nothing")
    bench.lanes.configure(parameters(path))
    bench.wait()
    assert "neither XML nor JSON" in bench.lanes.limitations()[0]
    lane_file(path, 2.0, -2.0)  # mended
    bench.lanes.configure(parameters(path))
    bench.wait()
    assert bench.lanes.limitations() == []
    assert bench.d_l() == pytest.approx(-0.5)
    reader = bench.lanes._reader
    path.unlink()
    bench.lanes.configure(parameters(path))
    assert bench.lanes._reader is reader  # the lines stay, and nothing is said
    assert bench.lanes.limitations() == []


def test_lines_of_another_frame_wait_for_tf_and_follow_it(bench, tmp_path):
    def missing(lane_frame, frame_id):
        raise FrameError(f"TF has no transform from {frame_id!r} to {lane_frame!r}")

    bench.lanes.pose_in = missing
    bench.lanes.read(parameters(lane_file(tmp_path / "lanes"), lane_frame="map"))
    assert bench.placed == []
    bench.observe("odom")
    assert bench.placed == []
    assert "no transform from 'odom' to 'map'" in bench.lanes.limitations()[0]
    asked = []
    bench.lanes.pose_in = lambda *frames: asked.append(frames) or Pose2(0.0, -1.0, 0.0)
    bench.observe("odom")
    assert asked == [("map", "odom")]
    assert bench.d_l() == pytest.approx(0.0)
    bench.lanes.observe(traffic(0.1, frame_id="odom"))
    assert len(asked) == 1  # once a second is enough
    bench.observe("map")  # the objects come in the lines' own frame now
    assert bench.d_l() == pytest.approx(-0.5)
    assert bench.lanes.limitations() == []
    bench.lanes.pose_in = missing
    bench.observe("odom")
    assert len(bench.placed[-1]) == 0  # none rather than wrong ones


def test_a_turned_frame_turns_positions_and_headings():
    road = LaneMap([np.array([[-99.0, y], [99.0, y]]) for y in (2.0, -2.0)])
    # The objects' x axis is the road's y axis.
    seen = road.seen_from(Pose2(0.0, 0.0, np.pi / 2))
    given = seen.positions(np.array([[1.0, 5.0]]), np.array([-np.pi / 2]))
    np.testing.assert_allclose(given, [[-0.5, -0.5]])
    assert seen.distance_m(np.array([[12.0, 0.0]])) == pytest.approx(10.0)


def test_markings_wait_for_the_frame_of_the_objects(bench):
    road = LaneMap([np.array([[-500.0, y], [2000.0, y]]) for y in (2.0, -2.0)])
    assert "nothing has come" in bench.lanes.limitations()[0]
    bench.lanes.take_markings(road, "map")
    assert bench.placed == []
    bench.observe("map")
    assert bench.placed[-1] is road
    other = LaneMap([np.array([[-500.0, y], [2000.0, y]]) for y in (90.0, 95.0)])
    bench.lanes.take_markings(other, "map")
    assert bench.placed[-1] is other  # the frame is known: at once
    for number in range(20):
        bench.observe("map", float(number))
    (problem,) = bench.lanes.limitations()
    assert problem.startswith("lane_markings: no vehicle that moves is in a lane")


def test_markings_in_a_known_frame_serve_at_once(bench):
    bench.observe("map")
    bench.lanes.take_markings(LaneMap([np.array([[0.0, 2.0], [9.0, 2.0]])]), "map")
    assert len(bench.placed[-1]) == 1


def test_reading_takes_place_beside_the_node(bench, tmp_path, monkeypatch):
    begun_s = time.monotonic()

    def slow(path, options):
        while len(bench.said) == 0 and time.monotonic() - begun_s < 30.0:
            time.sleep(0.001)
        raise ConfigurationError("slow")

    monkeypatch.setattr("mtpgo_ros.node.lanes.lane_input.read_lane_file", slow)
    bench.lanes.configure(parameters(lane_file(tmp_path / "lanes")))
    assert "is being read" in bench.lanes.limitations()[0]
    bench.observe()
    bench.said.append("go on")
    bench.wait()
    assert "slow" in bench.lanes.limitations()[0]


def test_empty_and_refused_markings_are_reported_until_usable_ones_come(bench):
    assert bench.lanes.limitations() == [
        "the model wants lanes, but nothing has come on lane_markings"
    ]
    bench.lanes.refuse_markings("lane markings are not used: too large")
    assert bench.lanes.limitations() == ["lane markings are not used: too large"]
    bench.lanes.take_markings(LaneMap(()), "map")
    bench.observe()
    assert bench.lanes.limitations() == ["there is no lane line in lane_markings"]
    bench.lanes.take_markings(LaneMap([np.array([[0.0, 2.0], [9.0, 2.0]])]), "map")
    bench.observe()
    assert bench.lanes.limitations() == []
    bench.lanes.refuse_markings("lane markings are not used: two frames")
    assert bench.lanes.limitations() == ["lane markings are not used: two frames"]
    assert bench.lanes.values()["lane_segments"] == "1"  # the earlier ones serve


def test_parameters_of_a_file_that_is_none_leave_the_lines_of_the_topic(bench):
    bench.observe()
    bench.lanes.configure(parameters())
    bench.lanes.take_markings(LaneMap([np.array([[-500.0, 2.0], [2000.0, 2.0]])]), "map")
    for change in ({"lane_offset": "1, 2"}, {"lane_frame": "odom"}, {"lane_projection": "utm"}):
        bench.lanes.configure(parameters(**change))
    assert bench.lanes.limitations() == []
    assert bench.lanes.values()["lanes"] == "lane_markings"
    assert len(bench.placed[-1]) == 1


def test_lines_read_after_a_newer_choice_are_not_used(bench, tmp_path, monkeypatch):
    """The topic is wanted by the time a file is read, and a file by that of a message."""
    path = lane_file(tmp_path / "lanes.geojson")
    found = lane_input.read_lane_file(path, parameters(path).lane_options)

    def slow(*_):
        bench.lanes.configure(parameters())
        return found

    monkeypatch.setattr(lane_input, "read_lane_file", slow)
    bench.lanes.configure(parameters(path))
    bench.wait()
    assert bench.lanes.from_topic
    assert bench.lanes.values() == {}
    assert bench.said == []
    monkeypatch.setattr(lane_input, "read_lane_file", lambda *_: found)
    bench.lanes.configure(parameters(path))
    bench.wait()
    bench.lanes.take_markings(LaneMap([np.array([[-500.0, 2.0], [2000.0, 2.0]])]), "map")
    assert bench.lanes.values()["lanes"] == str(path)


def test_a_frame_that_is_set_while_the_file_is_read_is_that_of_its_lines(
    bench, tmp_path, monkeypatch
):
    """As `ros2 param load` does: one parameter after the other, without a pause."""
    path = lane_file(tmp_path / "lanes.geojson")
    found = lane_input.read_lane_file(path, parameters(path).lane_options)

    def slow(*_):
        bench.lanes.configure(parameters(path, lane_frame="map"))
        return found

    monkeypatch.setattr(lane_input, "read_lane_file", slow)
    bench.lanes.pose_in = lambda *frames: Pose2(0.0, -1.0, 0.0)
    bench.lanes.configure(parameters(path))
    bench.wait()
    bench.observe("odom")
    assert bench.d_l() == pytest.approx(0.0)


def test_the_frame_of_a_file_that_cannot_be_used_is_not_that_of_the_earlier_lines(bench, tmp_path):
    bad = tmp_path / "bad"
    bad.write_text("nothing")
    bench.lanes.take_markings(LaneMap([np.array([[-500.0, 2.0], [2000.0, 2.0]])]), "map")
    bench.observe("map")
    other = parameters(bad, lane_frame="site")
    bench.lanes.configure(other)
    bench.wait()
    bench.lanes.configure(other)  # as with any other parameter that changes, or a new ego
    bench.observe("map")
    (problem,) = bench.lanes.limitations()
    assert "neither XML nor JSON" in problem
    assert len(bench.placed[-1]) == 1
