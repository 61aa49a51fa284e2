# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plausibility checks of the input: shared identities, velocities in another frame or unit."""
