# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The demo: a recording played through the real node, scored and drawn."""
