# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tracked road users and their predictions over time: one page, animations, rerun."""
