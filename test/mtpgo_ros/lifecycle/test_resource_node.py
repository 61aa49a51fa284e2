# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A destroyed node is out of the domain."""

import gc
import os
import sys

import pytest
from rclpy.context import Context
from rclpy.parameter import Parameter
from ros_helpers import held_locks

from mtpgo_ros.node.predictor_node import PredictorNode
from mtpgo_ros.risk_node.risk_lifecycle import RiskNode


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc/locks")
@pytest.mark.parametrize("kind", [PredictorNode, RiskNode])
def test_a_node_leaves_the_domain_also_while_others_refer_to_its_parts(models, kind):
    given = [Parameter("model", value=str(models["quick"]))] if kind is PredictorNode else []
    context = Context()
    context.init()
    before = held_locks(os.getpid())
    node = kind(context=context, parameter_overrides=given)
    parts = [*node.services, *node.publishers, node._state_machine]
    for transition in (node.trigger_configure, node.trigger_activate):
        assert str(transition()).endswith("SUCCESS"), node.failure
    assert len(held_locks(os.getpid()) - before) >= 2, "a segment and a port"
    gc.disable()
    try:
        node.stop()
        node.destroy_node()
        assert not held_locks(os.getpid()) - before
    finally:
        gc.enable()
    assert parts  # referred to until now
    context.shutdown()
