# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Starts the predictor and, if requested, RViz.

    ros2 launch mtpgo_ros predictor.launch.py objects:=/perception/objects rate:=10.0 rviz:=true

Arguments have priority over the parameter file; an empty argument keeps the file's value. RViz
shows the node under its namespace and name; without rviz2 a message says so and the rest starts.
"""

import sys
import tempfile
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch_ros.actions import Node

from launch import LaunchDescription

# mtpgo_launch_arguments.py is beside this file, in no package.
sys.path.insert(0, str(Path(__file__).resolve().parent))

from mtpgo_launch_arguments import declared, overrides, parameter_file, texts, typed

CONFIG = Path(__file__).resolve().parents[1] / "config"
SHIPPED = CONFIG / "predictor.yaml"

PARAMETERS = {
    "model": (str, "name of an installed model or path of an exported one"),
    "graph": (str, "ego, cover, each or scene"),
    "rate": (float, "predictions per second, at most (Hz)"),
    "input_type": (str, "message type of the objects, auto: as published"),
    "ego_id": (str, "identity of the ego"),
    "ego_topic": (str, "topic with the ego's odometry, which makes it a road user of the graph"),
    "output": (tuple, "what is published, separated by commas: pointcloud2, markers, autoware"),
    "fixed_frame": (str, "frame into which objects are transformed"),
    "lane_file": (
        str,
        "Lanelet2 map (OSM) or GeoJSON with the lanes, for a model that uses lanes",
    ),
    "lane_projection": (
        str,
        "how its coordinates become metres: auto, local, utm, mgrs, transverse_mercator or"
        " cartesian",
    ),
    "lane_origin": (str, "latitude and longitude of the origin of its metres, '49.01, 8.43'"),
    "lane_offset": (str, "x and y that are subtracted from its metres, '1000, -250.5' (m)"),
    "lane_frame": (str, "frame of its metres; empty: the objects' fixed frame"),
    "use_sim_time": (bool, "use the time of /clock"),
    "autostart": (bool, "false: a lifecycle manager configures and activates the node"),
}
"""Arguments that are parameters of the node: type and description."""

RESPAWN_DELAY_S = 2.0
"""Time between the end of a process and the start of its successor; chosen."""

HINT = (
    "To see the predictions: apt install ros-jazzy-rviz2, or Foxglove with the layout that "
    "`mtpgo layouts` writes"
)
"""What to do without RViz."""

TOPICS = ("objects", "odometry", "lane_markings", "ego_id")
"""Topics that may be remapped by an argument; ego_id by ego_id_topic."""


def generate_launch_description() -> LaunchDescription:
    """Return what ``ros2 launch`` starts."""
    arguments = [
        DeclareLaunchArgument(
            "params_file",
            default_value=str(SHIPPED),
            description="parameter file",
        ),
        DeclareLaunchArgument("namespace", default_value="", description="of the node"),
        DeclareLaunchArgument("name", default_value="predictor", description="of the node"),
        DeclareLaunchArgument(
            "respawn", default_value="false", description="start the node again when it ends"
        ),
        DeclareLaunchArgument("rviz", default_value="false", description="start RViz"),
        DeclareLaunchArgument(
            "frame",
            default_value="",
            description="frame that RViz draws in, empty: fixed_frame, or map",
        ),
    ]
    arguments += declared(PARAMETERS)
    for topic in TOPICS:
        arguments.append(
            DeclareLaunchArgument(
                _argument(topic), default_value=topic, description=f"topic for {topic}"
            )
        )
    return LaunchDescription(
        [*arguments, OpaqueFunction(function=_predictor), OpaqueFunction(function=_rviz)]
    )


def _argument(topic: str) -> str:
    return "ego_id_topic" if topic == "ego_id" else topic


def _predictor(context: object) -> list[Node]:
    """Return the node with the parameters from the command line."""
    given = texts(context)
    return [
        Node(
            package="mtpgo_ros",
            executable="predictor",
            name=given("name") or "predictor",
            namespace=given("namespace"),
            parameters=[parameter_file(given, SHIPPED), overrides(PARAMETERS, given)],
            remappings=[
                (topic, given(_argument(topic)))
                for topic in TOPICS
                if given(_argument(topic)) not in ("", topic)
            ],
            # launch leaves its processes behind when it is ended by SIGTERM.
            arguments=["--end-with-parent"],
            respawn=typed(bool, "respawn", given("respawn")),
            respawn_delay=RESPAWN_DELAY_S,
            output="screen",
        )
    ]


def _rviz(context: object) -> list[Node | LogInfo]:
    """Return RViz with a layout for the node, or a message where it cannot be started."""
    given = texts(context)
    if not typed(bool, "rviz", given("rviz")):
        return []
    try:
        get_package_prefix("rviz2")
    except PackageNotFoundError:
        return [LogInfo(msg=f"rviz2 is not installed, so it is left out. {HINT}")]
    layout, notes = CONFIG / "predictor.rviz", []
    try:
        from mtpgo_core.displays.display_layouts import DisplayNames, rviz_layout
    except ImportError:  # installed into an environment of which ros2 knows the share folder only
        notes = [LogInfo(msg=f"RViz shows {layout} as it is: this Python has no mtpgo_core")]
    else:
        names = DisplayNames(
            namespace=given("namespace"),
            node=given("name") or "predictor",
            frame=given("frame") or given("fixed_frame") or "map",
            objects=given("objects") or "objects",
            lane_markings=given("lane_markings") or "lane_markings",
        )
        layout = Path(tempfile.mkdtemp(prefix="mtpgo_rviz_")) / layout.name
        layout.write_text(rviz_layout(names), encoding="utf-8")
    return [*notes, Node(package="rviz2", executable="rviz2", arguments=["-d", str(layout)])]
