# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of a lane file: projection, origin and offset of its coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import check_options, option
from mtpgo_core.schema import FARTHEST_M

AUTO, LOCAL = "auto", "local"
UTM, MGRS, TRANSVERSE_MERCATOR, CARTESIAN = "utm", "mgrs", "transverse_mercator", "cartesian"
PROJECTIONS = (AUTO, LOCAL, UTM, MGRS, TRANSVERSE_MERCATOR, CARTESIAN)
"""How coordinates become metres, see docs/node.md, "Lane files"."""


@dataclass(frozen=True)
class LaneFileOptions:
    """How the coordinates of a lane file become metres.

    Attributes:
        projection: ``auto``: what the file has in metres; ``local``: metres, in OSM the tags
            ``local_x`` and ``local_y``; the others project latitude and longitude (WGS84).
        origin: latitude and longitude of the origin, ``"49.01, 8.43"`` (degrees); empty for none.
        offset: x and y that are subtracted from every point, ``"x, y"`` (m); empty for none.
    """

    projection: str = option(AUTO, choices=PROJECTIONS)
    origin: str = ""
    offset: str = ""

    def __post_init__(self) -> None:
        check_options(self, "lane_")
        if max(map(abs, self.offset_m)) > FARTHEST_M:
            raise ConfigurationError(
                f"lane_offset is {self.offset!r}, expected x and y up to {FARTHEST_M:g} m"
            )
        place = self.origin_deg
        if place is None:
            if self.projection in (TRANSVERSE_MERCATOR, CARTESIAN):
                raise ConfigurationError(
                    f"lane_origin is not given for lane_projection {self.projection!r}, expected"
                    " latitude and longitude, such as '49.01, 8.43'"
                )
        elif abs(place[0]) > 90.0 or abs(place[1]) > 180.0:
            raise ConfigurationError(
                f"lane_origin is {self.origin!r}, expected latitude and longitude: -90 to 90 and"
                " -180 to 180 degrees"
            )

    @property
    def origin_deg(self) -> tuple[float, float] | None:
        """Latitude and longitude of the origin (degrees), None if it is not given."""
        return _pair("lane_origin", self.origin, "latitude and longitude, such as '49.01, 8.43'")

    @property
    def offset_m(self) -> tuple[float, float]:
        """What is subtracted from x and y (m)."""
        return _pair("lane_offset", self.offset, "x and y (m), such as '1000, -250.5'") or (
            0.0,
            0.0,
        )


def _pair(name: str, text: str, expected: str) -> tuple[float, float] | None:
    """Return the two finite numbers of a text, separated by a comma or blanks; None if empty."""
    if not text.strip():
        return None
    try:
        first, second = map(float, text.replace(",", " ").split())
    except ValueError:
        first = second = math.nan
    if not (math.isfinite(first) and math.isfinite(second)):
        raise ConfigurationError(f"{name} is {text!r}, expected {expected}")
    return first, second


AS_IN_FILE = LaneFileOptions()
"""Nothing is said: the metres of the file."""
