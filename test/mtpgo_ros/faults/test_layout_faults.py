# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages whose layout is wrong, contradicts itself, or is too large, over real DDS."""

import dataclasses
import gc
import statistics
import time

import numpy as np
import pytest
from fault_harness import PERIOD_S, REPORT_S, WARN, check_invariants
from lifecycle_msgs.srv import GetState
from rcl_interfaces.srv import GetParameters
from rclpy.serialization import deserialize_message, serialize_message
from ros_helpers import message_of, traffic
from sensor_msgs.msg import PointCloud2, PointField
from visualization_msgs.msg import Marker, MarkerArray, UVCoordinate

from msg_adapters.predictions import POINT
from mtpgo_core.schema import Source


def refused(node, message):
    """Check that a message is left out and counted, and that all else goes on."""
    node.fresh().healthy()
    with node.counts(malformed=1):
        node.send(message)
    node.healthy()


def refused_in_the_end(node, message):
    """The same for a message of so many fragments that the first ones may be lost."""
    node.fresh().healthy()
    node.settle()
    before = node.counter("malformed")

    def counted():
        node.send(message)
        return node.comes_true(lambda: node.counter("malformed") > before, 0.5)

    node.until(counted, "the counter malformed")
    node.spin_for(0.5)  # Some may still be on their way.
    node.fresh().healthy()


def cloud(**values):
    """A healthy cloud with some of its sizes replaced."""
    message = message_of(traffic(0.0))
    for name, value in values.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize(
    "values",
    [
        {"point_step": 4},
        {"point_step": 0},
        {"point_step": 2**32 - 1},
        {"height": 2, "row_step": 8},
        {"width": 5},
        {"height": 3},
        {"width": 2**32 - 1, "height": 2**32 - 1},
        {"width": 2**16, "height": 2**16},
    ],
    ids=[
        "point_step too small",
        "point_step zero",
        "point_step largest",
        "row_step below a row",
        "width too large",
        "height too large",
        "width and height largest",
        "width and height beyond the data",
    ],
)
def test_sizes_that_contradict_the_data(node, values):
    refused(node, cloud(**values))
    assert node.said("input", WARN, "could not be read")


def test_a_width_below_the_data(node):
    node.fresh()
    states = node.states()
    message = message_of(states)
    message.width = 2
    node.send(message)
    prediction = node.answer(states.stamp_ns).prediction
    assert prediction.key[:, 0].tolist() == [1, 2]


def test_thousands_of_fields(node):
    fields = [
        PointField(name=f"f{i}", offset=0, datatype=PointField.UINT8, count=1)
        for i in range(20_000)
    ]
    refused(node, cloud(fields=fields))


@pytest.mark.parametrize("missing", ["x", "y", "id_0"])
def test_a_required_field_is_missing(node, missing):
    message = cloud()
    message.fields = [field for field in message.fields if field.name != missing]
    refused(node, message)


def test_every_other_field_is_missing(node):
    node.fresh()
    for _ in range(4):
        states = node.states()
        message = message_of(states)
        message.fields = [f for f in message.fields if f.name in ("x", "y", "id_0")]
        node.send(message)
        prediction = node.answer(states.stamp_ns).prediction
        check_invariants(prediction)
    node.check(prediction, states, tolerance_m=5.0)  # the velocity is estimated


CODES = {7: "<f4", 8: "<f8", 6: "<u4", 2: "u1"}
"""Numbers of sensor_msgs/PointField."""


def test_the_byte_order_is_the_other_one(node):
    node.fresh()
    states = node.states()
    message = message_of(states)
    records = np.frombuffer(
        bytes(message.data),
        dtype=[
            (f.name, {7: "<f4", 8: "<f8", 6: "<u4", 2: "u1"}[f.datatype]) for f in message.fields
        ],
    )
    message.data = records.astype(records.dtype.newbyteorder(">")).tobytes()
    message.is_bigendian = True
    node.send(message)
    node.check(node.answer(states.stamp_ns).prediction, states)


def test_the_byte_order_is_not_what_the_flag_says(node):
    node.fresh().healthy()
    states = node.states()
    node.send(cloud(is_bigendian=True, header=message_of(states).header))
    # Other identities at other places, as far as the node can know; the known ones are carried on.
    node.check(node.answer(states.stamp_ns).prediction, states, 3, served=[1, 2, 3, 4, *SWAPPED])
    node.send_and_await(node.states())
    node.fresh().healthy()


SWAPPED = [number << 24 for number in (1, 2, 3, 4)]
"""Identities 1 to 4 with their bytes in the other order."""


def test_a_message_of_zero_length(node):
    node.fresh().healthy()
    node.send(b"")  # The middleware does not deliver it.
    node.healthy()


@pytest.mark.parametrize("length", [1, 4, 20, 60, 200, -1])
def test_truncated_bytes(node, length):
    data = serialize_message(cloud())
    refused(node, data[:length])


