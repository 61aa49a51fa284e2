# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a user says about the files of a directory, besides their layout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from mtpgo_core.class_map import ClassMap, class_map
from mtpgo_core.maps.lane_file import read_lane_file
from mtpgo_core.maps.lane_file_options import AS_IN_FILE, LaneFileOptions
from mtpgo_core.maps.lane_lines import LaneLines
from mtpgo_core.options import listed
from mtpgo_core.schema import ClassArray
from mtpgo_training.data.readers.bags.bag_options import BagOptions
from mtpgo_training.data.readers.checks.reading_remarks import remark

MOST_NAMES = 5
"""Names of classes listed in a warning; chosen."""


@dataclass(frozen=True)
class ReadingOptions:
    """How the files of a directory are to be read.

    Attributes:
        columns: file that describes the columns of a plain table (layout ``table``).
        class_map: preset or YAML file with our classes by the names and numbers of the data,
            empty for the names that the layout usually has.
        bags: how bags are read (layout ``bag``).
        lane_file: file with the lanes of the site, in place of those of the recordings.
        lane_options: how its coordinates become metres of the recordings' frame.
    """

    columns: Path | None = None
    class_map: str = ""
    bags: BagOptions = field(default_factory=BagOptions)
    lane_file: Path | None = None
    lane_options: LaneFileOptions = AS_IN_FILE

    @cached_property
    def lanes(self) -> LaneLines | None:
        """The lane lines of the file, None without one.

        Raises:
            ConfigurationError: it cannot be used.
        """
        return (
            None if self.lane_file is None else read_lane_file(self.lane_file, self.lane_options)
        )

    @cached_property
    def classes(self) -> ClassMap:
        """The class map.

        Raises:
            ConfigurationError: it is unknown or cannot be read.
        """
        return class_map(self.class_map)

    def classes_or(self, preset: str) -> ClassMap:
        """Return the class map if one was given, else the preset of a layout."""
        return self.classes if self.class_map else class_map(preset)


AS_USUAL = ReadingOptions()
"""Nothing is said."""


def classes_of(names: Sequence[Any], classes: ClassMap, path: Path) -> ClassArray:
    """Return [n] uint8 our classes of [n] names, with a warning of those that mean nothing.

    Args:
        names: names or numbers in a file.
        classes: the class map.
        path: the file.
    """
    odd = classes.not_known(set(names))
    if odd:
        more = f" and {len(odd) - MOST_NAMES} more" if len(odd) > MOST_NAMES else ""
        remark(
            f"{path}: no class is known by the name {listed(odd[:MOST_NAMES])}{more}, --class-map"
            " can give one"
        )
    return classes.find_all(names)
