# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plays the traffic that ships with the package through the predictor, and shows it in RViz.

    ros2 launch mtpgo_ros demo.launch.py

The bag is played again and again until Ctrl-C. Without rviz2 the rest is started. The other
arguments of replay.launch.py and predictor.launch.py work here, too.
"""

from pathlib import Path

from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

from launch import LaunchDescription

HERE = Path(__file__).resolve().parent

BAG = Path("recordings", "roundabout", "roundabout.mcap")
"""The bag, below ``share/mtpgo_ros`` where installed, below ``resource`` in the source tree."""

PASSED = {
    "speed": ("1.0", "speed of the playback"),
    "loop": ("true", "start the bag again at its end"),
    "model": ("", "model of the predictor"),
    "rviz": ("true", "start RViz"),
    "namespace": ("", "of the predictor"),
}
"""Arguments of replay.launch.py: default and description."""


def generate_launch_description() -> LaunchDescription:
    """Return what ``ros2 launch`` starts."""
    places = [HERE.parent / BAG, HERE.parent / "resource" / BAG]
    bag = next((place for place in places if place.is_file()), places[0])
    passed = {"bag": (str(bag), "bag to play"), **PASSED}
    arguments = [
        DeclareLaunchArgument(name, default_value=value, description=description)
        for name, (value, description) in passed.items()
    ]
    replay = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(HERE / "replay.launch.py")),
        launch_arguments={name: LaunchConfiguration(name) for name in passed}.items(),
    )
    return LaunchDescription([*arguments, replay])
