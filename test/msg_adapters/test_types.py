# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Message classes of rclpy and of a typestore, and the errors where there is none."""

import importlib.util

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from msg_adapters.registry import INPUTS, OUTPUTS
from msg_adapters.types import RclpyTypes, TypestoreTypes, message_class
from mtpgo_core.errors import MessageError

SENTENCES = {
    "autoware_perception_msgs": "install ros-jazzy-autoware-perception-msgs",
    "autoware_auto_perception_msgs": (
        "it was never released for Jazzy, where autoware_perception_msgs has taken its place; "
        "mtpgo convert reads its bags without it"
    ),
    "vision_msgs": "install ros-jazzy-vision-msgs",
    "derived_object_msgs": "install ros-jazzy-derived-object-msgs",
    "perception_msgs": "build it from https://github.com/ika-rwth-aachen/perception_interfaces",
}


@pytest.mark.parametrize("name", [*sorted(INPUTS), "predicted"])
def test_missing_message_classes_name_the_package_to_install(name):
    pytest.importorskip("rclpy")
    adapter = INPUTS.get(name, OUTPUTS["autoware"])
    if importlib.util.find_spec(adapter.package):
        short = adapter.message_type.rpartition("/")[2]
        assert message_class(adapter.message_type).__name__ == short
        return
    with pytest.raises(MessageError) as error:
        message_class(adapter.message_type)
    assert str(error.value) == (
        f"message type {adapter.message_type!r} needs the package {adapter.package}, which is "
        f"not installed: {SENTENCES[adapter.package]}"
    )


def test_no_package_is_suggested_that_jazzy_may_not_have():
    pytest.importorskip("rclpy")
    with pytest.raises(
        MessageError, match="which is not installed: build it from source"
    ) as error:
        message_class("my_company_msgs/msg/State")
    assert "ros-jazzy" not in str(error.value)


def test_names_that_are_not_message_types():
    pytest.importorskip("rclpy")
    for name in ("Marker", "", "std_msgs/srv/Empty", "std_msgs/"):
        with pytest.raises(MessageError, match="is not a message type"):
            message_class(name)
    with pytest.raises(MessageError, match="std_msgs has no message 'Nothing'"):
        message_class("std_msgs/msg/Nothing")
    assert message_class("std_msgs/String") is message_class("std_msgs/msg/String")


def test_rclpys_field_checks_are_active_in_these_tests():
    """Without them, rclpy would accept any value and the other tests would prove little."""
    pytest.importorskip("rclpy")
    with pytest.raises(AssertionError):
        RclpyTypes().make("geometry_msgs/msg/Point", x=3)


def test_unregistered_type_is_named():
    types = TypestoreTypes(get_typestore(Stores.ROS2_JAZZY))
    with pytest.raises(MessageError, match="'vision_msgs/msg/Detection3D' is not in the type"):
        types.make("vision_msgs/msg/Detection3D")


def test_defaults_are_those_of_ros(offline, online, typestore):
    """An unchanged message of each installed type has the same bytes from either family."""
    serialization = pytest.importorskip("rclpy.serialization")
    for name in (
        "visualization_msgs/msg/Marker",
        "sensor_msgs/msg/PointCloud2",
        "geometry_msgs/msg/PoseWithCovariance",
        "shape_msgs/msg/SolidPrimitive",
        "unique_identifier_msgs/msg/UUID",
        "nav_msgs/msg/Odometry",
    ):
        ours = offline.make(name)
        theirs = typestore.deserialize_cdr(
            serialization.serialize_message(online.make(name)), name
        )
        assert bytes(typestore.serialize_cdr(ours, name)) == bytes(
            typestore.serialize_cdr(theirs, name)
        )


def test_sequences_of_numbers(offline, online):
    for types in (offline, online):
        np.testing.assert_array_equal(types.doubles([1.5, 2.5]), [1.5, 2.5])
        assert bytes(types.octets(np.array([1, 2], np.uint8))) == b"\x01\x02"
        assert bytes(types.octets(b"\x01\x02")) == b"\x01\x02"
