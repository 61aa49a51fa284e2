# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Launch files in XML, read without ROS' launch: what they start, with which arguments."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import yaml

ROOT = Path(__file__).resolve().parents[2]
RECIPES = {path.name.split(".")[0]: path for path in sorted((ROOT / "launch").glob("*.xml"))}
"""Launch files by their stack."""


@dataclass(frozen=True)
class RecipeNode:
    """One node that a launch file starts.

    Attributes:
        package, executable, name, namespace: as in the file.
        parameters: name and value of those given in the launch file.
        parameter_files: in order, the later has priority.
        remaps: from and to.
    """

    package: str
    executable: str
    name: str
    namespace: str
    parameters: dict[str, object]
    parameter_files: list[Path]
    remaps: dict[str, str]

    def ros_arguments(self) -> list[str]:
        """Return the arguments with which launch would start the node."""
        arguments = ["--ros-args", "-r", f"__node:={self.name}"]
        if self.namespace:
            arguments += ["-r", f"__ns:={self.namespace}"]
        for path in self.parameter_files:
            arguments += ["--params-file", str(path)]
        for name, value in self.parameters.items():
            arguments += ["-p", f"{name}:={_as_yaml(value)}"]
        for source, target in self.remaps.items():
            arguments += ["-r", f"{source}:={target}"]
        return arguments


def read_recipe(stack: str, **given: str) -> list[RecipeNode]:
    """Return the nodes of a stack's launch file.

    Args:
        stack: key of :data:`RECIPES`.
        given: arguments, with ``__`` for a slash.
    """
    root = ElementTree.parse(RECIPES[stack]).getroot()
    values = {name.replace("__", "/"): value for name, value in given.items()}
    unknown = set(values) - {argument.attrib["name"] for argument in root.findall("arg")}
    assert not unknown, f"{stack} has no argument {unknown}"
    for argument in root.findall("arg"):
        name = argument.attrib["name"]
        if name not in values:
            assert "default" in argument.attrib, f"argument {name} of {stack} is required"
            values[name] = _substitute(argument.attrib["default"], values)
    for element in root.findall("let"):
        values[element.attrib["name"]] = _substitute(element.attrib["value"], values)
    return [_node(element, values) for element in root.findall("node")]


def arguments_of(stack: str) -> dict[str, str | None]:
    """Return the default of each argument of a launch file, None where it is required."""
    root = ElementTree.parse(RECIPES[stack]).getroot()
    return {a.attrib["name"]: a.attrib.get("default") for a in root.findall("arg")}


def _node(element: ElementTree.Element, values: dict[str, str]) -> RecipeNode:
    parameters, files = {}, []
    for item in element.findall("param"):
        if "from" in item.attrib:
            files.append(Path(_substitute(item.attrib["from"], values)))
            continue
        text = _substitute(item.attrib["value"], values)
        is_text = item.attrib.get("type") == "str"
        parameters[item.attrib["name"]] = text if is_text else yaml.safe_load(text)
    return RecipeNode(
        package=element.attrib["pkg"],
        executable=element.attrib["exec"],
        name=element.attrib["name"],
        namespace=_substitute(element.attrib.get("namespace", ""), values),
        parameters=parameters,
        parameter_files=files,
        remaps={
            item.attrib["from"]: _substitute(item.attrib["to"], values)
            for item in element.findall("remap")
        },
    )


def _substitute(text: str, values: dict[str, str]) -> str:
    text = text.replace("$(find-pkg-share mtpgo_ros)", str(ROOT))
    return re.sub(r"\$\(var ([^)]+)\)", lambda match: values[match[1]], text)


def _as_yaml(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return yaml.safe_dump(value, default_flow_style=True).splitlines()[0]
