# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""rosbag2 bags: files of messages, written and read without ROS."""
