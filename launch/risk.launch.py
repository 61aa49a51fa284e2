# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Starts the node ``risk`` beside a running predictor.

    ros2 launch mtpgo_ros risk.launch.py plan_type:=path plan:=/planner/path

Arguments have priority over the parameter file; an empty argument keeps the file's value.
"""

import sys
from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

from launch import LaunchDescription

# mtpgo_launch_arguments.py is beside this file, in no package.
sys.path.insert(0, str(Path(__file__).resolve().parent))

from mtpgo_launch_arguments import declared, overrides, parameter_file, texts

SHIPPED = Path(__file__).resolve().parents[1] / "config" / "risk.yaml"

PARAMETERS = {
    "prediction_type": (str, "pointcloud2 or autoware"),
    "missing_covariance": (str, "unknown or assumed, for PredictedObjects without covariance"),
    "plan_type": (str, "odometry, path or autoware"),
    "ego_id": (str, "identity of the ego among the predicted road users"),
    "ego_length": (float, "length of the ego (m)"),
    "ego_width": (float, "width of the ego (m)"),
    "ego_offset": (float, "how far its middle is ahead of the plan's point (m)"),
    "use_sim_time": (bool, "use the time of /clock"),
    "autostart": (bool, "false: a lifecycle manager configures and activates the node"),
}
"""Arguments that are parameters of the node: type and description."""

TOPICS = {
    "predictions": "predictor/predictions",
    "predicted_objects": "predictor/predicted_objects",
    "plan": "plan",
    "odometry": "odometry",
}
"""Arguments that remap topics: the name of the topic by that of the argument."""


def generate_launch_description() -> LaunchDescription:
    """Return what ``ros2 launch`` starts."""
    arguments = [
        DeclareLaunchArgument(
            "params_file", default_value=str(SHIPPED), description="parameter file"
        ),
        DeclareLaunchArgument("namespace", default_value="", description="of the node"),
    ]
    arguments += declared(PARAMETERS)
    for name, topic in TOPICS.items():
        arguments.append(
            DeclareLaunchArgument(name, default_value=topic, description=f"topic for {topic}")
        )
    return LaunchDescription([*arguments, OpaqueFunction(function=_risk)])


def _risk(context: object) -> list[Node]:
    """Return the node with the parameters from the command line."""
    given = texts(context)
    return [
        Node(
            package="mtpgo_ros",
            executable="risk",
            name="risk",
            namespace=given("namespace"),
            parameters=[parameter_file(given, SHIPPED), overrides(PARAMETERS, given)],
            remappings=[
                (topic, given(name))
                for name, topic in TOPICS.items()
                if given(name) not in ("", topic)
            ],
            # launch leaves its processes behind when it is ended by SIGTERM.
            arguments=["--end-with-parent"],
            output="screen",
        )
    ]
