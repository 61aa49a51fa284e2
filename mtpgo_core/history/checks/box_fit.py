# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plausibility of vehicle boxes: they are longer than wide and do not contain each other."""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import AgentClass, BoolArray, ClassArray, Float64Array, HistoryWindow

VEHICLES = (AgentClass.CAR, AgentClass.TRUCK, AgentClass.BUS, AgentClass.VAN)
"""Classes of road users that are longer than wide, with no other one in them."""

_NEAREST_M = 1.0
"""Centres of two vehicles are not nearer than this (m); chosen: most are 1.7 m wide and more."""

_SAMPLES = 4
"""Samples of the past that a vehicle must have; chosen."""

_CHECKED = 256
"""Vehicles that are looked at, at most; chosen: the cost stays below a millisecond or two."""

_FORGET = 0.95
"""Share of the counts that is kept from one look to the next: twenty looks count; chosen."""

_ENOUGH = 40.0
"""Vehicles, counted once for each look, from which on a verdict is given; chosen."""

_WIDE_SHARE, _DOUBLE_SHARE = 0.5, 0.3
"""Shares of them that are wider than long, or within 1 m of another, from which on the source is
mistaken; chosen: of two trackers with the same vehicles all would be."""


class BoxFit:
    """Checks the boxes of vehicles; call :meth:`look` with one window a second."""

    def __init__(self) -> None:
        self._sized = self._wide = self._vehicles = self._double = 0.0

    def look(self, window: HistoryWindow) -> None:
        """Check the vehicles of a window that have been tracked for a moment.

        Args:
            window: of the history. New tracks are ignored: the history extrapolates a lost track
                for a moment, beside the new track of the same vehicle.
        """
        there = window.valid[:, -_SAMPLES:].all(axis=1)
        self.compare(window.position[there, -1], window.size[there], window.agent_class[there])

    def compare(self, position: Float64Array, size: Float64Array, agent_class: ClassArray) -> None:
        """Check the vehicles of an instant; the counts of earlier instants decay.

        Args:
            position: [n, 2] (m).
            size: [n, 2] length and width (m), NaN where unknown.
            agent_class: [n] :class:`~mtpgo_core.schema.AgentClass` values.
        """
        which = np.flatnonzero(np.isin(agent_class, VEHICLES))[:_CHECKED]
        known = size[which][np.isfinite(size[which]).all(axis=1)]
        self._sized = _FORGET * self._sized + len(known)
        self._wide = _FORGET * self._wide + int((known[:, 1] > known[:, 0]).sum())
        self._vehicles = _FORGET * self._vehicles + len(which)
        self._double = _FORGET * self._double + int(_near_another(position[which]).sum())

    @property
    def size_problem(self) -> str:
        """Sentence saying that vehicles are wider than long; empty if not, or too few are seen."""
        if self._sized < _ENOUGH or self._wide < _WIDE_SHARE * self._sized:
            return ""
        share = 100 * self._wide / self._sized
        return f"{share:.0f} % of the vehicles are wider than long: are the two exchanged?"

    @property
    def double_problem(self) -> str:
        """Sentence saying that vehicles are listed twice; empty if not, or too few were seen."""
        if self._vehicles < _ENOUGH or self._double < _DOUBLE_SHARE * self._vehicles:
            return ""
        share = 100 * self._double / self._vehicles
        return (
            f"{share:.0f} % of the vehicles are within {_NEAREST_M:g} m of another one, so they"
            " are there twice, as from two trackers"
        )


def _near_another(position: Float64Array) -> BoolArray:
    """Return [n] which positions [n, 2] have another one within :data:`_NEAREST_M`."""
    with np.errstate(over="ignore"):  # of positions that are defects
        apart = position[:, None] - position[None]
        near = np.hypot(apart[..., 0], apart[..., 1]) < _NEAREST_M
    return np.asarray(near.sum(axis=1) > 1)
