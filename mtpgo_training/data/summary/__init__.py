# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is in recordings: numbers, what the road users do, and defects with their places."""
