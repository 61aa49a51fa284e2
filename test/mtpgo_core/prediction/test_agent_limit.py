# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The number of agents follows the time that the model needs for them."""

import pytest

from mtpgo_core.prediction.agent_limit import AgentLimit


def settle(per_agent_s, cycles, limit=None, wanted=1000, allowed_s=0.1):
    """Predict for some cycles; return the limit and the agents of each cycle."""
    limit, agents = limit or AgentLimit(), []
    for _ in range(cycles):
        agents.append(wanted if limit.agents is None else min(wanted, limit.agents))
        limit.add(agents[-1], wanted, per_agent_s * agents[-1], allowed_s)
    return limit, agents


def test_it_falls_at_once_and_stays_within_the_allowed_time():
    _, agents = settle(per_agent_s=0.001, cycles=100)
    assert agents[0] == 1000
    assert all(70 <= n <= 100 for n in agents[2:])


def test_it_rises_when_there_is_time_again_and_ends():
    limit, _ = settle(per_agent_s=0.001, cycles=10)
    limit, agents = settle(per_agent_s=0.00005, cycles=60, limit=limit)
    assert limit.agents is None
    assert agents[-1] == 1000


def test_it_rises_slowly_and_doubles_in_seven_predictions():
    limit = AgentLimit()
    limit.add(250, 1000, took_s=0.2, allowed_s=0.1)
    assert limit.agents == 100  # 0.8 of what fits into the time
    _, agents = settle(per_agent_s=0.0001, cycles=8, limit=limit)
    assert agents[6] < 200 <= agents[7] < 220


@pytest.mark.parametrize("took_s", [1.0, 1e9])
def test_it_never_falls_below_a_small_graph(took_s):
    limit = AgentLimit()
    limit.add(64, 64, took_s, 0.1)
    assert limit.agents == 8 if took_s > 1 else limit.agents >= 8


def test_without_overload_there_is_none():
    assert settle(per_agent_s=0.00005, cycles=10)[0].agents is None
