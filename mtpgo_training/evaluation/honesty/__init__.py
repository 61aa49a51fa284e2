# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How honest and how plausible predictions are: pure functions on arrays, and their table."""
