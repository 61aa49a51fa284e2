# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""rclpy's start and spinning with our own way to end."""

import itertools

import pytest
from rclpy.node import Node

from mtpgo_core.errors import ConfigurationError
from mtpgo_ros.runtime.executable import tune_allocator
from mtpgo_ros.runtime.ros_start import own_arguments, spin


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


def test_a_failing_callback_is_told_and_the_node_is_served_on(failing):
    node, counted = failing
    told = []
    spin(
        node,
        lambda: len(counted) >= 3 and len(told) >= 3,
        lambda what, error: told.append(str(error)),
    )
    assert told[:3] == ["number 0", "number 1", "number 2"]


def test_without_anybody_to_tell_it_ends_the_spinning(failing):
    with pytest.raises(ValueError, match="number 0"):
        spin(failing[0], lambda: False)


def test_own_arguments_come_without_those_of_ros():
    assert own_arguments(["bag", "--rate", "2", "--ros-args", "-p", "a:=1"]) == [
        "bag",
        "--rate",
        "2",
    ]


@pytest.mark.parametrize("arguments", [["--ros-args", "-p", "rate"], ["--ros-args", "--nope"]])
def test_ros_arguments_that_cannot_be_read_are_told_in_a_sentence(arguments):
    with pytest.raises(ConfigurationError, match=arguments[-1]) as caught:
        own_arguments(arguments)
    assert "/src/" not in str(caught.value)


def test_the_allocator_is_tuned_where_it_is_glibcs():
    import platform

    assert tune_allocator() == (platform.libc_ver()[0] == "glibc")
