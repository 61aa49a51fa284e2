# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Launch files and parameters of the recipes against the node, and as ROS' launch reads them."""

import dataclasses
import importlib.util
from pathlib import Path

import pytest
import yaml
from recipe_file import RECIPES, ROOT, arguments_of, read_recipe

from mtpgo_ros.node.objects_subscription import TOPIC
from mtpgo_ros.node.publishers import OUTPUT_TOPICS
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters, updated

STACKS = sorted(RECIPES)
TOPICS = {TOPIC, "odometry", "/tf", "/tf_static", *OUTPUT_TOPICS.values()}
GIVEN = {"vision": {"objects": "/tracks"}, "nav2": {"objects": "/tracks"}}
NAMES = {field.name for field in dataclasses.fields(PredictorParameters)}


def predictor(stack, **given):
    """Return the predictor of a recipe."""
    (node,) = [
        node
        for node in read_recipe(stack, **GIVEN.get(stack, {}) | given)
        if node.executable == "predictor"
    ]
    return node


def parameters(node):
    """Return all parameters of a node of a recipe."""
    values = {}
    for path in node.parameter_files:
        for pattern, content in yaml.safe_load(path.read_text()).items():
            if pattern in ("/**", f"/**/{node.name}"):
                values |= content["ros__parameters"]
    return values | node.parameters


def test_there_is_a_recipe_for_each_documented_stack():
    assert STACKS == ["autoware", "carla", "nav2", "vision"]
    text = (ROOT / "docs" / "integration.md").read_text(encoding="utf-8")
    for stack in STACKS:
        assert f"{stack}.launch.xml" in text
        for argument in arguments_of(stack):
            assert f"`{argument}`" in text, f"{stack}: {argument}"
        for value in parameters(predictor(stack)):
            assert f"`{value}`" in text, f"{stack}: {value}"


@pytest.mark.parametrize("stack", STACKS)
def test_a_recipe_starts_the_predictor_with_parameters_and_topics_that_it_has(stack):
    node = predictor(stack)
    assert node.package == "mtpgo_ros"
    values = parameters(node)
    assert set(values) <= NAMES | {"use_sim_time"}
    assert updated(PredictorParameters(), values)
    assert set(node.remaps) <= TOPICS
    assert TOPIC in node.remaps


@pytest.mark.parametrize("stack", STACKS)
def test_what_is_published_is_an_argument(stack):
    assert predictor(stack, output="pointcloud2").parameters["output"] == ["pointcloud2"]
    several = predictor(stack, output="markers, autoware").parameters["output"]
    assert several == ["markers", "autoware"]


@pytest.mark.parametrize("stack", STACKS)
def test_the_lane_file_and_how_it_is_read_are_arguments(stack):
    given = {
        "lane_file": "/maps/town.osm",
        "lane_projection": "utm",
        "lane_origin": "49.01, 8.43",
        "lane_offset": "1000, -250.5",
        "lane_frame": "map",
    }
    assert given.items() <= predictor(stack, **given).parameters.items()
    unchanged = PredictorParameters()
    for name in given:
        assert predictor(stack).parameters[name] == getattr(unchanged, name)


def test_autoware_has_its_topics_by_default_and_by_argument():
    node = predictor("autoware")
    assert node.namespace == "/perception/object_recognition/prediction"
    assert node.remaps == {
        "objects": "/perception/object_recognition/tracking/objects",
        "~/predicted_objects": "/perception/object_recognition/objects",
    }
    assert "autoware" in node.parameters["output"]
    assert parameters(node)["input_type"] == "autoware"
    other = predictor("autoware", input__objects="/a", output__objects="/b")
    assert list(other.remaps.values()) == ["/a", "/b"]


def test_the_manager_of_nav2_manages_the_predictor():
    node, manager = read_recipe("nav2", objects="/tracks", namespace="robot1")
    assert manager.package == "nav2_lifecycle_manager"
    assert parameters(manager)["node_names"] == [node.name]
    assert parameters(node)["autostart"] is False
    assert node.namespace == manager.namespace == "robot1"
    assert node.remaps["/tf"] == "tf"


@pytest.fixture
def launch_service():
    """ROS' launch, where it is installed; PyPI has none of its packages."""
    for name in ("launch_ros", "launch_xml"):
        if not importlib.util.find_spec(name):
            pytest.skip(f"{name} is not installed: it comes with ROS, not by pip")
    return pytest.importorskip("launch").LaunchService


@pytest.mark.parametrize("stack", STACKS)
def test_launch_reads_the_recipe_as_the_tests_do(stack, launch_service, monkeypatch):
    """Every node with its command, its parameters and remaps; nothing is started."""
    from launch.actions import DeclareLaunchArgument, SetLaunchConfiguration
    from launch.frontend import Parser
    from launch.launch_context import LaunchContext
    from launch_ros.actions import Node
    from launch_ros.substitutions import FindPackageShare

    monkeypatch.setattr(FindPackageShare, "perform", lambda self, context: str(ROOT))
    entity, parser = Parser.load(str(RECIPES[stack]))
    description = parser.parse_description(entity)
    context = LaunchContext()
    context.launch_configurations.update(GIVEN.get(stack, {}))
    found = {}
    for item in description.entities:
        if isinstance(item, (DeclareLaunchArgument, SetLaunchConfiguration)):
            item.visit(context)
        elif isinstance(item, Node):
            item._perform_substitutions(context)
            found[item.node_name.rpartition("/")[2]] = item
    for node in read_recipe(stack, **GIVEN.get(stack, {})):
        item = found.pop(node.name)
        assert dict(item.expanded_remapping_rules or []) == node.remaps
        given = {}
        for path, is_file in item._Node__expanded_parameter_arguments:
            assert is_file
            content = yaml.safe_load(Path(path).read_text())
            if Path(path) not in node.parameter_files:
                (values,) = content.values()
                given |= values["ros__parameters"]
        assert given == node.parameters
    assert not found
