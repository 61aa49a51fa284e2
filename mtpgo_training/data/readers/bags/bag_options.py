# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options for reading bags: topics, frames and the ego."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from msg_adapters.conversions import TWIST_FRAMES
from msg_adapters.inputs.ego_odometry import EgoOptions
from mtpgo_core.options import check_options, option

STAMPS = ("header", "log")
"""Where the time of a message without a stamp comes from: nowhere, or its log time."""


@dataclass(frozen=True)
class BagOptions:
    """How the bags of a directory are read.

    Attributes:
        topic: the topic of the tracked objects; empty chooses one, see ``objects_topic``.
        topics: the same for single bags, name of the bag -> topic.
        stamps: ``header``: a message without a stamp is left out, as in the node; ``log``: it gets
            the time at which it was recorded.
        twist_frame: frame of the velocities in the messages, as the node's parameter.
        ego_topic: topic with the ego's odometry, which makes it a road user, as the node's
            parameter does; empty leaves it out.
        ego: size, class and place of the ego's box.
        fixed_frame: frame into which objects are transformed where the bag tells how, as that of
            its predictions; empty for the usual one.
    """

    topic: str = ""
    topics: dict[str, str] = field(default_factory=dict)
    stamps: str = option("header", choices=STAMPS)
    twist_frame: str = option("default", choices=TWIST_FRAMES)
    ego_topic: str = ""
    ego: EgoOptions = field(default_factory=EgoOptions)
    fixed_frame: str = ""

    def __post_init__(self) -> None:
        check_options(self, "bags.")

    @property
    def given(self) -> list[str]:
        """The options of the command line that set what differs from the defaults."""
        default = BagOptions()
        inner = ("ego", "fixed_frame")  # part of --ego-topic, and no option of their own
        names = [item.name for item in fields(self) if item.name not in inner]
        given = [name for name in names if getattr(self, name) != getattr(default, name)]
        return [f"--{name.replace('_', '-')}" for name in given]

    def topic_of(self, bag: str) -> str:
        """Return the topic chosen for a bag, absolute; empty if none is."""
        chosen = self.topics.get(bag, self.topic)
        return "/" + chosen.lstrip("/") if chosen else ""
