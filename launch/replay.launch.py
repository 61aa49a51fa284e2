# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plays a bag to the predictor, with the bag's time as simulated time.

    ros2 launch mtpgo_ros replay.launch.py bag:=recording.mcap speed:=2.0 rviz:=true

Everything ends with the bag, unless it is looped. The other arguments of predictor.launch.py work
here, too, and settings without an argument come from its parameter file.
"""

import sys
from pathlib import Path

from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription

HERE = Path(__file__).resolve().parent

PASSED = {
    "model": "model of the predictor",
    "lane_file": "Lanelet2 map (OSM) or GeoJSON with the lanes, in place of the bag's",
    "lane_projection": "how its coordinates become metres, see predictor.launch.py",
    "lane_origin": "latitude and longitude of the origin of its metres, '49.01, 8.43'",
    "lane_offset": "x and y that are subtracted from its metres, '1000, -250.5' (m)",
    "lane_frame": "frame of its metres; empty: that of the bag's objects",
    "namespace": "of the predictor",
    "frame": "frame of the bag's objects, empty: map",
}
"""Arguments of predictor.launch.py that are empty by default: their descriptions."""

# mtpgo_launch_arguments.py is beside this file, in no package.
sys.path.insert(0, str(HERE))

from mtpgo_launch_arguments import texts, typed  # noqa: E402


def generate_launch_description() -> LaunchDescription:
    """Return what ``ros2 launch`` starts."""
    predictor = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(HERE / "predictor.launch.py")),
        launch_arguments={
            name: LaunchConfiguration(name)
            for name in ("rviz", "use_sim_time", "objects", "lane_markings", *PASSED)
        }.items(),
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="bag to play"),
            DeclareLaunchArgument(
                "speed", default_value="1.0", description="speed of the playback"
            ),
            DeclareLaunchArgument(
                "loop", default_value="false", description="start the bag again at its end"
            ),
            DeclareLaunchArgument("rviz", default_value="false", description="start RViz"),
            DeclareLaunchArgument(
                "objects", default_value="/objects", description="topic of the objects in the bag"
            ),
            DeclareLaunchArgument(
                "lane_markings",
                default_value="/lane_markings",
                description="topic of the lane markings in the bag",
            ),
            DeclareLaunchArgument(
                "use_sim_time", default_value="true", description="use the bag's time, of /clock"
            ),
            *(
                DeclareLaunchArgument(name, default_value="", description=description)
                for name, description in PASSED.items()
            ),
            predictor,
            OpaqueFunction(function=_player),
        ]
    )


def _player(context: object) -> list[object]:
    """Return the player, with whose end everything ends."""
    loop = typed(bool, "loop", texts(context)("loop"))
    player = Node(
        package="mtpgo_ros",
        executable="replay",
        arguments=[
            LaunchConfiguration("bag"),
            "--rate",
            LaunchConfiguration("speed"),
            "--wait-for-subscribers",
            "1",
            "--no-progress",
            # launch leaves its processes behind when it is ended by SIGTERM.
            "--end-with-parent",
            *(["--loop"] if loop else []),
        ],
        output="screen",
    )
    return [
        player,
        RegisterEventHandler(OnProcessExit(target_action=player, on_exit=[Shutdown()])),
    ]
