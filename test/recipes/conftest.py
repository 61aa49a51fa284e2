# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Folders of the helper modules that the tests of the recipes import."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "mtpgo_ros"))
sys.path.insert(0, str(Path(__file__).parent))
