# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The launch file as ROS' launch starts it: the predictor gets ready and ends with status 0.

    launch_test test/recipes/launch_predictor.py

The package must be built and sourced. test_predictor_launch.py runs this where launch_testing is
installed.
"""

import unittest
from pathlib import Path

import launch_testing.actions
import launch_testing.asserts
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

from launch import LaunchDescription

LAUNCH = Path(__file__).resolve().parents[2] / "launch"
TIME_S = 120.0
"""Longest time until the predictor is ready or has ended, on a busy machine; chosen."""


def generate_test_description():
    """Return the predictor in a namespace of its own, on its own topic."""
    arguments = {"namespace": "launched", "objects": "/launched/tracks", "output": "pointcloud2"}
    predictor = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(LAUNCH / "predictor.launch.py")),
        launch_arguments=arguments.items(),
    )
    return LaunchDescription([predictor, launch_testing.actions.ReadyToTest()])


class WhileItRuns(unittest.TestCase):
    """The predictor says that it is ready, with the arguments of the launch file."""

    def test_it_is_ready(self, proc_output):
        proc_output.assertWaitFor("waiting for /launched/tracks", timeout=TIME_S)


@launch_testing.post_shutdown_test()
class AfterItsEnd(unittest.TestCase):
    """The predictor ended as it should."""

    def test_its_status_is_zero(self, proc_info):
        launch_testing.asserts.assertExitCodes(proc_info)
