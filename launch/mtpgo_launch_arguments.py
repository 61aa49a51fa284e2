# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the launch files have in common: arguments that are parameters of a node.

Nothing but the standard library and launch: ``ros2`` may know only the share folder of a package
whose modules are in another environment. The module has a name of its own among those that the
launch files of other packages import in the same process.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration

Parameters = Mapping[str, tuple[type, str]]
"""Type and description of parameters by name; ``tuple`` is a list of texts."""


def declared(parameters: Parameters) -> list[DeclareLaunchArgument]:
    """Return an argument for each parameter; an empty one keeps the parameter file's value."""
    return [
        DeclareLaunchArgument(name, default_value="", description=description)
        for name, (_, description) in parameters.items()
    ]


def texts(context: object) -> Callable[[str], str]:
    """Return the function from an argument's name to its text."""
    return lambda name: LaunchConfiguration(name).perform(context)


def parameter_file(given: Callable[[str], str], shipped: Path) -> str:
    """Return the path of the parameter file; launch would start the node without a missing one.

    Args:
        given: see :func:`texts`.
        shipped: the file where the argument is empty.

    Raises:
        ValueError: there is no such file; the sentence names the argument.
    """
    path = given("params_file") or str(shipped)
    if not Path(path).is_file():
        raise ValueError(f"argument params_file is {path!r}, expected a parameter file")
    return path


def overrides(
    parameters: Parameters, given: Callable[[str], str]
) -> dict[str, str | float | bool | list[str]]:
    """Return the parameters that the command line sets, see :func:`texts`."""
    return {
        name: typed(kind, name, given(name))
        for name, (kind, _) in parameters.items()
        if given(name) != ""
    }


def typed(kind: type, name: str, text: str) -> str | float | bool | list[str]:
    """Return an argument's text as the parameter's type.

    Raises:
        ValueError: it cannot be one; the sentence names the argument.
    """
    if kind is tuple:
        return [item.strip(" '\"") for item in text.strip().strip("[]").split(",")]
    if kind is bool:
        if text.lower() not in ("true", "false"):
            raise ValueError(f"argument {name} is {text!r}, expected true or false")
        return text.lower() == "true"
    if kind is str:
        return text
    try:
        value = kind(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"argument {name} is {text!r}, expected a number")
    return value
