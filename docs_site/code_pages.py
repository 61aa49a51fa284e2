# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pages made of the code: the node's parameters, topics and services, and all commands.

They are made whenever the site is built and are not in the repository, so they cannot go stale.
"""

from __future__ import annotations

import argparse
import dataclasses
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mtpgo_core.options import Limits
from mtpgo_ros.parameters.parameter_change import Change
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.parameters.risk_parameters import RiskParameters

if TYPE_CHECKING:
    from docs_site.node_interfaces import Interface

NODES: dict[str, type] = {"predictor": PredictorParameters, "risk": RiskParameters}
"""The nodes with their parameters."""

_CHANGES = {Change.NOW: "now", Change.CONFIGURE: "configure", Change.START: "start"}
"""The words of docs/node.md for when a parameter may change."""

_PARAMETERS_HEAD = """\
# Parameters and topics

Made of the code of this version. [The node](../node.md#parameters) and [risk](../risk.md) explain
parameters and topics and how they belong together.

*now*: may change at any time. *configure*: may change while the node is unconfigured. *start*:
only at the start of the process.
"""

_PARAMETERS_TABLE = """
## Parameters of `{node}`

| parameter | type | default | allowed | changes | |
| --- | --- | --- | --- | --- | --- |
"""

_COMMANDS_HEAD = """\
# Commands

What every command prints with `--help`, made of the code of this version.

"""


def parameter_rows(node: str) -> list[str]:
    """Return a row for each parameter of a node."""
    return [
        _row(
            f"`{field.name}`",
            _kind(field.default),
            f"`{_value(field.default)}`" if _value(field.default) else "empty",
            _allowed(field.metadata["limits"]),
            _CHANGES[field.metadata["change"]],
            field.metadata["description"],
        )
        for field in dataclasses.fields(NODES[node])
    ]


def parameter_page(interfaces: Iterable[Interface], node_page: str) -> str:
    """Return the page of parameters, topics and services.

    Args:
        interfaces: of the running node.
        node_page: text of docs/node.md, whose tables say what each is for.

    Raises:
        LookupError: docs/node.md has no row for a topic or service.
    """
    page = _PARAMETERS_HEAD
    for node in NODES:
        page += _PARAMETERS_TABLE.format(node=node) + "\n".join(parameter_rows(node)) + "\n"
    for title, way in (
        ("Topics that `predictor` subscribes to", "subscribes"),
        ("Topics that `predictor` publishes", "publishes"),
    ):
        page += f"\n## {title}\n\n| topic | type | QoS | |\n| --- | --- | --- | --- |\n"
        for item in interfaces:
            if item.way == way:
                about = described(node_page, item.name)
                page += _row(f"`{item.name}`", f"`{item.type_name}`", item.qos, about) + "\n"
    page += "\n## Services of `predictor`\n\nBesides those that every lifecycle node has.\n\n"
    page += "| service | type | |\n| --- | --- | --- |\n"
    for item in interfaces:
        if item.way == "serves":
            about = described(node_page, item.name)
            page += _row(f"`{item.name}`", f"`{item.type_name}`", about) + "\n"
    return page


def described(node_page: str, name: str) -> str:
    """Return what docs/node.md says of a topic or service, the last column of its row.

    Links are made to lead from the generated page to docs/.

    Raises:
        LookupError: there is no row.
    """
    found = re.search(rf"^\| `{re.escape(name)}` \|.*?\| ([^|]*) \|$", node_page, re.MULTILINE)
    if found is None:
        raise LookupError(f"docs/node.md has no row for {name}, which the node has")
    text = re.sub(r"\]\(#", "](node.md#", found[1])
    return re.sub(r"\]\((?!https?:)", "](../", text)


def command_page(commands: Sequence[tuple[str, str, argparse.ArgumentParser]]) -> str:
    """Return the page of all commands.

    Args:
        commands: name, one sentence, and parser of each.
    """
    page = _COMMANDS_HEAD + "| command | |\n| --- | --- |\n"
    for name, text, _ in commands:
        page += _row(f"[`{name}`](#{name.replace(' ', '-')})", text) + "\n"
    for name, _, parser in commands:
        parser.formatter_class = _Formatter
        page += f"\n## `{name}`\n\n```text\n{parser.format_help().strip()}\n```\n"
    return page


class _Formatter(argparse.HelpFormatter):
    """Help of the same width everywhere, whatever the terminal."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=96)


def node_page_text(root: Path) -> str:
    """Return docs/node.md."""
    return (root / "docs" / "node.md").read_text(encoding="utf-8")


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _kind(value: Any) -> str:
    if isinstance(value, tuple):
        return "string array"
    return {bool: "bool", int: "integer", float: "double", str: "string"}[type(value)]


def _value(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def _allowed(limits: Limits) -> str:
    if limits.choices:
        return ", ".join(str(choice) or "empty" for choice in limits.choices)
    return "" if limits == Limits() else str(limits)
