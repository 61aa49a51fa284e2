# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of the live calibration."""

from __future__ import annotations

from dataclasses import dataclass

from mtpgo_core.options import check_options, option

OFF, SHIPPED, ONLINE = "off", "shipped", "online"
CALIBRATIONS = (ONLINE, SHIPPED, OFF)
"""What is applied to a model's output: nothing, the calibration in its file, or that one corrected
by what became known of earlier predictions."""

MODEL, BEST = "model", "best"
PREFERENCES = (MODEL, BEST)
"""Who predicts: the model wherever it can, or constant velocity for the groups of road users in
which it has been better."""


@dataclass(frozen=True)
class LiveOptions:
    """What is learned from outcomes, and how fast.

    The defaults of the rates were chosen on predictions of models that had not seen the site
    (docs/design.md, "Live calibration").

    Attributes:
        calibration: one of :data:`CALIBRATIONS`.
        prefer: one of :data:`PREFERENCES`.
        correct_paths: with ``online``, whether the model's paths are corrected, too.
        memory_s: time after which a group of which nothing has become known has forgotten 63 % of
            its factors, and the path correction 63 % of what it knows (s).
        prefer_time_s: time for which the other predictor must have been better (s).
        prefer_agents: number of road users of the group within that time.
        rate_90: change of the logarithm of the 90 % ellipse's size per second, times the
            difference of the share of misses from 10 % (1/s).
        rate_50: the same of the 50 % ellipse (1/s).
        coupling: share of a change of the 50 % ellipse that the 90 % ellipse follows at once.
        least_agents: road users of a group below which it moves along with all groups.
        track_limit: most that one track may have moved a logarithm of a factor within
            ``track_memory_s``; more where there are fewer than ten road users, of all classes.
        track_memory_s: time over which this is counted (s).
        path_ridge: added to the diagonal of the path correction's equations, as much as one road
            user whose features are 1 adds in as many seconds.
        path_doubt: seconds of proposals without effect from which the belief in the path
            correction begins.
    """

    calibration: str = option(ONLINE, choices=CALIBRATIONS)
    prefer: str = option(MODEL, choices=PREFERENCES)
    correct_paths: bool = True
    memory_s: float = option(600.0, low=1.0)
    prefer_time_s: float = option(60.0, low=1.0)
    prefer_agents: int = option(10, low=1)
    rate_90: float = option(0.11, above=0.0, high=1.0)
    rate_50: float = option(0.12, above=0.0, high=1.0)
    coupling: float = option(0.5, low=0.0, high=1.0)
    least_agents: float = option(4.0, low=1.0)
    track_limit: float = option(0.05, above=0.0, high=1.0)
    track_memory_s: float = option(60.0, above=0.0)
    path_ridge: float = option(3.0, above=0.0)
    path_doubt: float = option(50.0, above=0.0)

    def __post_init__(self) -> None:
        check_options(self, "live.")

    @property
    def learns_factors(self) -> bool:
        """Whether covariances are corrected by outcomes."""
        return self.calibration == ONLINE

    @property
    def learns_paths(self) -> bool:
        """Whether the model's paths are corrected by outcomes."""
        return self.learns_factors and self.correct_paths

    @property
    def watches(self) -> bool:
        """Whether outcomes are needed at all."""
        return self.learns_factors or self.prefer == BEST
