# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of tracked objects as recordings, by the node's own rules."""
