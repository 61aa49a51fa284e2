# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Starting and spinning rclpy with our own handling of signals and errors."""

import itertools

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.validate_full_topic_name import validate_full_topic_name
from std_msgs.msg import Float64, String

from mtpgo_core.errors import ConfigurationError
from mtpgo_ros.runtime.ros_start import check_domain, node_errors, own_arguments, spin


@pytest.fixture
def failing():
    """A node with one callback that fails every time and one that counts."""
    node, counted, numbers = Node("failing"), [], itertools.count()

    def fail():
        raise ValueError(f"number {next(numbers)}")

    node.create_timer(0.001, fail)
    node.create_timer(0.001, lambda: counted.append(1))
    yield node, counted
    node.destroy_node()


def test_a_failing_callback_is_reported_and_spinning_continues(failing):
    node, counted = failing
    reported = []
    spin(
        node,
        lambda: len(counted) >= 3 and len(reported) >= 3,
        lambda what, error: reported.append(str(error)),
    )
    assert reported[:3] == ["number 0", "number 1", "number 2"]


def test_without_a_handler_it_ends_the_spinning(failing):
    with pytest.raises(ValueError, match="number 0"):
        spin(failing[0], lambda: False)


def test_own_arguments_come_without_those_of_ros():
    assert own_arguments(["bag", "--rate", "2", "--ros-args", "-p", "a:=1"]) == [
        "bag",
        "--rate",
        "2",
    ]


@pytest.mark.parametrize("arguments", [["--ros-args", "-p", "rate"], ["--ros-args", "--nope"]])
def test_ros_arguments_that_cannot_be_read_are_reported_in_a_sentence(arguments):
    with pytest.raises(ConfigurationError, match=arguments[-1]) as caught:
        own_arguments(arguments)
    assert "/src/" not in str(caught.value)


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("-p rate=5", "'-p rate=5', expected -p NAME:=VALUE"),
        ("-p :=5", "'-p :=5': .+, expected -p NAME:=VALUE"),
        ("-r a=b", "'-r a=b', expected -r OLD:=NEW"),
        ("-p", "nothing follows the last option, expected -p NAME:=VALUE"),
    ],
)
def test_parameters_and_remappings_are_told_their_form(line, sentence):
    with pytest.raises(ConfigurationError, match=rf"^ROS arguments: {sentence}$"):
        own_arguments(["--ros-args", *line.split()])


@pytest.mark.parametrize("arguments", [["\udcff.mcap"], ["--ros-args", "-p", "model:=\udcff.pt"]])
def test_arguments_in_another_encoding_are_reported_in_a_sentence(arguments):
    """Python has bytes that are no UTF-8 as halves of characters, which rclpy cannot take."""
    with pytest.raises(ConfigurationError, match=r"udcff\.\w+' is no text in UTF-8"):
        own_arguments(arguments)


def test_what_ros_refuses_about_a_node_is_one_sentence():
    wrong = [Parameter("use_sim_time", value="maybe")]
    with pytest.raises(ConfigurationError, match="'use_sim_time' to 'maybe'"), node_errors():
        Node("refused", parameter_overrides=wrong)
    with pytest.raises(ConfigurationError, match=r"Invalid topic name: .*'/a b'"), node_errors():
        validate_full_topic_name("/a b")
    node = Node("two_types", cli_args=["--ros-args", "-r", "texts:=numbers"])
    node.create_publisher(Float64, "numbers", 1)
    refused = pytest.raises(ConfigurationError, match=r"not accepted by ROS: .*incompatible")
    with refused as caught, node_errors():
        node.create_publisher(String, "texts", 1)
    assert ", at /" not in str(caught.value)  # positions in the sources of ROS
    node.destroy_node()
    with pytest.raises(ZeroDivisionError), node_errors():
        _ = 1 / 0  # a defect keeps its traceback


@pytest.mark.parametrize("text", ["", "0", "7", "007", "232"])
def test_a_domain_that_there_is(text):
    check_domain(text)


@pytest.mark.parametrize(
    "text", ["233", "-1", "4294967296", "1.5", "abc", " ", "٣", "1" * 5000, "0000000000233"]
)
def test_a_domain_that_there_is_not_is_one_sentence(text):
    """Fast DDS would end the process, or take another domain."""
    with pytest.raises(ConfigurationError, match="expected a whole number from 0 to 232") as found:
        check_domain(text)
    assert len(str(found.value)) < 200
