# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Layouts of RViz and Foxglove; no package but the standard library."""
