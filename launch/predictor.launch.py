# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Starts the predictor and, if requested, RViz.

    ros2 launch mtpgo_ros predictor.launch.py objects:=/perception/objects rate:=10.0 rviz:=true

Arguments have priority over the parameter file; an empty argument keeps the file's value.
"""

from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription

CONFIG = Path(__file__).resolve().parents[1] / "config"

PARAMETERS = {
    "model": (str, "name of an installed model or path of an exported one"),
    "graph": (str, "ego, cover, each or scene"),
    "rate": (float, "predictions per second, at most (Hz)"),
    "input_type": (str, "message type of the objects, auto: as published"),
    "ego_id": (str, "identity of the ego"),
    "output": (tuple, "what is published, separated by commas: pointcloud2, markers, autoware"),
    "fixed_frame": (str, "frame into which objects are transformed"),
    "use_sim_time": (bool, "use the time of /clock"),
    "autostart": (bool, "false: a lifecycle manager configures and activates the node"),
}
"""Arguments that are parameters of the node: type and description."""

RESPAWN_DELAY_S = 2.0
"""Time between the end of a process and the start of its successor; chosen."""

TOPICS = ("objects", "odometry", "lane_markings", "ego_id")
"""Topics that may be remapped by an argument; ego_id by ego_topic."""


def generate_launch_description() -> LaunchDescription:
    """Return what ``ros2 launch`` starts."""
    arguments = [
        DeclareLaunchArgument(
            "params_file",
            default_value=str(CONFIG / "predictor.yaml"),
            description="parameter file",
        ),
        DeclareLaunchArgument("namespace", default_value="", description="of the node"),
        DeclareLaunchArgument(
            "respawn", default_value="false", description="start the node again when it ends"
        ),
        DeclareLaunchArgument("rviz", default_value="false", description="start RViz"),
    ]
    for name, (_, description) in PARAMETERS.items():
        arguments.append(DeclareLaunchArgument(name, default_value="", description=description))
    for topic in TOPICS:
        arguments.append(
            DeclareLaunchArgument(
                _argument(topic), default_value=topic, description=f"topic for {topic}"
            )
        )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(CONFIG / "predictor.rviz")],
        condition=IfCondition(LaunchConfiguration("rviz")),
    )
    return LaunchDescription([*arguments, OpaqueFunction(function=_predictor), rviz])


def _argument(topic: str) -> str:
    return "ego_topic" if topic == "ego_id" else topic


def _predictor(context: object) -> list[Node]:
    """Return the node with the parameters from the command line."""

    def given(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    overrides = {
        name: _value(kind, name, given(name))
        for name, (kind, _) in PARAMETERS.items()
        if given(name) != ""
    }
    return [
        Node(
            package="mtpgo_ros",
            executable="predictor",
            name="predictor",
            namespace=given("namespace"),
            parameters=[given("params_file"), overrides],
            remappings=[
                (topic, given(_argument(topic)))
                for topic in TOPICS
                if given(_argument(topic)) != topic
            ],
            # launch leaves its processes behind when it is ended by SIGTERM.
            arguments=["--end-with-parent"],
            respawn=_value(bool, "respawn", given("respawn")),
            respawn_delay=RESPAWN_DELAY_S,
            output="screen",
        )
    ]


def _value(kind: type, name: str, text: str) -> str | float | bool | list[str]:
    """Return an argument's text as the parameter's type."""
    if kind is tuple:
        return [item.strip(" '\"") for item in text.strip().strip("[]").split(",")]
    if kind is bool:
        if text.lower() not in ("true", "false"):
            raise ValueError(f"argument {name} is {text!r}, expected true or false")
        return text.lower() == "true"
    try:
        return kind(text)
    except ValueError:
        raise ValueError(f"argument {name} is {text!r}, expected a number") from None
