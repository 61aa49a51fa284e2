# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the predictor and their declaration in rclpy."""
