# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each agent's own frame at t: inputs are scaled in it, predictions are rotated back from it."""
