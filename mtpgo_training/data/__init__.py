# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings: reading, writing, caching, splitting, and what happens in them."""
