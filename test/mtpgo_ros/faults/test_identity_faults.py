# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Identities that are repeated, reused, exchanged or shared, over real DDS."""

import dataclasses
import uuid

import numpy as np
from fault_harness import WARN, check_invariants
from ros_helpers import START_NS, message_of, traffic

from mtpgo_core.identity import keys_from_integers, keys_from_texts


def with_ids(states, ids):
    return dataclasses.replace(states, key=keys_from_integers(ids))


def moved(states, metres, rows=slice(None)):
    position = states.position.copy()
    position[rows] += metres
    return dataclasses.replace(states, position=position)


def test_an_identity_twice_in_a_message(node):
    node.fresh().healthy()
    with node.counts(duplicate_keys=1):
        # The first of the two is used.
        node.predict(with_ids(node.states(), [1, 2, 3, 3]), 0, 1, 2, served=[1, 2, 3, 4])
    node.healthy()


def test_an_identity_reused_at_another_place(node):
    node.fresh().healthy(steps=3)
    with node.counts(restarted=1, alternating=0):
        node.predict(moved(node.states(), (0.0, 300.0), rows=1))
        node.predict(moved(node.states(), (0.0, 300.0), rows=1))
    assert node.said("input", WARN, "restarted")


def test_an_identity_changed_without_a_move(node):
    node.fresh().healthy(steps=2)
    with node.counts(restarted=0):
        # The new one is predicted from its first sample; the old one is carried on for 0.5 s.
        node.predict(with_ids(node.states(), [1, 20, 3, 4]), served=[1, 2, 3, 4, 20])
        for _ in range(2):
            node.send_and_await(with_ids(node.states(), [1, 20, 3, 4]))
        node.predict(with_ids(node.states(), [1, 20, 3, 4]))


def test_two_publishers_of_the_same_road_users(node):
    second = node.publisher()
    node.until(lambda: second.get_subscription_count() > 0)
    node.fresh()
    with node.counts(duplicates=8, alternating=0, restarted=0):
        for _ in range(2):
            states = node.states()
            node.predict(states)
            node.send(states, second)
    node.peer.destroy_publisher(second)
    node.healthy()


def alternate(node, second, metres):
    """Publish the traffic, and half a period later the same with the first road user aside.

    Only one of the two observations is due; the others' predictions must be right in both.
    """
    have = len(node.answers)
    node.send(node.states())
    node.spin_for(0.02)  # The order of two publishers is not defined.
    node.send(moved(traffic(node.time_s + 0.1), (0.0, metres), rows=0), second)
    node.until(lambda: len(node.answers) > have, "a prediction")
    for answer in node.answers[have:]:
        check_invariants(answer.prediction)
        time_s = round((answer.prediction.stamp_ns - START_NS) * 1e-9, 3)
        for row in (1, 2, 3):
            node.check_right(answer.prediction, traffic(time_s), row, 0.05)


def test_two_publishers_with_the_same_identities_metres_apart(node):
    second = node.publisher()
    node.until(lambda: second.get_subscription_count() > 0)
    node.fresh().healthy(steps=2)
    before = node.counter("alternating")
    for _ in range(8):
        alternate(node, second, 2.5)
    node.until(lambda: node.counter("alternating") > before, "the counter alternating")
    node.level("input", WARN, "alternate between two places")
    node.peer.destroy_publisher(second)
    node.fresh().healthy()


def test_two_publishers_with_the_same_identities_far_apart(node):
    second = node.publisher()
    node.until(lambda: second.get_subscription_count() > 0)
    node.fresh().healthy(steps=2)
    before = node.counter("restarted")
    for _ in range(3):
        alternate(node, second, 50.0)
    node.until(lambda: node.counter("restarted") >= before + 2, "the counter restarted")
    node.peer.destroy_publisher(second)
    node.fresh().healthy()


def test_integers_of_128_bits_and_uuids(node):
    large = [1, (1 << 32) + 1, (1 << 127) + 1, uuid.UUID("0123456789abcdef0123456789abcdef").int]
    node.fresh()
    for _ in range(2):
        states = with_ids(node.states(), large)
        node.send(states)
        prediction = node.answer(states.stamp_ns).prediction
    assert sorted(map(tuple, prediction.key)) == sorted(map(tuple, keys_from_integers(large)))
    for row in range(4):
        node.check_right(prediction, states, row, 0.05)


def test_texts_and_negative_numbers(marker_node):
    marker_node.fresh()
    for _ in range(2):
        states = marker_node.states()
        message = message_of(states, "markers")
        for marker, (name, number) in zip(
            message.markers, [("", 7), ("", -7), ("a/Ж\u200b", 7), ("x" * 10_000, 7)], strict=True
        ):
            marker.ns, marker.id = name, number
        marker_node.send(message)
        prediction = marker_node.answer(states.stamp_ns).prediction
    assert len(np.unique(prediction.key, axis=0)) == 4
    found = {tuple(key) for key in prediction.key.tolist()}
    assert tuple(keys_from_texts(["7"])[0].tolist()) in found
