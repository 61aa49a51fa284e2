# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines of a recording as a GeoJSON file in its own frame."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from mtpgo_core.schema import Float64Array
from mtpgo_training.atomic_files import write_text


def write_lanes(lanes: Sequence[Float64Array], path: Path) -> None:
    """Write lane lines (m), one feature each; without lines remove the file.

    Raises:
        ConfigurationError: the file cannot be written.
    """
    if not lanes:
        path.unlink(missing_ok=True)
        return
    features = [
        {
            "type": "Feature",
            "properties": {},
            "geometry": {"type": "LineString", "coordinates": line.round(3).tolist()},
        }
        for line in lanes
    ]
    collection = {"type": "FeatureCollection", "features": features}
    write_text(path, json.dumps(collection) + "\n")
