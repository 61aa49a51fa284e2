# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kinds of traffic whose roads are drawn anew for every recording."""
