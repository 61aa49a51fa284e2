# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Answers to impossible transitions, by direct calls; over DDS in the fault tests."""

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode

from mtpgo_ros.lifecycle.lifecycle_answers import answer_invalid_transitions, state_of


@pytest.fixture
def change():
    """A function that requests a transition, and the node."""
    node = LifecycleNode("answering")
    answer_invalid_transitions(node)

    def change(**transition):
        request = ChangeState.Request(transition=Transition(**transition))
        return node._service_change_state.callback(request, ChangeState.Response()).success

    yield change, node
    node.destroy_node()


def test_every_request_is_answered(change):
    request, node = change
    assert not request(id=Transition.TRANSITION_ACTIVATE)
    assert not request(id=200)
    assert not request(label="explode")
    assert state_of(node) == "unconfigured"
    assert request(id=Transition.TRANSITION_CONFIGURE)
    assert not request(id=Transition.TRANSITION_CONFIGURE)
    assert state_of(node) == "inactive"
    assert request(label="activate")
    assert state_of(node) == "active"
