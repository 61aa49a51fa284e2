# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The bond to nav2's lifecycle manager; bondpy is not on pip for ROS 2, a stub stands for it."""

import sys
import types

import pytest
from ros_helpers import RecordingLogger

from mtpgo_ros.lifecycle.manager_bond import NoBond, form_bond


class Node:
    """What is needed of a node."""

    def __init__(self):
        self.logger, self.destroyed = RecordingLogger(), []

    def get_name(self):
        return "predictor"

    def get_logger(self):
        return self.logger

    def destroy_publisher(self, publisher):
        self.destroyed.append(publisher)

    def destroy_subscription(self, subscription):
        self.destroyed.append(subscription)


@pytest.fixture
def install(monkeypatch):
    """Return a function that installs bondpy with a given class."""

    def install(bond_class):
        module = types.SimpleNamespace(Bond=bond_class)
        monkeypatch.setitem(sys.modules, "bondpy", types.SimpleNamespace(bondpy=module))
        monkeypatch.setitem(sys.modules, "bondpy.bondpy", module)

    return install


def test_the_bond_has_the_topic_and_the_name_that_nav2_expects(install):
    calls = []

    class Bond:
        def __init__(self, topic, identity, node):
            calls.append((topic, identity, node))

        def start(self):
            calls.append("start")

            self.sub, self.pub = "sub", "pub"

        def shutdown(self):
            calls.append("shutdown")

    install(Bond)
    node = Node()
    form_bond(node).close()
    assert calls == [("bond", "predictor", node), "start", "shutdown"]
    assert node.destroyed == ["sub", "pub"]


def test_without_bondpy_there_is_none(monkeypatch):
    monkeypatch.setitem(sys.modules, "bondpy", None)
    bond = form_bond(Node())
    assert isinstance(bond, NoBond)
    bond.close()


def test_a_bond_that_cannot_be_formed_is_logged(install):
    install(lambda *_: 1 / 0)
    node = Node()
    assert isinstance(form_bond(node), NoBond)
    (line,) = node.logger.warnings
    assert "division by zero" in line
