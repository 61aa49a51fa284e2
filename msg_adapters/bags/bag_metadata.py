# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What ``metadata.yaml`` says about a bag, as far as it can be read."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import parse_qos
from ruamel.yaml import YAML

METADATA = "metadata.yaml"
"""File that makes a directory a rosbag2 bag."""

_LARGEST = 1 << 24
"""Most bytes of metadata that are read; chosen: a thousand times those of a usual bag."""


@dataclass
class BagMetadata:
    """What the metadata of a folder say, as far as they can be read.

    Attributes:
        files: names of the files, in order.
        expected: name of a file -> messages, start (ns) and duration (ns) that it should have.
        digests: topic and type -> hash of the type.
        offered: topic and type -> offered QoS.
        by_message: every message is compressed; None where the metadata do not tell.
        problem: why there are none, empty if there are.
    """

    files: list[str] = field(default_factory=list)
    expected: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    digests: dict[tuple[str, str], str] = field(default_factory=dict)
    offered: dict[tuple[str, str], list[Qos]] = field(default_factory=dict)
    by_message: bool | None = None
    problem: str = ""


def read_metadata(folder: Path) -> BagMetadata:
    """Return the metadata of a folder; they are never needed, so nothing in them is an error."""
    found = BagMetadata()
    try:
        about = _content(folder / METADATA)
        # Version 3 and before give paths that begin with the folder.
        found.files = [PurePosixPath(name).name for name in _list(about["relative_file_paths"])]
    except FileNotFoundError:
        found.problem = f"has no {METADATA}"
        return found
    except Exception as error:  # A broken YAML file fails the library in many ways.
        found.problem = f"has a {METADATA} that cannot be read ({type(error).__name__})"
        return found
    with suppress(Exception):
        found.by_message = str(about.get("compression_mode") or "").lower() == "message"
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
            found.digests[key] = str(topic.get("type_description_hash") or "")
            found.offered[key] = qos_of(topic.get("offered_qos_profiles"))
    return found


def _content(path: Path) -> dict[str, Any]:
    with path.open("rb") as stream:
        text = stream.read(_LARGEST + 1)
    if len(text) > _LARGEST:
        raise ValueError(f"larger than {_LARGEST} bytes")
    content = YAML(typ="safe").load(text.decode("utf-8"))
    about: dict[str, Any] = content["rosbag2_bagfile_information"]
    return about


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError("no list")
    return value


def _entries(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


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
    try:
        return parse_qos(text or [])
    except Exception:  # Every version of rosbag2 writes them in another way.
        return []
