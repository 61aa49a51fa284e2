# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Log lines for parameters that are given and have no effect; faults/ has those of a process."""

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from mtpgo_ros.parameters.unknown_parameters import report_unknown_parameters


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("use_sim_tim", ["no such parameter, did you mean use_sim_time?"]),
        ("camera", ["no such parameter; 'ros2 param list' shows its parameters"]),
        ("qos_overrides./objects.subscription.reliability", ["QoS of the node's topics is fixed"]),
        ("bond_disable_heartbeat_timeout", []),
    ],
)
def test_a_parameter_without_effect_gets_one_warning(peer, capfd, name, words):
    node = Node("asked", parameter_overrides=[Parameter(name, value="reliable")])
    report_unknown_parameters(node, [])
    node.destroy_node()
    lines = [line for line in capfd.readouterr().err.splitlines() if "has no effect" in line]
    assert len(lines) == len(words)
    for line, word in zip(lines, words, strict=True):
        assert line.startswith("[WARN]")
        assert f"parameter {name} has no effect" in line
        assert word in line
