# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Many trainings of one configuration with other values: grid, runs, one table."""
