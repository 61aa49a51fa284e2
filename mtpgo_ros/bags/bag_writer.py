# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A bag that takes serialised messages: rosbag2 layout, MCAP storage, embedded definitions.

rosbags writes it rather than the plain mcap library, because it also writes the metadata.yaml and
the type hashes that make the folder a bag for ``ros2 bag``. No ROS in here.
"""

from __future__ import annotations

import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msg_adapters.wire.definitions import DEFINITIONS
from mtpgo_core.errors import RecordingError

_FOREVER = QosTime(9223372036, 854775807)


class BagSink:
    """Writes one bag, under a temporary name until it is complete.

    Args:
        path: folder to be made; if it ends in ``.mcap``, one self-contained file instead.

    Raises:
        RecordingError: the place is taken or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.messages = 0
        if path.exists():
            raise RecordingError(f"output {path} exists already and is not overwritten")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._folder = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
            # The file inside is named after its folder, and the metadata repeats the name.
            self._bag = self._folder / (path.stem if path.suffix == ".mcap" else path.name)
            self._writer = Writer(self._bag, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
        except OSError as error:
            raise RecordingError(f"output {path} cannot be written: {error.strerror}") from error
        self._typestore = _typestore()
        self._connections: dict[str, Connection] = {}

    def add_topic(self, name: str, message_type: str, *, latched: bool, reliable: bool) -> None:
        """Make a topic known.

        Raises:
            RecordingError: the definition of the type is not to be had.
        """
        if message_type not in self._typestore.types:
            _register_installed(self._typestore, message_type)
        self._connections[name] = self._writer.add_connection(
            name,
            message_type,
            typestore=self._typestore,
            offered_qos_profiles=[_qos(latched=latched, reliable=reliable)],
        )

    def write(self, topic: str, time_ns: int, data: bytes) -> None:
        """Append a message.

        Raises:
            RecordingError: the disk does not take it.
        """
        try:
            self._writer.write(self._connections[topic], time_ns, data)
        except OSError as error:
            raise RecordingError(
                f"output {self.path} cannot be written: {error.strerror}"
            ) from error
        self.messages += 1

    def close(self) -> None:
        """Finish the bag and give it its name.

        Raises:
            RecordingError: the disk does not take it, or somebody else took the name meanwhile.
        """
        try:
            self._writer.close()
            single = self._bag / f"{self._bag.name}.mcap"
            (single if self.path.suffix == ".mcap" else self._bag).rename(self.path)
        except OSError as error:
            raise RecordingError(
                f"output {self.path} cannot be written: {error.strerror}"
            ) from error
        finally:
            self.discard()

    def discard(self) -> None:
        """Remove what is not finished."""
        with suppress(Exception):
            self._writer.abort()
        shutil.rmtree(self._folder, ignore_errors=True)


def _typestore() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for name, text in DEFINITIONS.items():
        types.update(get_types_from_msg(text, name))
    store.register({name: fields for name, fields in types.items() if name not in store.types})
    return store


def _register_installed(typestore: Any, message_type: str) -> None:
    """Register a type, and those it holds, from the definition files of installed packages.

    Raises:
        RecordingError: a definition file is not there.
    """
    from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

    waiting, types = [message_type], {}
    while waiting:
        name = waiting.pop()
        package, _, short = name.partition("/msg/")
        try:
            file = Path(get_package_share_directory(package)) / "msg" / f"{short}.msg"
            found = get_types_from_msg(file.read_text(), name)
        except (PackageNotFoundError, OSError, ValueError) as error:
            raise RecordingError(
                f"message type {name} cannot be recorded: its definition {short}.msg is not"
                " installed"
            ) from error
        types.update(found)
        for _, fields in found.values():
            for inner in _named_types(fields):
                if inner not in types and inner not in typestore.types:
                    waiting.append(inner)
    typestore.register(types)


def _named_types(fields: Any) -> list[str]:
    """Names of the message types among field descriptions, as rosbags nests them."""
    named = []
    for _, (kind, content) in fields:
        while kind.name in ("ARRAY", "SEQUENCE"):
            kind, content = content[0]
        if kind.name == "NAME":
            named.append(content)
    return named


def _qos(*, latched: bool, reliable: bool) -> Qos:
    """The QoS that a player should offer for this topic."""
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=10,
        reliability=QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=_FOREVER,
        lifespan=_FOREVER,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_FOREVER,
        avoid_ros_namespace_conventions=False,
    )
