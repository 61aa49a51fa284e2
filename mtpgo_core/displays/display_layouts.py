# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Layouts for RViz and Foxglove that follow namespace, node name, frame and topics.

The files that ship (``config/predictor.rviz``, ``config/foxglove.json``) are layouts for the
default names, and the templates: their topics and their frame are replaced here, by the rules by
which ROS expands names. Only the standard library is imported, since launch files use this too.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.resources import find_resource

RVIZ_FILE, FOXGLOVE_FILE = "predictor.rviz", "foxglove.json"
"""Names of the templates in ``config/``, and of the files made from them."""

NODE, RISK_NODE, FRAME = "predictor", "risk", "map"
"""Names of the nodes, and frame, of the templates."""

GLOBAL_TOPICS = ("/diagnostics", "/tf", "/tf_static", "/clock")
"""Topics that nodes of every namespace share; they are not replaced."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_TOPIC = re.compile(r"(~/|/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_FRAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_./-]*")

_PLAIN = re.compile(r"(?!(?:true|false|null|yes|no|on|off|y|n)$)[a-z_][a-z0-9_/.-]*", re.I)
"""Text that YAML reads as text without quotation marks."""


@dataclass(frozen=True)
class DisplayNames:
    """The names that a layout shows.

    Attributes:
        namespace: of the node; with or without the leading slash, empty for none.
        node: name of the node.
        frame: frame in which the displays are drawn: that of the observations, or the parameter
            ``fixed_frame``.
        objects: topic of the tracked objects, by ROS' rules: ``/x`` is x, ``x`` is in the
            namespace, ``~/x`` is below the node.
        lane_markings: topic of the lane markings.
        risk: name of the node risk, in the same namespace.

    Raises:
        ConfigurationError: ROS does not allow one of the names.
    """

    namespace: str = ""
    node: str = NODE
    frame: str = FRAME
    objects: str = "objects"
    lane_markings: str = "lane_markings"
    risk: str = RISK_NODE

    def __post_init__(self) -> None:
        object.__setattr__(self, "namespace", self.namespace.strip("/"))
        parts = self.namespace.split("/") if self.namespace else []
        word = "letters, digits and _, none of them beginning with a digit"
        if not all(_NAME.fullmatch(part) for part in parts):
            raise ConfigurationError(
                f"the namespace is {self.namespace!r}, expected names of {word}, separated by /"
            )
        for node in (self.node, self.risk):
            if not _NAME.fullmatch(node):
                raise ConfigurationError(f"the node name is {node!r}, expected {word}")
        if not _FRAME.fullmatch(self.frame):
            raise ConfigurationError(
                f"the frame is {self.frame!r}, expected letters, digits and _ . / -"
            )
        for topic in (self.objects, self.lane_markings):
            if not _TOPIC.fullmatch(topic):
                raise ConfigurationError(
                    f"the topic is {topic!r}, expected names of {word}, separated by /"
                )

    @property
    def full_name(self) -> str:
        """Namespace and name of the node, without the leading slash, as in its diagnostics."""
        return self.in_namespace(self.node)

    def in_namespace(self, name: str) -> str:
        """Return a name in the namespace, without the leading slash."""
        return "/".join(filter(None, (self.namespace, name)))

    def topic(self, name: str) -> str:
        """Return the full name of a topic that the node calls ``name``."""
        if name.startswith("/"):
            return name
        if name.startswith("~/"):
            return f"/{self.full_name}/{name[2:]}"
        return "/" + self.in_namespace(name)

    def replaced(self, topic: str) -> str:
        """Return what stands for a topic of a template."""
        if topic in GLOBAL_TOPICS:
            return topic
        if topic.startswith(f"/{NODE}/"):
            return self.topic("~/" + topic.removeprefix(f"/{NODE}/"))
        if topic.startswith(f"/{RISK_NODE}/"):
            return self.topic(f"{self.risk}/" + topic.removeprefix(f"/{RISK_NODE}/"))
        given = {"/objects": self.objects, "/lane_markings": self.lane_markings}
        return self.topic(given.get(topic, topic[1:]))


def layout_texts(names: DisplayNames) -> dict[str, str]:
    """Return the layouts: name of the file -> its text.

    Raises:
        ConfigurationError: the templates are not among the installed files.
    """
    return {RVIZ_FILE: rviz_layout(names), FOXGLOVE_FILE: foxglove_layout(names)}


def rviz_layout(names: DisplayNames) -> str:
    """Return the layout for RViz."""
    text = _template(RVIZ_FILE)
    frame = names.frame if _PLAIN.fullmatch(names.frame) else json.dumps(names.frame)
    text = re.sub(rf"(?m)^(\s+Fixed Frame: ){FRAME}$", lambda found: found[1] + frame, text)
    return re.sub(
        r"(?m)^(\s+Value: )(/\S+)$", lambda found: found[1] + names.replaced(found[2]), text
    )


def foxglove_layout(names: DisplayNames) -> str:
    """Return the layout for Foxglove."""

    def text(value: str) -> str:
        if value.startswith("/"):
            topic, dot, field = value.partition(".")
            return names.replaced(topic) + dot + field
        for node, shown in ((NODE, names.node), (RISK_NODE, names.risk)):
            if value.startswith(f"{node}: "):  # a status in the diagnostics
                return names.in_namespace(shown) + value.removeprefix(node)
        return value

    layout = _mapped(json.loads(_template(FOXGLOVE_FILE)), text)
    for panel in layout["configById"].values():
        if "followTf" in panel:
            panel["followTf"] = names.frame
    return json.dumps(layout, indent=2, ensure_ascii=False) + "\n"


def _mapped(value: Any, function: Callable[[str], str]) -> Any:
    """Return a JSON value with a function applied to all its texts, keys included."""
    if isinstance(value, dict):
        return {function(key): _mapped(item, function) for key, item in value.items()}
    if isinstance(value, list):
        return [_mapped(item, function) for item in value]
    return function(value) if isinstance(value, str) else value


def _template(name: str) -> str:
    return find_resource("config", name).read_text(encoding="utf-8")
