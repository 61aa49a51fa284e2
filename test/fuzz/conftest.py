# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Makes the targets importable by their file names."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
