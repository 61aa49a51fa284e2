# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages are played only if what is installed reads their bytes as they were meant."""

import pytest

from msg_adapters.bags.bag_definitions import BagDefinitions, known_layout
from msg_adapters.bags.bag_reader import BagReader
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.types import message_class
from mtpgo_core.errors import MessageError
from mtpgo_ros.bags.installed_types import installed_definition, require_installed_layout

TYPES = (
    "std_msgs/msg/String",
    "std_msgs/msg/Empty",
    "std_msgs/msg/Float64MultiArray",
    "sensor_msgs/msg/PointCloud2",
    "visualization_msgs/msg/MarkerArray",
    "nav_msgs/msg/Odometry",
    "tf2_msgs/msg/TFMessage",
    "diagnostic_msgs/msg/DiagnosticArray",
    "vision_msgs/msg/Detection3DArray",
    "autoware_perception_msgs/msg/TrackedObjects",
    "derived_object_msgs/msg/ObjectArray",
)


def layouts_of(path, types):
    with McapWriter(path) as bag:
        for number, kind in enumerate(types):
            bag.add_topic(f"/topic_{number}", kind)
    with BagReader(path) as bag:
        definitions = BagDefinitions(bag.connections)
        return {c.msgtype: definitions.layout(c) for c in bag.connections}


def test_what_this_package_writes_can_be_played(tmp_path):
    checked = 0
    for kind, layout in layouts_of(tmp_path / "a.mcap", TYPES).items():
        try:
            message_class(kind)
        except MessageError:
            continue  # not installed here
        require_installed_layout(kind, layout)
        checked += bool(layout)
    assert checked >= 5


@pytest.mark.parametrize(
    ("edit", "field"),
    [
        (lambda layout: [*layout, ("extra", "uint8")], "extra"),
        (lambda layout: layout[:-1], "is_dense"),
        (lambda layout: [("stamp", kind) if not place else (path, kind)
                         for place, (path, kind) in enumerate(layout)], "stamp"),
        (lambda layout: [(path, "uint64" if path == "width" else kind)
                         for path, kind in layout], "width"),
    ],
)  # fmt: skip
def test_another_definition_is_refused_with_the_first_field(tmp_path, edit, field):
    (layout,) = layouts_of(tmp_path / "a.mcap", ["sensor_msgs/msg/PointCloud2"]).values()
    require_installed_layout("sensor_msgs/msg/PointCloud2", layout)
    with pytest.raises(MessageError, match=f"they differ from the field {field} on"):
        require_installed_layout("sensor_msgs/msg/PointCloud2", edit(layout))


def test_nothing_is_checked_without_a_definition():
    require_installed_layout("nowhere_msgs/msg/Nothing", [])


@pytest.mark.parametrize("kind", ["std_msgs/msg/Header", "visualization_msgs/msg/MarkerArray"])
def test_the_installed_definition_has_the_installed_layout(tmp_path, kind):
    message_class(kind)
    with McapWriter(tmp_path / "a.mcap") as bag:
        bag.add_topic("/x", kind, definition=installed_definition(kind))
    with BagReader(tmp_path / "a.mcap") as bag:
        (connection,) = bag.connections
        layout = BagDefinitions(bag.connections).layout(connection)
    assert layout == known_layout(kind)
    require_installed_layout(kind, layout)
