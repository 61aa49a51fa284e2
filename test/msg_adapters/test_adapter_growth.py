# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Decoding takes time in proportion to the message, whatever a message repeats."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from msg_adapters.inputs.lane_markers import lanes_from_markers
from msg_adapters.registry import INPUTS
from msg_adapters.wire.cloud import cloud_to_records
from mtpgo_core.errors import MessageError
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states

FACTOR = 16
"""Growth of the messages. Quadratic time would grow by 256."""


def states(n):
    """n road users with everything that a message can hold."""
    return tracked_states(
        1_700_000_000_000_000_000,
        "map",
        keys_from_integers(range(1, n + 1)),
        np.stack([np.arange(n), np.zeros(n)], axis=1),
        agent_class=np.ones(n, np.uint8),
        velocity=np.zeros((n, 2)),
        yaw=np.zeros(n),
        size=np.ones((n, 2)),
    )


def seconds(function):
    """Shortest processor time of three runs (s)."""
    times = []
    for _ in range(3):
        begun = time.process_time()
        function()
        times.append(time.process_time() - begun)
    return min(times)


def check_growth(make, decode, small=60):
    """Check that decoding a message FACTOR times as large takes less than 4 FACTOR the time."""
    few, many = make(small), make(FACTOR * small)
    decode(few)
    assert seconds(lambda: decode(many)) < 4 * FACTOR * max(seconds(lambda: decode(few)), 2e-4)


@pytest.mark.parametrize("kind", INPUTS)
def test_objects(kind, offline):
    adapter = INPUTS[kind]
    check_growth(lambda n: adapter.from_states(states(n), offline), adapter.decode)


def repeated(kind, offline, change):
    """A function that makes a message whose first object repeats something n times."""

    def make(n):
        message = INPUTS[kind].from_states(states(2), offline)
        change(getattr(message, INPUTS[kind].content.name)[0], 20 * n)
        return message

    return make


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("autoware", lambda item, n: item.classification.extend(item.classification * n)),
        ("vision", lambda item, n: item.results.extend(item.results * n)),
        ("vision", lambda item, n: setattr(item.results[0].hypothesis, "class_id", "7" * n)),
        ("vision", lambda item, n: setattr(item, "id", "7" * n)),
        ("ika", lambda item, n: item.state.classifications.extend(item.state.classifications * n)),
        ("ika", lambda item, n: setattr(item.state, "continuous_state", np.zeros(n))),
        ("markers", lambda item, n: setattr(item, "ns", "key:" + "0" * n)),
        ("markers", lambda item, n: setattr(item, "text", "x" * n)),
    ],
    ids=["classifications", "results", "class_id", "id", "labels", "state", "ns", "text"],
)
def test_what_an_object_repeats(kind, change, offline):
    check_growth(repeated(kind, offline, change), INPUTS[kind].decode)


def cloud(rows=1, columns=4, fields=3, point_step=16):
    names = ["x", "y", "id_0", *(f"f{i}" for i in range(fields - 3))]
    return SimpleNamespace(
        height=rows,
        width=columns,
        fields=[
            SimpleNamespace(name=n, offset=4 * min(i, 2), datatype=6 if i == 2 else 7, count=1)
            for i, n in enumerate(names)
        ],
        is_bigendian=False,
        point_step=point_step,
        row_step=columns * point_step + 8,
        data=bytes(rows * (columns * point_step + 8)),
    )


def test_rows_and_fields_of_a_cloud():
    check_growth(lambda n: cloud(rows=20 * n, columns=1), cloud_to_records)
    check_growth(lambda n: cloud(fields=3 + 4 * n), cloud_to_records)


def test_lines_of_lane_markings(offline):
    def make(n):
        marker = offline.make("visualization_msgs/msg/Marker", type=5)
        marker.points = [offline.make("geometry_msgs/msg/Point")] * (2 * n)
        return SimpleNamespace(markers=[marker] * 4)

    check_growth(make, lanes_from_markers)


def test_lane_markings_of_too_many_points_are_refused(offline):
    marker = offline.make("visualization_msgs/msg/Marker", type=4)
    marker.points = [offline.make("geometry_msgs/msg/Point")] * 150_000
    with pytest.raises(MessageError, match="300000 points, expected at most 200000"):
        lanes_from_markers(SimpleNamespace(markers=[marker, marker]))


@pytest.mark.parametrize("digits", ["0" * 5000, "9" * 5000])
def test_one_class_id_of_thousands_of_digits_harms_no_other_object(digits, offline):
    message = INPUTS["vision"].from_states(states(2), offline)
    message.detections[0].results[0].hypothesis.class_id = digits
    assert INPUTS["vision"].to_states(message).agent_class.tolist() == [0, 1]
