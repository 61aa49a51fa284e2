# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Calibration of a model: factors on its covariances and temperatures of its mode weights.

Both are fitted to recordings that the model was not trained on and are stored with the model
(docs/design.md, "Calibration"). There is one entry for each class group, moving and standing. The
class group ``any`` is fitted to all classes together and serves road users whose class is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import check_options, listed, option, require
from mtpgo_core.schema import MOVING_MPS, AgentClass, BoolArray, ClassArray, Float64Array

GroupArray = NDArray[np.uint8]
"""Positions in :data:`GROUPS`."""

CLASS_GROUPS: dict[str, tuple[AgentClass, ...]] = {
    "vehicle": (
        AgentClass.CAR,
        AgentClass.VAN,
        AgentClass.TRUCK,
        AgentClass.BUS,
        AgentClass.TRAILER,
    ),
    "two_wheeler": (AgentClass.MOTORCYCLE, AgentClass.BICYCLE),
    "pedestrian": (AgentClass.PEDESTRIAN,),
    "any": (AgentClass.UNKNOWN, AgentClass.ANIMAL),
}
"""Classes that are calibrated together; ``any`` is fitted to the road users of all groups."""

MOTIONS = ("standing", "moving")
"""Speed at t up to ``MOVING_MPS``, and above. Where it was never known, nothing says that the road
user stands, and it counts as moving."""

GROUPS = tuple(f"{name}_{motion}" for name in CLASS_GROUPS for motion in MOTIONS)
"""Names of the calibrated groups. The group of class group c and motion m is entry 2 c + m."""

FACTOR_LIMITS = (0.1, 30.0)
"""Smallest and largest factor on a covariance; chosen: a larger correction than 0.3 to 5.5
times the standard deviation would hide a model that does not work."""

TEMPERATURE_LIMITS = (0.3, 5.0)
"""Smallest and largest temperature; chosen: 0.3 turns weights of 0.6 and 0.4 into 0.79 and 0.21, 5
into 0.52 and 0.48."""

SIGMA_FACTOR_50_LIMITS = (0.2, 1.44)
"""Smallest and largest factor on the standard deviations for the 50 % ellipse. Up to 1.445 the
ellipses of all levels lie within each other: that is exp((R90 - R50) / R) with the largest
Mahalanobis radius R at which ``metrics.sigma_factor`` still falls, R90 + (R90 - R50) / 2. The
smallest is chosen: of road users that stand, most stay exactly where they are."""

_CLASS_INDEX = np.full(256, list(CLASS_GROUPS).index("any"), dtype=np.uint8)
for _index, _members in enumerate(CLASS_GROUPS.values()):
    _CLASS_INDEX[[int(member) for member in _members]] = _index


def calibration_groups(agent_class: ClassArray, velocity: Float64Array) -> GroupArray:
    """Return [n] the calibrated group of each road user, as a position in :data:`GROUPS`.

    Args:
        agent_class: [n] :class:`~mtpgo_core.schema.AgentClass` values.
        velocity: [n, 2] at t (m/s), NaN where it was never known.
    """
    squared = velocity[:, 0] ** 2 + velocity[:, 1] ** 2
    moving = ~(squared <= MOVING_MPS**2)
    return 2 * _CLASS_INDEX[agent_class] + moving.astype(np.uint8)


def is_moving(group: GroupArray) -> BoolArray:
    """Return [n] whether groups of :func:`calibration_groups` are of moving road users."""
    return np.asarray(group % len(MOTIONS) == MOTIONS.index("moving"))


