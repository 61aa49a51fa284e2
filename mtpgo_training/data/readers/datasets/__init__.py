# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Data sets of tables in their own layouts: INTERACTION, SinD, DUT, CITR, ETH/UCY, OpenACC."""
