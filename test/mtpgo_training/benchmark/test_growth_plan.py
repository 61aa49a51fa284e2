# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The measurements that the growth benchmark makes of the node."""

from mtpgo_training.benchmark.growth_plan import GrowthPlan


def test_the_node_is_measured_over_sizes_input_rates_and_markers():
    plan = GrowthPlan(agents=(8, 512), input_rates=(25.0, 100.0), seconds=3.0)
    assert [(c.agents, c.rate) for c in plan.node_cases()] == [(8, 1.0), (512, 1.0)]
    assert [(c.agents, c.input_rate) for c in plan.input_cases()] == [(128, 25.0), (128, 100.0)]
    assert [c.markers for c in plan.marker_cases()] == [False, True]
