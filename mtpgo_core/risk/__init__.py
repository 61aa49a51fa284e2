# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How likely predicted road users are in the way of a plan. Arrays only."""
