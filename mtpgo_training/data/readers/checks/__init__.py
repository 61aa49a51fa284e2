# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Checks and remarks of the readers: other units, other layouts, files that are not read."""
