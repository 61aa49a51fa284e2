# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Trails: where earlier road users went, which the model uses in place of a map."""
