# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The recording of the demo's tests."""

import demo_traffic
import pytest


@pytest.fixture
def recording():
    return demo_traffic.make_recording()
