# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages to the core's arrays and back: pure functions, one file per message package."""
