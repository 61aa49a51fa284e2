# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The epochs of a training, and the devices and processes that share them."""
