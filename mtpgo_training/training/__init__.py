# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Training: losses, schedules, the training loop, validation, checkpoints."""
