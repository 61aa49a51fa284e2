# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The layouts of recordings by name, and the reader of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit

UnitFinder = Callable[[Path, Sequence[str] | None, ReadingOptions], list[Unit]]
"""Finds the files to be read together in a directory, all or those with some names."""


LAYOUTS = (
    *("highd", "ind", "round", "unid", "exid"),
    *("ngsim", "table", "interaction", "sind", "dut", "citr", "eth_ucy", "openacc"),
    *("nuscenes", "argoverse2", "waymo", "bag"),
)
"""Names of the layouts."""


def finder_of(layout: str) -> UnitFinder:
    """Return the finder of the files in a directory.

    Its module is imported here: tables need pandas, bags the message adapters and rosbags, and
    the completion of a command line needs the names alone.

    Args:
        layout: a name in ``LAYOUTS``.

    Raises:
        RecordingError: an unknown layout.
    """
    if layout not in LAYOUTS:
        raise RecordingError(
            f"the layout {layout!r} is unknown, expected one of {', '.join(LAYOUTS)}"
        )
    match layout:
        case "ngsim":
            from mtpgo_training.data.readers.ngsim.ngsim_recordings import ngsim_units

            return ngsim_units
        case "table":
            from mtpgo_training.data.readers.tables.table_recordings import table_units

            return table_units
        case "interaction":
            from mtpgo_training.data.readers.datasets.interaction_recordings import (
                interaction_units,
            )

            return interaction_units
        case "sind":
            from mtpgo_training.data.readers.datasets.interaction_recordings import sind_units

            return sind_units
        case "dut" | "citr":
            from mtpgo_training.data.readers.datasets.crowd_recordings import crowd_units

            return partial(crowd_units, layout)
        case "eth_ucy":
            from mtpgo_training.data.readers.datasets.eth_recordings import eth_units

            return eth_units
        case "openacc":
            from mtpgo_training.data.readers.datasets.openacc_recordings import openacc_units

            return openacc_units
        case "nuscenes":
            from mtpgo_training.data.readers.fleets.nuscenes_recordings import nuscenes_units

            return nuscenes_units
        case "argoverse2":
            from mtpgo_training.data.readers.fleets.argoverse_recordings import argoverse_units

            return argoverse_units
        case "waymo":
            from mtpgo_training.data.readers.fleets.waymo_recordings import waymo_units

            return waymo_units
        case "bag":
            from mtpgo_training.data.readers.bags.bag_recordings import bag_units

            return bag_units
    from mtpgo_training.data.readers.drone_recordings import drone_units

    return partial(drone_units, layout)
