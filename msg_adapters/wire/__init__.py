# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Byte layouts: CDR, point clouds and message definitions."""
