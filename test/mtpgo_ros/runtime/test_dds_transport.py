# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The choice of UDP, and that what the user has chosen stays."""

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.resources import find_resource
from mtpgo_ros.runtime.dds_transport import CHOICE, avoid_shared_memory

FASTDDS = "rmw_fastrtps_cpp"
PROFILE = find_resource("config", "fastdds", "this_machine.xml")

HAS_PORTS = """
import os, sys
import rclpy
from mtpgo_ros.runtime.dds_transport import avoid_shared_memory
if sys.argv[1] == "yes":
    os.environ["MTPGO_TRANSPORT"] = "udp"
    avoid_shared_memory(rclpy.get_rmw_implementation_identifier())
rclpy.init()
node = rclpy.create_node("one")
print("fastrtps_port" in open("/proc/self/maps").read())
"""


@pytest.mark.parametrize("given", [{}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}])
def test_udp_in_the_usual_discovery_range(given):
    environment = {CHOICE: "udp", **given}
    assert avoid_shared_memory(FASTDDS, environment)
    assert environment.pop("FASTDDS_BUILTIN_TRANSPORTS").startswith("UDPv4")
    assert environment == {CHOICE: "udp", **given}


def test_udp_on_this_machine_only():
    environment = {CHOICE: "udp", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    assert avoid_shared_memory(FASTDDS, environment)
    assert environment["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(PROFILE)
    assert environment["FASTDDS_DEFAULT_PROFILES_FILE"] == str(PROFILE)
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"


@pytest.mark.parametrize(
    ("middleware", "given"),
    [
        (FASTDDS, {"FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"}),
        (FASTDDS, {"FASTRTPS_DEFAULT_PROFILES_FILE": "mine.xml"}),
        (FASTDDS, {"FASTDDS_DEFAULT_PROFILES_FILE": "mine.xml"}),
        (FASTDDS, {"ROS_LOCALHOST_ONLY": "1"}),
        (
            FASTDDS,
            {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": "192.0.2.1"},
        ),
        ("rmw_cyclonedds_cpp", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}),
    ],
)
def test_what_the_user_has_chosen_stays(middleware, given):
    environment = {CHOICE: "udp", **given}
    assert not avoid_shared_memory(middleware, environment)
    assert environment == {CHOICE: "udp", **given}


def test_ros_own_transports_are_the_default_and_an_unknown_choice_is_refused():
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    assert not avoid_shared_memory(FASTDDS, environment)
    assert len(environment) == 1
    with pytest.raises(ConfigurationError, match="MTPGO_TRANSPORT is 'tcp', expected udp"):
        avoid_shared_memory(FASTDDS, {CHOICE: "tcp"})


def test_the_profile_is_for_this_machine_only():
    root = ElementTree.parse(PROFILE).getroot()
    texts = [(element.tag.rpartition("}")[2], element.text) for element in root.iter()]
    assert [text for name, text in texts if name == "type"] == ["UDPv4"]
    assert ("useBuiltinTransports", "false") in texts
    addresses = [text for name, text in texts if name == "address"]
    assert addresses == ["127.0.0.1", "127.0.0.1"]  # hears, and looks for others


@pytest.mark.parametrize(("avoided", "has_ports"), [("yes", "False"), ("no", "True")])
@pytest.mark.parametrize("discovery", ["LOCALHOST", "OFF"])
def test_a_process_has_no_ports_in_shared_memory(avoided, has_ports, discovery):
    """OFF reads the variables in the same way as SUBNET, and nothing leaves this machine."""
    found = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", HAS_PORTS, avoided],
        env={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": discovery},
        cwd=Path(__file__).resolve().parents[3],
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.strip() == has_ports
