# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What ``mtpgo benchmark growth`` measures."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from mtpgo_training.benchmark.node_case import NodeCase

IDLE_RATE_HZ = 0.1
"""Rate of predictions (Hz) at which the node's processor time is that of its input. Chosen: none
is due in a measurement of less than 10 s."""


@dataclass(frozen=True)
class GrowthPlan:
    """What is measured.

    Attributes:
        agents: numbers of road users.
        graph: graph policy.
        input_rates: rates of observations (Hz).
        input_agents: objects in each message of the measurements over ``input_rates``.
        seconds: measured time of each size of the pipeline and of each case of the node (s).
        with_node: measure the node too, not only the pipeline.
    """

    agents: tuple[int, ...] = (8, 16, 32, 64, 128, 256, 512)
    graph: str = "cover"
    input_rates: tuple[float, ...] = (5.0, 10.0, 25.0, 50.0, 100.0)
    input_agents: int = 128
    seconds: float = 10.0
    with_node: bool = True

    def node_cases(self) -> list[NodeCase]:
        """Return the cases over the agents, at 1 Hz, slow enough for the largest scene."""
        return [NodeCase(n, self.graph, rate=1.0, duration_s=self.seconds) for n in self.agents]

    def input_cases(self) -> list[NodeCase]:
        """Return the cases over the input rates, practically without predictions."""
        return [
            NodeCase(self.input_agents, self.graph, IDLE_RATE_HZ, rate, self.seconds)
            for rate in self.input_rates
        ]

    def marker_cases(self) -> list[NodeCase]:
        """Return two cases of the same load, markers without and with a subscriber."""
        without = NodeCase(64, self.graph, duration_s=self.seconds)
        return [without, dataclasses.replace(without, markers=True)]
