# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Conversion between messages and the core's arrays, one file per message package, and bags."""
