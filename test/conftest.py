# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The environment of every test, set before anything reads it."""

import os

# rclpy checks the types of message fields only when asked to, and publishes garbage otherwise.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
# Test runs on one machine, also at the same time, do not hear each other. Domains up to 101 keep
# clear of the ports that Linux hands out to clients.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
os.environ.pop("RMW_IMPLEMENTATION", None)
# One thread per process, as on the robot: repeatable, and kind to a busy machine.
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["MPLBACKEND"] = "Agg"
