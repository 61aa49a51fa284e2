# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What ``metadata.yaml`` says about a bag, as far as it can be read."""

from __future__ import annotations

import functools
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import parse_qos
from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer

from mtpgo_core.errors import reason_of

METADATA = "metadata.yaml"
"""File that makes a directory a rosbag2 bag."""

_LARGEST = 1 << 22
"""Most bytes of metadata that are read; chosen: those of a bag of 20 000 files."""

_LARGEST_QOS = 1 << 16
"""Most characters of QoS profiles that are read; chosen: those of 200 publishers of a topic."""

_DEEPEST = 20
"""Most levels of lists and mappings in each other; chosen: rosbag2 writes eight at most."""

_MERGE = "tag:yaml.org,2002:merge"
"""Tag of a merge key, which puts one mapping into another."""

_LARGEST_NUMBER = 1 << 64
"""Numbers of a QoS profile are smaller, as ROS 2 has them in 64 bits."""


@dataclass
class BagMetadata:
    """What the metadata of a folder say, as far as they can be read.

    Attributes:
        files: names of the files, in order.
        expected: name of a file -> messages, start (ns) and duration (ns) that it should have.
        digests: topic and type -> hash of the type.
        offered: topic and type -> offered QoS.
        counts: topic and type -> messages that the bag should have.
        by_message: every message is compressed; None where the metadata do not tell.
        problem: why there are none, empty if there are.
    """

    files: list[str] = field(default_factory=list)
    expected: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    digests: dict[tuple[str, str], str] = field(default_factory=dict)
    offered: dict[tuple[str, str], list[Qos]] = field(default_factory=dict)
    counts: dict[tuple[str, str], int] = field(default_factory=dict)
    by_message: bool | None = None
    problem: str = ""


def read_metadata(folder: Path) -> BagMetadata:
    """Return the metadata of a folder; they are never needed, so nothing in them is an error."""
    found = BagMetadata()
    try:
        about = _content(folder / METADATA)
        # Version 3 and before give paths that begin with the folder.
        names = [PurePosixPath(name).name for name in _list(about["relative_file_paths"])]
        found.files = list(dict.fromkeys(names))
    except FileNotFoundError:
        found.problem = f"has no {METADATA}"
        return found
    except Exception as error:  # A broken YAML file fails the library in many ways.
        found.problem = f"has a {METADATA} that cannot be read ({_reason_of(error)})"
        return found
    with suppress(Exception):
        mode = about.get("compression_mode")
        found.by_message = isinstance(mode, str) and mode.lower() == "message"
    for entry in _entries(about.get("files")):
        with suppress(Exception):
            found.expected[PurePosixPath(entry["path"]).name] = _extent(entry)
    if len(found.files) == 1 and not found.expected:
        with suppress(Exception):
            found.expected[found.files[0]] = _extent(about)
    for entry in _entries(about.get("topics_with_message_count")):
        with suppress(Exception):
            topic = entry["topic_metadata"]
            key = (topic["name"], topic["type"])
            digest = topic.get("type_description_hash")
            found.digests[key] = digest if isinstance(digest, str) else ""
            found.offered[key] = qos_of(topic.get("offered_qos_profiles"))
            found.counts[key] = found.counts.get(key, 0) + _count_of(entry)
    return found


def _reason_of(error: Exception) -> str:
    """Return in words why the metadata cannot be read."""
    if isinstance(error, OSError):
        return reason_of(error)
    if isinstance(error, UnicodeDecodeError):
        return "it is no text in UTF-8"
    if isinstance(error, _ContentError):
        return str(error)
    if isinstance(error, KeyError | TypeError):
        return "it does not describe a bag"
    return "it is no YAML of plain values"


class _ContentError(ValueError):
    """Metadata of which nothing can be used."""


def _content(path: Path) -> dict[str, Any]:
    with path.open("rb") as stream:
        text = stream.read(_LARGEST + 1)
    if len(text) > _LARGEST:
        raise _ContentError(f"it is larger than {_LARGEST} bytes")
    if not text.strip(b"\0 \r\n"):
        raise _ContentError("it is empty")
    content = _plain_yaml(text.decode("utf-8"))
    about: dict[str, Any] = content["rosbag2_bagfile_information"]
    return about


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError("no list")
    return value


def _entries(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _count_of(entry: Any) -> int:
    """Return the messages of a topic, 0 where the number is that of no bag."""
    count = entry.get("message_count")
    return count if isinstance(count, int) and 0 <= count < 2**63 else 0


def _extent(entry: Any) -> tuple[int, int, int]:
    """Return messages, start (ns) and duration (ns) of a file or a bag.

    Raises:
        ValueError: a number is not that of any bag.
    """
    numbers = (
        int(entry["message_count"]),
        int(entry["starting_time"]["nanoseconds_since_epoch"]),
        int(entry["duration"]["nanoseconds"]),
    )
    if not all(0 <= number < 2**63 for number in numbers):
        raise ValueError(numbers)
    return numbers


def qos_of(text: Any) -> list[Qos]:
    """Return QoS profiles as rosbag2 stores them, none where they cannot be read."""
    if isinstance(text, str):
        return list(_qos_of_text(text)) if len(text) <= _LARGEST_QOS else []
    return list(_profiles(text))


@functools.lru_cache(maxsize=64)
def _qos_of_text(text: str) -> tuple[Qos, ...]:
    """Return the profiles in a text; most topics have the same, and to read it takes 3 ms."""
    try:
        return _profiles(_plain_yaml(text))
    except Exception:  # A broken text fails the library in many ways.
        return ()


def _profiles(items: Any) -> tuple[Qos, ...]:
    """Return the profiles in what a text holds; rosbags would read a text in a text, unguarded."""
    if not isinstance(items, list):
        return ()
    try:
        profiles = parse_qos(items)
    except Exception:  # Every version of rosbag2 writes them in another way.
        return ()
    return tuple(profiles) if all(_is_plain(profile) for profile in profiles) else ()


def _is_plain(profile: Qos) -> bool:
    """Return whether the numbers of a profile are numbers; rosbags takes whatever is there."""
    times = (profile.deadline, profile.lifespan, profile.liveliness_lease_duration)
    numbers = [profile.depth, *(number for time in times for number in time)]
    return all(isinstance(n, int) and abs(n) < _LARGEST_NUMBER for n in numbers) and isinstance(
        profile.avoid_ros_namespace_conventions, bool
    )


class _PlainComposer(Composer):
    """Reads YAML without merge keys (``<<``), of which a few fill any memory."""

    levels = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.levels > _DEEPEST:
            raise ValueError(f"more than {_DEEPEST} levels")
        self.levels += 1
        node = super().compose_node(parent, index)
        self.levels -= 1
        if node.tag == _MERGE:
            raise ValueError("a merge key")
        return node


def _plain_yaml(text: str) -> Any:
    """Return what a YAML text holds.

    Raises:
        Exception: it is no YAML, has merge keys or is nested too deep.
    """
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer = _PlainComposer
    return yaml.load(text)
