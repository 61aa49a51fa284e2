# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reading of one SQLite file of rosbag2, ROS 2's storage up to Humble.

rosbags reads the messages; the topics are read here, for rosbags refuses a whole file for one
topic whose definition or QoS it does not know.
"""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
)
from rosbags.rosbag2.metadata import ReaderMetadata
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from msg_adapters.bags.bag_metadata import qos_of

_FORMATS = {"ros2msg": MessageDefinitionFormat.MSG, "ros2idl": MessageDefinitionFormat.IDL}
"""Languages of definitions of messages; of a type in another one only the name is used."""

_LEFT = ("-wal", "-journal")
"""How the names of files end that a killed recorder leaves beside a database: with changes that
are not in it yet, and with what it held before changes that were never completed."""


def files_left_beside(path: Path) -> list[Path]:
    """Return the files that belong to a database which was not closed, none of one that was."""
    beside = [path.with_name(path.name + ending) for ending in _LEFT]
    return [file for file in beside if file.is_file() and file.stat().st_size]


def recovered_copy(path: Path, folder: Path) -> Path:
    """Return a copy of a database that was not closed, brought into the state of its last commit.

    The database itself may lie on a read-only disk, and is not changed.

    Args:
        path: the database.
        folder: where the copy is made.

    Raises:
        sqlite3.Error: it cannot be brought there.
        OSError: it cannot be copied.
    """
    copy = folder / path.name
    for file in (path, *files_left_beside(path)):
        shutil.copyfile(file, folder / file.name)
    with closing(sqlite3.connect(copy)) as database:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
        database.execute("PRAGMA journal_mode=DELETE").fetchall()
        database.execute("SELECT COUNT(*) FROM messages").fetchall()
    return copy


class SqliteFile(Sqlite3Reader):
    """One file of the storage plugin sqlite3, with topics of any encoding and definition."""

    def _open(self) -> None:
        # Immutable: a bag may lie on a read-only disk, where SQLite could not lock it.
        name = f"{Path(str(self.path)).absolute().as_uri()}?immutable=1"
        with closing(sqlite3.connect(name, uri=True)) as database:
            database.text_factory = lambda data: data.decode(errors="replace")
            self._read_topics(database)

    def _read_topics(self, database: sqlite3.Connection) -> None:
        def rows(query: str) -> list[tuple[Any, ...]]:
            return database.execute(query).fetchall()

        columns = {row[1] for row in rows("PRAGMA table_info(topics)")}
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        counts = dict(rows("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id"))
        definitions = {}
        if rows("PRAGMA table_info(message_definitions)"):  # since Iron
            definitions = {
                kind: MessageDefinition(_FORMATS[language], text)
                for kind, language, text in rows(
                    "SELECT topic_type, encoding, encoded_message_definition"
                    " FROM message_definitions"
                )
                if language in _FORMATS and text.strip()
            }
        nothing = MessageDefinition(MessageDefinitionFormat.NONE, "")
        self.connections = [
            Connection(
                id=number,
                topic=topic,
                msgtype=kind,
                msgdef=definitions.get(kind, nothing),
                digest="",
                msgcount=int(counts.get(number, 0)),
                ext=ConnectionExtRosbag2(encoding, qos_of(offered)),
                owner=self,
            )
            for number, topic, kind, encoding, offered in rows(
                f"SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id"
            )
        ]
        ((first, last),) = rows(
            "SELECT MIN(timestamp), MAX(timestamp) FROM messages WHERE typeof(timestamp)='integer'"
        )
        count = sum(connection.msgcount for connection in self.connections)
        start, end = (2**63 - 1, 0) if first is None else (first, last + 1)
        self.metadata = ReaderMetadata(
            max(0, end - start), start, end, count, None, None, None, None
        )
