# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a user says about the files of a directory, besides their layout."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mtpgo_core.class_map import ClassMap, class_map


@dataclass(frozen=True)
class ReadingOptions:
    """How the files of a directory are to be read.

    Attributes:
        columns: file that describes the columns of a plain table (layout ``table``).
        class_map: preset or YAML file with our classes by the names and numbers of the data,
            empty for the names that the layout usually has.
    """

    columns: Path | None = None
    class_map: str = ""

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
