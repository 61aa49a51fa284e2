# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The road as traffic shows it: where earlier road users went from an agent's place."""
