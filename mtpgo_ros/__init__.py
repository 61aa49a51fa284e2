# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ROS edge: predictor node, replay and record. Nothing else imports rclpy."""
