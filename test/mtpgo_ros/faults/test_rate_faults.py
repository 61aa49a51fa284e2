# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""More messages than a node can decode, of one publisher and of many, over real DDS."""

import dataclasses
import threading
import time

import numpy as np
import pytest
from fault_harness import OK, WARN, check_invariants
from fault_tools import Resources
from rclpy.serialization import serialize_message
from ros_helpers import message_of, traffic

from mtpgo_core.identity import keys_from_integers

RATE_HZ, DURATION_S, PERIOD_S = 1000, 3.0, 0.2


@pytest.fixture(scope="module")
def node(start_predictor):
    """The predictor of this module."""
    return start_predictor(own_diagnostics=True)


def send_fast(node):
    """Publish 64 road users at 1000 Hz from a thread while the harness receives."""
    begin_s = node.time_s
    messages = [
        bytes(serialize_message(message_of(traffic(begin_s + number / RATE_HZ, 64))))
        for number in range(1, round(RATE_HZ * DURATION_S) + 1)
    ]

    def send():
        start_s = time.monotonic()
        for number, message in enumerate(messages):
            time.sleep(max(0.0, start_s + number / RATE_HZ - time.monotonic()))
            node.objects.publish(message)

    thread = threading.Thread(target=send)
    thread.start()
    node.until(lambda: not thread.is_alive(), "the end of the stream")
    node.time_s = begin_s + DURATION_S


def test_a_thousand_hertz_of_64_road_users(node):
    node.fresh().healthy(64, steps=3)
    before, first, seen = Resources(node), len(node.answers), len(node.seen)
    send_fast(node)
    node.healthy(64)
    answers = [answer.prediction for answer in node.answers[first:]]
    stamps = [prediction.stamp_ns for prediction in answers]
    assert stamps == sorted(set(stamps))
    assert len(stamps) <= DURATION_S / PERIOD_S + 2
    for prediction in answers:
        check_invariants(prediction)
        assert len(prediction) == 64
    # What was missed is told: messages that were not decoded, or cycles without their prediction.
    said = [level for name, level, _ in node.seen[seen:] if name in ("input", "timing")]
    assert len(stamps) >= DURATION_S / PERIOD_S - 1 or WARN in said
    node.fresh().level_while_healthy("input", OK)
    before.check()


def test_twenty_publishers_that_send_at_once(node):
    """None is crowded out by the others: each has road users of its own, and all are predicted."""
    others = [node.publisher() for _ in range(19)]
    node.until(lambda: all(one.get_subscription_count() for one in others), "a subscription")

    def burst():
        """Return which road users were predicted of a burst."""
        node.states()
        for number, publisher in enumerate((node.objects, *others)):
            states = traffic(node.time_s, 3)
            own = dataclasses.replace(
                states,
                key=keys_from_integers(range(3 * number + 1, 3 * number + 4)),
                position=states.position + np.array([0.0, 30.0 * number]),
            )
            node.send(own, publisher)
        node.spin_for(PERIOD_S)
        return node.answers[-1].prediction.key[:, 0].tolist()

    node.fresh()
    node.until(lambda: len(burst()) == 60, "60 road users")
    # And again and again, not by chance.
    assert any(all(len(burst()) == 60 for _ in range(5)) for _ in range(3))
    for publisher in others:
        node.peer.destroy_publisher(publisher)
