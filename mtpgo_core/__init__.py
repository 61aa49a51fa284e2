# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The core that the node and the training share: history, scene, runner. No ROS in here."""
