#!/bin/bash
# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
#
# Sources ROS 2 and the workspace, then becomes the command, which so receives the container's signals.
set -e
source /opt/ros/jazzy/setup.bash
source /ws/install/setup.bash
exec "$@"
