# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions as markers: boxes, paths, ellipses, stale markers."""

import dataclasses

import numpy as np
import pytest

from msg_adapters.outputs.marker_tracker import MODES_PER_AGENT, MarkerTracker
from msg_adapters.outputs.prediction_markers import (
    BOXES,
    ELLIPSES,
    LABELS,
    TRAJECTORIES,
    MarkerStyle,
    clear_markers,
    prediction_to_markers,
)
from msg_adapters.registry import OUTPUTS
from mtpgo_core.class_size import CLASS_SIZE_M
from mtpgo_core.schema import AgentClass

TYPE = "visualization_msgs/msg/MarkerArray"
ADD, DELETE, DELETE_ALL = 0, 2, 3
ALL = MarkerStyle(min_weight=0.0, ellipse_min_weight=0.0, ellipse_every_s=0.4)


def of(message, ns, action=ADD):
    return {m.id: m for m in message.markers if m.ns == ns and m.action == action}


def names(message, action=ADD):
    return {(m.ns, m.id) for m in message.markers if m.action == action}


def xy(marker):
    return np.array([(p.x, p.y) for p in marker.points])


def only(prediction, agents):
    """The prediction of some agents."""
    shared = ("stamp_ns", "frame_id", "time_s")
    fields = [f.name for f in dataclasses.fields(prediction) if f.name not in shared]
    return dataclasses.replace(prediction, **{n: getattr(prediction, n)[agents] for n in fields})


def test_boxes_paths_and_ellipses_through_cdr(prediction, offline, decoded):
    message = prediction_to_markers(prediction, offline, MarkerTracker(), style=ALL)
    for again in decoded(message, TYPE, with_rclpy=True).values():
        assert {m.header.frame_id for m in again.markers} == {"map"}
        assert {m.header.stamp.nanosec for m in again.markers} == {123_456_789}
        assert {(m.lifetime.sec, m.lifetime.nanosec) for m in again.markers} == {(1, 0)}
        boxes, lines, rings = of(again, BOXES), of(again, TRAJECTORIES), of(again, ELLIPSES)
        assert (len(boxes), len(lines), len(rings)) == (3, 12, 12)
        for agent in range(3):
            box = boxes[agent * MODES_PER_AGENT]
            np.testing.assert_allclose(
                [box.pose.position.x, box.pose.position.y], prediction.initial[agent, :2]
            )
            np.testing.assert_allclose([box.scale.x, box.scale.y], prediction.size[agent])
            for mode in range(4):
                line = lines[agent * MODES_PER_AGENT + mode]
                now = prediction.initial[agent, :2]
                wanted = np.vstack([now, prediction.mean[agent, mode, :, :2]])
                np.testing.assert_allclose(xy(line), wanted)
                share = prediction.weight[agent, mode] / prediction.weight[agent, 0]
                assert line.color.a == pytest.approx(max(share, 0.1), rel=1e-6)


def test_every_ellipse_corner_is_two_sigma_away(prediction, offline):
    message = prediction_to_markers(prediction, offline, MarkerTracker(), style=ALL)
    corners = xy(of(message, ELLIPSES)[MODES_PER_AGENT * 1 + 2]).reshape(2, -1, 2, 2)
    for ring, step in zip(corners, (1, 3), strict=True):  # 0.4 s and 0.8 s of 1.0 s
        off = ring.reshape(-1, 2) - prediction.mean[1, 2, step, :2]
        inverse = np.linalg.inv(prediction.covariance[1, 2, step])
        np.testing.assert_allclose(np.einsum("ki,ij,kj->k", off, inverse, off), 4.0)
        # Segments join end to start, so the ring is closed.
        np.testing.assert_array_equal(ring[:-1, 1], ring[1:, 0])
        np.testing.assert_array_equal(ring[-1, 1], ring[0, 0])


