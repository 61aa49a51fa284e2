# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The demo: plays recordings through the real node, scores and draws its predictions."""
