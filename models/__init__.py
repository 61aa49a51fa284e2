# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MTP-GO in torch: no ROS, no files, no numpy; scripts to TorchScript."""
