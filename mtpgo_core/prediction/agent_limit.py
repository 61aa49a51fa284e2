# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Adapts the number of agents that the model predicts to the time that it takes."""

from __future__ import annotations

_LEAST = 8
"""The limit does not fall below this: a graph of so few agents takes no longer than one agent."""

_RESERVE = 0.8
"""Share of the allowed time that is aimed at after a prediction took too long; chosen."""

_ROOM = 0.7
"""The limit rises while a prediction takes less than this share of the allowed time; chosen below
:data:`_RESERVE`, so that it does not fall again at once."""

_RISE = 1.1
"""Factor of a rise per prediction; chosen: it doubles in seven."""


class AgentLimit:
    """A limit that falls at once when a prediction takes too long, and rises slowly when not.

    Attributes:
        agents: most agents for the next prediction, None for no limit.
    """

    def __init__(self) -> None:
        self.agents: int | None = None

    def add(self, agents: int, wanted: int, took_s: float, allowed_s: float) -> None:
        """Take the duration of a prediction into account.

        Args:
            agents: how many the model predicted.
            wanted: how many it would have predicted without this limit.
            took_s: how long it took (s).
            allowed_s: how long it may take (s).
        """
        if took_s > allowed_s:
            self.agents = max(_LEAST, int(agents * _RESERVE * allowed_s / took_s))
        elif self.agents is not None and agents >= self.agents and took_s < _ROOM * allowed_s:
            self.agents = int(self.agents * _RISE) + 1
        if self.agents is not None and self.agents >= wanted and took_s <= allowed_s:
            self.agents = None
