# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Makes the helper module beside this file importable and hands out its recording."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import demo_traffic


@pytest.fixture
def recording():
    return demo_traffic.make_recording()
