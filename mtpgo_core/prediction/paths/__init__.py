# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What becomes of the paths that a network predicts before they are published."""
