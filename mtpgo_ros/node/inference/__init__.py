# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The thread that runs the model, and the watchdog of its deadline."""
