# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A job for processes that loads no large library and does what it is told."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError


@dataclass(frozen=True)
class LightJob:
    """Writes a file and then ends in one of several ways."""

    folder: Path
    how: str = "done"

    def run(self):
        print(f"this is {self.how}", flush=True)
        (self.folder / "running").write_text("")
        if self.how == "error":
            raise ConfigurationError("data.train is empty")
        if self.how == "defect":
            raise ZeroDivisionError("a defect")
        if self.how == "killed":
            os.abort()
        if self.how == "long":
            time.sleep(60.0)
        return True
