# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a lifecycle manager needs of the node besides rclpy's own services."""
