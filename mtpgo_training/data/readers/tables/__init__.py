# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings from one row for each time and road user, and plain tables of any names."""
