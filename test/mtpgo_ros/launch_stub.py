# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs a launch file without ROS' launch, which is not on pip: what would be started, and said."""

from __future__ import annotations

import ast
import importlib.util
import sys
import types
from pathlib import Path
from typing import Any


class Action:
    """Anything in a launch description: its arguments by name."""

    order: tuple[str, ...] = ()

    def __init__(self, *values: Any, **named: Any) -> None:
        self.__dict__.update(zip(self.order, values, strict=False))
        self.__dict__.update(named)


class LaunchDescription(Action):
    order = ("entities",)


class DeclareLaunchArgument(Action):
    order, default_value = ("name",), None


class OpaqueFunction(Action):
    pass


class LogInfo(Action):
    pass


class Node(Action):
    pass


class Shutdown(Action):
    pass


class RegisterEventHandler(Action):
    order = ("handler",)


class OnProcessExit(Action):
    pass


class IncludeLaunchDescription(Action):
    order = ("source",)


class PythonLaunchDescriptionSource(Action):
    order = ("path",)


class LaunchConfiguration(Action):
    order = ("name",)

    def perform(self, context: dict[str, str]) -> str:
        return context[self.name]


def _module(name: str, *classes: type) -> types.ModuleType:
    module = types.ModuleType(name)
    module.__dict__.update({one.__name__: one for one in classes})
    return module


SHARED = "mtpgo_launch_arguments"
"""The module that the launch files import from their folder."""

MODULES = [
    _module("launch", LaunchDescription),
    _module(
        "launch.actions",
        DeclareLaunchArgument,
        IncludeLaunchDescription,
        LogInfo,
        OpaqueFunction,
        RegisterEventHandler,
        Shutdown,
    ),
    _module("launch.event_handlers", OnProcessExit),
    _module("launch.launch_description_sources", PythonLaunchDescriptionSource),
    _module("launch.substitutions", LaunchConfiguration),
    _module("launch_ros"),
    _module("launch_ros.actions", Node),
]


def load(path: Path, monkeypatch: Any) -> types.ModuleType:
    """Return a launch file as a module, its imports of launch being the classes above."""
    for module in MODULES:
        monkeypatch.setitem(sys.modules, module.__name__, module)
    spec = importlib.util.spec_from_file_location("launch_file", path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setattr(sys, "path", [*sys.path])  # launch files add their folder
    # It shall have the classes above, and no other test shall get it with them.
    monkeypatch.delitem(sys.modules, SHARED, raising=False)
    spec.loader.exec_module(module)
    sys.modules.pop(SHARED, None)
    return module


def launched(path: Path, arguments: dict[str, str], monkeypatch: Any) -> list[Action]:
    """Return the nodes, messages and event handlers of a launch file, included files as well.

    Args:
        path: the launch file.
        arguments: its arguments; the others have their defaults.
        monkeypatch: pytest's.

    Raises:
        KeyError: a launch file asks for an argument that none has declared.
        ValueError: an argument that has to be given is not.
    """
    context = dict(arguments)
    found: list[Action] = []
    waiting = list(load(path, monkeypatch).generate_launch_description().entities)
    while waiting:
        action = waiting.pop(0)
        if isinstance(action, DeclareLaunchArgument):
            if context.setdefault(action.name, action.default_value) is None:
                raise ValueError(f"{action.name} is not given")
        elif isinstance(action, OpaqueFunction):
            waiting = [*action.function(context), *waiting]
        elif isinstance(action, IncludeLaunchDescription):
            for name, value in action.launch_arguments:
                given = value.perform(context) if hasattr(value, "perform") else value
                context[name] = given
            included = load(Path(action.source.path), monkeypatch)
            waiting = [*included.generate_launch_description().entities, *waiting]
        else:
            found.append(action)
    for action in found:
        if isinstance(action, Node):
            action.arguments = [
                one.perform(context) if hasattr(one, "perform") else one
                for one in getattr(action, "arguments", [])
            ]
    return found


def parameter_types(path: Path) -> dict[str, str]:
    """Return the names of the types in a launch file's ``PARAMETERS``, without running it."""
    table = next(
        node.value
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign) and node.targets[0].id == "PARAMETERS"
    )
    return {
        key.value: value.elts[0].id for key, value in zip(table.keys, table.values, strict=True)
    }