def test_truncated_data(node):
    message = cloud()
    message.data = message.data[:100]
    refused(node, message)


def test_an_empty_message(node):
    refused(node, PointCloud2())


def test_predictions_instead_of_objects(node):
    node.fresh().healthy()
    message = node.answers[-1].message
    assert message.point_step == POINT.itemsize
    refused(node, message)


@pytest.mark.parametrize("agents", [1000, 5000, 20_000])
def test_many_objects(node, agents):
    node.fresh()
    order = np.random.default_rng(agents).permutation(agents)
    before, sent = node.counter("left_out"), set()

    def answered():
        """Return the answer to one of these messages; a late one to an earlier message is none."""
        return next((a for a in node.answers if a.prediction.stamp_ns in sent), None)

    # Of a message of so many fragments some are lost until the node subscribes reliably.
    for _ in range(50):
        states = node.states(agents, speed_mps=1.0)
        arrays = {k: v[order] for k, v in vars(states).items() if isinstance(v, np.ndarray)}
        sent.add(states.stamp_ns)
        node.send(dataclasses.replace(states, **arrays))
        if node.comes_true(answered, PERIOD_S):
            break
    node.until(answered, "a prediction")
    prediction = answered().prediction
    node.settle()
    left_out = node.counter("left_out") - before
    if agents <= 4096:
        assert left_out == 0
    else:
        assert left_out >= agents - 4096
    check_invariants(prediction)
    assert len(prediction) == min(agents, 4096)
    # Those nearest to the middle are served, the very nearest by the model (or, on a machine that
    # is too busy, by constant velocity), whatever their order in the message.
    middle = np.median(states.position[:, 0])
    distance = np.abs(prediction.mean[:, 0, 0, 0] - middle)
    assert distance.max() < 12.0 * (len(prediction) / 2 + 20)
    by_model = prediction.source == Source.MODEL
    if by_model.any() and not by_model.all():
        assert distance[by_model].max() < 12.0 * (by_model.sum() / 2 + 20)
    if agents == 20_000:
        node.level("model", WARN, "of 4096 agents")
        node.level("input", WARN, "beyond the nearest max_tracks")
    node.spin_for(PERIOD_S)
    node.fresh().healthy(steps=2)


def test_more_points_than_a_tracker_has_objects(node):
    message = cloud(width=100_000, data=bytes(100_000 * 77))
    message.point_step, message.row_step = 77, 7_700_000
    refused_in_the_end(node, message)


def test_a_message_larger_than_the_middleware_likes(node):
    message = cloud(data=bytes(17_000_000))
    refused_in_the_end(node, message)


def slow_markers(states):
    """Bytes of an array that keeps the decoder busy: 1.6 MB of the smallest nested messages."""
    marker = Marker(header=message_of(states).header, id=1, type=Marker.SPHERE)
    marker.uv_coordinates = [UVCoordinate()] * 200_000
    return serialize_message(MarkerArray(markers=[marker]))


def decoding_time_s(data):
    """Return how long the node decodes a message, on this machine and now (s)."""
    gc.disable()  # as the node does
    try:
        begun_s = time.monotonic()
        deserialize_message(data, MarkerArray)
        return time.monotonic() - begun_s
    finally:
        gc.enable()


def test_services_and_diagnostics_answer_while_a_large_message_is_decoded(marker_node):
    """Beside the time that decoding takes on the same machine: blocked, they would wait for it."""
    node = marker_node
    node.fresh()
    parameters = node.peer.create_client(GetParameters, "predictor/get_parameters")
    lifecycle = node.peer.create_client(GetState, "predictor/get_state")
    node.until(parameters.service_is_ready)
    node.until(lifecycle.service_is_ready)
    data, decoding_s, answer_s, gap_s = slow_markers(node.states()), [], [], []
    for client, request in (
        (parameters, GetParameters.Request(names=["rate"])),
        (lifecycle, GetState.Request()),
    ) * 3:
        decoding_s.append(decoding_time_s(data))
        node.settle()
        reports_ns = [node.reported_ns]
        for _ in range(2):  # the node decodes for twice that time
            node.send(data)
        begun_s = time.monotonic()
        future = client.call_async(request)
        node.until(future.done)
        answer_s.append(time.monotonic() - begun_s)
        while reports_ns[-1] - reports_ns[0] < 2e9 * decoding_s[-1]:
            have_ns = reports_ns[-1]
            node.until(lambda have_ns=have_ns: node.reported_ns > have_ns, "diagnostics")
            reports_ns.append(node.reported_ns)
        gap_s.append(np.diff(reports_ns).max() * 1e-9)
    states = node.states()
    node.send(states, kind="markers")
    node.answer(states.stamp_ns)
    # Medians, since the machine may be busy with other work at one moment or another.
    half_s = 0.5 * statistics.median(decoding_s)
    assert statistics.median(answer_s) < half_s, (answer_s, decoding_s)
    assert statistics.median(gap_s) < REPORT_S + half_s, (gap_s, decoding_s)
