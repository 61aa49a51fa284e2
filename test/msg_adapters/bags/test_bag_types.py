# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The types that can be written into a bag, from rosbags, the definitions and installed files."""

import sys
from types import ModuleType

import pytest

from msg_adapters.bags.bag_types import bag_typestore, require_type
from msg_adapters.registry import INPUTS, OUTPUTS
from mtpgo_core.errors import RecordingError


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Return a function that installs a message package with definition files."""

    def share(package):
        folder = tmp_path / package
        if not folder.is_dir():
            raise LookupError(package)
        return str(folder)

    index, packages = ModuleType("ament_index_python"), ModuleType("packages")
    packages.get_package_share_directory = share
    monkeypatch.setitem(sys.modules, "ament_index_python", index)
    monkeypatch.setitem(sys.modules, "ament_index_python.packages", packages)

    def install(package, **definitions):
        (tmp_path / package / "msg").mkdir(parents=True)
        for name, text in definitions.items():
            (tmp_path / package / "msg" / f"{name}.msg").write_text(text)

    return install


def test_all_supported_messages_are_known():
    for adapter in (*INPUTS.values(), *OUTPUTS.values()):
        require_type(adapter.message_type)
        assert adapter.message_type in bag_typestore().types


def test_an_installed_type_is_read_with_the_types_of_its_fields(installed):
    """Nested in a sequence, an array and directly, two packages deep."""
    installed(
        "outer_msgs",
        Outer="Middle[] several\ninner_msgs/Inner[2] two\nstd_msgs/Header header\n",
        Middle="inner_msgs/Inner one\n",
    )
    installed("inner_msgs", Inner="float64 value\n")
    require_type("outer_msgs/msg/Outer")
    store = bag_typestore()
    inner = store.types["inner_msgs/msg/Inner"]
    message = store.types["outer_msgs/msg/Outer"](
        several=[store.types["outer_msgs/msg/Middle"](one=inner(value=1.0))],
        two=[inner(value=2.0), inner(value=3.0)],
        header=store.types["std_msgs/msg/Header"](
            stamp=store.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2), frame_id="map"
        ),
    )
    data = store.serialize_cdr(message, "outer_msgs/msg/Outer")
    again = store.deserialize_cdr(data, "outer_msgs/msg/Outer")
    assert (again.several[0].one.value, again.two[1].value) == (1.0, 3.0)


def test_a_definition_that_is_missing_is_named(installed):
    installed("half_msgs", Half="lost_msgs/Lost lost\n")
    with pytest.raises(RecordingError) as error:
        require_type("half_msgs/msg/Half")
    assert str(error.value) == (
        "message type lost_msgs/msg/Lost cannot be recorded: its definition Lost.msg is not"
        " installed"
    )
    assert "half_msgs/msg/Half" not in bag_typestore().types