def test_light_modes_are_not_drawn_but_one_always_is(prediction, offline):
    weight = np.array([[0.9, 0.06, 0.03, 0.01], [0.4, 0.3, 0.2, 0.1], [0.25] * 4])
    message = prediction_to_markers(
        dataclasses.replace(prediction, weight=weight), offline, MarkerTracker()
    )
    drawn = [i // MODES_PER_AGENT for i in of(message, TRAJECTORIES)]
    assert [drawn.count(agent) for agent in range(3)] == [3, 4, 4]
    assert sum(i // MODES_PER_AGENT == 0 for i in of(message, ELLIPSES)) == 1
    nothing = MarkerStyle(min_weight=0.99)
    message = prediction_to_markers(prediction, offline, MarkerTracker(), style=nothing)
    assert set(of(message, TRAJECTORIES)) == {a * MODES_PER_AGENT for a in range(3)}


def test_ids_stay_and_stale_markers_are_deleted(prediction, offline):
    tracker = MarkerTracker()

    def draw(agents):
        return prediction_to_markers(only(prediction, agents), offline, tracker, style=ALL)

    first = draw([0, 1, 2])
    assert names(first, DELETE) == set()
    second = draw([2, 0])
    for message, agents in ((first, [0, 1, 2]), (second, [2, 0])):
        for agent in agents:
            box = of(message, BOXES)[agent * MODES_PER_AGENT]
            assert box.pose.position.x == prediction.initial[agent, 0]
    gone = {(ns, i) for ns, i in names(first) if i // MODES_PER_AGENT == 1}
    assert len(gone) == 9
    assert names(second, DELETE) == gone
    assert names(second) == names(first) - gone
    # Deletions are sent once, and an agent that comes back gets a number never used before.
    third = draw([0, 1, 2])
    assert names(third, DELETE) == set()
    assert set(of(third, BOXES)) == {a * MODES_PER_AGENT for a in (0, 2, 3)}


def test_a_mode_that_fades_out_is_deleted(prediction, offline):
    tracker = MarkerTracker()
    prediction_to_markers(prediction, offline, tracker, style=ALL)
    message = prediction_to_markers(prediction, offline, tracker, style=ALL, max_modes=3)
    gone = {(ns, a * MODES_PER_AGENT + 3) for a in range(3) for ns in (TRAJECTORIES, ELLIPSES)}
    assert names(message, DELETE) == gone
    opacity = [of(message, TRAJECTORIES)[mode].color.a for mode in range(3)]
    weight = prediction.weight[0, :3]
    np.testing.assert_allclose(opacity, np.maximum(weight / weight[0], 0.1))


def test_unknown_and_non_finite_parts_are_left_out(prediction, offline):
    mean = prediction.mean.copy()
    mean[1, 2, 3, 0] = np.nan
    covariance = prediction.covariance.copy()
    covariance[2, 1, 1] = np.nan
    initial = prediction.initial.copy()
    initial[0] = np.nan
    odd = dataclasses.replace(
        prediction,
        mean=mean,
        covariance=covariance,
        initial=initial,
        size=np.full((3, 2), np.nan),
        z=np.full(3, np.nan),
        initial_yaw=np.full(3, np.nan),
    )
    message = prediction_to_markers(odd, offline, MarkerTracker(), style=ALL)
    assert set(of(message, BOXES)) == {MODES_PER_AGENT, 2 * MODES_PER_AGENT}
    assert MODES_PER_AGENT + 2 not in of(message, TRAJECTORIES)
    assert 2 * MODES_PER_AGENT + 1 not in of(message, ELLIPSES)
    assert 2 * MODES_PER_AGENT + 1 in of(message, TRAJECTORIES)
    assert len(of(message, TRAJECTORIES)[0].points) == 5  # no present position to start from
    for marker in message.markers:
        numbers = [marker.pose.position.z, marker.pose.orientation.w, marker.scale.x]
        assert np.isfinite(numbers).all()
        assert np.isfinite(xy(marker)).all()


def test_fallback_is_grey_and_classes_differ(prediction, offline):
    message = prediction_to_markers(prediction, offline, MarkerTracker())
    colours = [of(message, BOXES)[a * MODES_PER_AGENT].color for a in range(3)]
    assert colours[1].r == colours[1].g == colours[1].b  # agent 1 is served by constant velocity
    assert (colours[0].r, colours[0].g) != (colours[2].r, colours[2].g)


def test_labels_name_class_and_track(prediction, offline):
    message = prediction_to_markers(
        prediction, offline, MarkerTracker(), style=MarkerStyle(labels=True)
    )
    assert of(message, LABELS)[MODES_PER_AGENT].text == f"pedestrian {prediction.key[1, 0]}"


def test_no_agents_deletes_all_markers(prediction, offline, decoded):
    writer = OUTPUTS["markers"].writer(offline)
    first = writer(prediction)
    message = writer(only(prediction, []))
    assert names(message, DELETE) == names(first)
    for again in decoded(writer(only(prediction, [])), TYPE, with_rclpy=True).values():
        assert len(again.markers) == 0


def test_clearing_deletes_all_markers(offline, decoded):
    message = clear_markers(offline, stamp_ns=1, frame_id="map")
    for again in decoded(message, TYPE, with_rclpy=True).values():
        assert [m.action for m in again.markers] == [DELETE_ALL]


def test_rclpy_classes_with_field_checks(prediction, online, typestore):
    serialization = pytest.importorskip("rclpy.serialization")
    message = OUTPUTS["markers"].writer(online)(prediction)
    data = serialization.serialize_message(message)
    again = typestore.deserialize_cdr(data, TYPE)
    assert names(again) == names(message)
    line = of(again, TRAJECTORIES)[0]
    np.testing.assert_allclose(xy(line)[1:], prediction.mean[0, 0, :, :2])


def test_a_road_user_of_unknown_size_and_class_has_a_usual_box_and_a_label(prediction, offline):
    unknown = dataclasses.replace(
        prediction,
        size=np.full((3, 2), np.nan),
        agent_class=np.array([AgentClass.BUS, AgentClass.PEDESTRIAN, 200], np.uint8),
    )
    style = MarkerStyle(labels=True)
    message = prediction_to_markers(unknown, offline, MarkerTracker(), style=style)
    boxes = [(m.scale.x, m.scale.y) for m in of(message, BOXES).values()]
    kinds = (AgentClass.BUS, AgentClass.PEDESTRIAN, AgentClass.UNKNOWN)
    assert boxes == [CLASS_SIZE_M[kind] for kind in kinds]
    assert [m.text.split()[0] for m in of(message, LABELS).values()][2] == "unknown"