@dataclass(frozen=True)
class GroupCalibration:
    """Calibration of one group.

    Attributes:
        name: one of :data:`GROUPS`.
        factors: [H] factors on the covariance at each horizon step, not decreasing.
        temperature: T; mode weights become w^(1/T), normalised.
        agents: predictions (a road user at an instant) that it was fitted to.
        sites: sites that these are from.
        sigma_factors_50: [H] factors on the standard deviations for the 50 % ellipses, see
            :class:`~mtpgo_core.schema.Prediction`; without any, as in files of earlier versions,
            they are 1.
    """

    name: str = option("any_moving", choices=GROUPS)
    factors: tuple[float, ...] = option((), low=FACTOR_LIMITS[0], high=FACTOR_LIMITS[1])
    temperature: float = option(1.0, low=TEMPERATURE_LIMITS[0], high=TEMPERATURE_LIMITS[1])
    agents: int = option(0, low=0)
    sites: int = option(0, low=0)
    sigma_factors_50: tuple[float, ...] = option(
        (), low=SIGMA_FACTOR_50_LIMITS[0], high=SIGMA_FACTOR_50_LIMITS[1]
    )

    def __post_init__(self) -> None:
        check_options(self, "calibration.")
        steps = range(1, len(self.factors))
        drop = next((k for k in steps if self.factors[k] < self.factors[k - 1]), None)
        if drop is not None:
            raise ConfigurationError(
                f"calibration.factors of {self.name} fall from {self.factors[drop - 1]:g} to "
                f"{self.factors[drop]:g} at step {drop + 1}, expected factors that do not decrease"
            )
        given, expected = len(self.sigma_factors_50), len(self.factors)
        if given not in (0, expected):
            raise ConfigurationError(
                f"calibration.sigma_factors_50 of {self.name} are {given}, expected none or one "
                f"for each of the {expected} steps"
            )


@dataclass(frozen=True)
class CalibrationSite:
    """A site that a calibration was fitted to.

    Attributes:
        name: of the site.
        agents: predictions (a road user at an instant) from there.
    """

    name: str
    agents: int


@dataclass(frozen=True)
class CalibrationOrigin:
    """Where groups were fitted that an adaptation kept from the model that it began with.

    Attributes:
        sites: where they were fitted.
        left_out: see :class:`Calibration`.
    """

    sites: tuple[CalibrationSite, ...] = ()
    left_out: bool = False


@dataclass(frozen=True)
class Calibration:
    """Factors on covariances and temperatures of mode weights; without groups, none.

    Attributes:
        groups: all of :data:`GROUPS` in this order, or none.
        sites: where it was fitted.
        left_out: whether these sites were left out of the training of the models whose
            predictions it was fitted to (a cross-validation), or are validation recordings of the
            model itself.
        base: of an adapted model, where the groups were fitted that it kept from the model that it
            was adapted from, and before that.
    """

    groups: tuple[GroupCalibration, ...] = ()
    sites: tuple[CalibrationSite, ...] = ()
    left_out: bool = False
    base: tuple[CalibrationOrigin, ...] = ()

    def __post_init__(self) -> None:
        names = tuple(group.name for group in self.groups)
        require("calibration.groups", names, names in ((), GROUPS), f"none or {listed(GROUPS)}")
        lengths = sorted({len(group.factors) for group in self.groups})
        require("length of calibration.factors", lengths, len(lengths) <= 1, "the same for all")

    @property
    def is_none(self) -> bool:
        """Whether there is nothing to apply."""
        return not self.groups

    @property
    def horizon_steps(self) -> int:
        """H that it is fitted for, 0 without groups."""
        return len(self.groups[0].factors) if self.groups else 0

    @cached_property
    def factor_table(self) -> Float64Array:
        """[groups, H] factors on the covariances."""
        return np.array([group.factors for group in self.groups], dtype=np.float64)

    @cached_property
    def sigma_factor_50_table(self) -> Float64Array:
        """[groups, H] factors on the standard deviations for the 50 % ellipses."""
        none = (1.0,) * self.horizon_steps
        rows = [group.sigma_factors_50 or none for group in self.groups]
        return np.array(rows, dtype=np.float64)

    @cached_property
    def inverse_temperatures(self) -> Float64Array:
        """[groups] 1 / T."""
        return 1.0 / np.array([group.temperature for group in self.groups], dtype=np.float64)
