# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reading of one SQLite file of rosbag2, ROS 2's storage up to Humble.

rosbags reads the messages; the topics are read here, for rosbags refuses a whole file for one
topic whose definition or QoS it does not know.
"""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
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


_PAGE_SIZE_AT, _PAGES_AT = 16, 28
"""Places in the header of a database of its pages' size (bytes, 1 for 65536), and of their number,
where 0 stands for those of the file (https://www.sqlite.org/fileformat.html)."""

_SMALLEST_PAGE = 512
"""Size of the smallest page (bytes, the same document)."""

LARGEST_MESSAGE = 1 << 28
"""Most bytes that a message is decompressed to, or that are read of a row of a damaged database;
chosen: twice an image of 8K, and bounds the memory that a small malicious file can ask for."""


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


def salvaged_copy(path: Path, folder: Path) -> Path | None:
    """Return a new database with the messages that can be read of one that is cut off or damaged.

    Args:
        path: the damaged database, which is not changed.
        folder: where the new one is made.

    Returns:
        the new database, None if no message can be read.

    Raises:
        OSError: it cannot be copied.
    """
    image, copy = folder / f"{path.name}.damaged", folder / f"{path.name}.salvaged"
    shutil.copyfile(path, image)
    _cut_to_pages(image)
    name = f"{image.absolute().as_uri()}?immutable=1"
    try:
        with closing(sqlite3.connect(name, uri=True)) as damaged:
            damaged.text_factory = bytes.decode
            damaged.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_MESSAGE)
            # The tables are read also where an index lies in what is missing.
            damaged.execute("PRAGMA writable_schema=ON")
            with closing(sqlite3.connect(copy)) as database, database:
                return copy if _copy_rows(damaged, database) else None
    except (sqlite3.Error, UnicodeError):
        return None
    finally:
        image.unlink()


def _cut_to_pages(path: Path) -> None:
    """Make a damaged database end with its last whole page that is not empty.

    SQLite would read what is missing of a page as zeros, and so would messages have them.
    """
    with path.open("r+b") as stream:
        stream.seek(_PAGE_SIZE_AT)
        stated = int.from_bytes(stream.read(2), "big")
        size = {0: _SMALLEST_PAGE, 1: 1 << 16}.get(stated, stated)
        pages = whole = stream.seek(0, 2) // size
        while pages > 1:
            stream.seek((pages - 1) * size)
            if stream.read(size).strip(b"\0"):
                break
            pages -= 1
        # The zeros may begin within the page before.
        stream.truncate(max(1, pages - (pages < whole)) * size)
        stream.seek(_PAGES_AT)
        stream.write(bytes(4))  # as many as the file has


def _copy_rows(damaged: sqlite3.Connection, database: sqlite3.Connection) -> int:
    """Copy the tables of a bag as far as they can be read; return the number of messages."""
    tables = dict(damaged.execute("SELECT name, sql FROM sqlite_master WHERE type='table'"))
    for table in ("topics", "message_definitions"):
        if table not in tables:
            continue
        database.execute(tables[table])
        for row in damaged.execute(f"SELECT * FROM {table}"):
            database.execute(f"INSERT INTO {table} VALUES ({', '.join('?' * len(row))})", row)
    database.execute(tables.get("messages", ""))
    insert = "INSERT INTO messages (id, topic_id, timestamp, data) VALUES (?, ?, ?, ?)"
    return database.executemany(insert, _readable_messages(damaged)).rowcount


def _readable_messages(damaged: sqlite3.Connection) -> Iterator[tuple[Any, ...]]:
    """Yield the messages of a damaged database, ascending by their numbers."""
    select = "SELECT id, topic_id, timestamp, data FROM messages WHERE id >= ? ORDER BY id"
    last, step = -1, 1
    while last + step < 1 << 62:
        try:
            for row in damaged.execute(select, (last + step,)):
                if row[0] < last + step:  # pages that lead back
                    break
                yield row
                last, step = row[0], 1
            else:
                return
        except sqlite3.Error:
            pass
        # Behind the damage, the sooner the smaller it is.
        step *= 2


class SqliteFile(Sqlite3Reader):
    """One file of the storage plugin sqlite3, with topics of any encoding and definition.

    Attributes:
        without_topic: messages by their ``topic_id``, of those that the table of topics lacks.
    """

    without_topic: dict[Any, int]

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
                topic=str(topic or ""),
                msgtype=str(kind or ""),
                msgdef=definitions.get(kind, nothing),
                digest="",
                msgcount=int(counts.get(number, 0)),
                ext=ConnectionExtRosbag2(str(encoding or ""), qos_of(offered)),
                owner=self,
            )
            for number, topic, kind, encoding, offered in rows(
                f"SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id"
            )
        ]
        described = {connection.id for connection in self.connections}
        self.without_topic = {n: count for n, count in counts.items() if n not in described}
        ((first, last),) = rows(
            "SELECT MIN(timestamp), MAX(timestamp) FROM messages WHERE typeof(timestamp)='integer'"
        )
        count = sum(connection.msgcount for connection in self.connections)
        start, end = (2**63 - 1, 0) if first is None else (first, last + 1)
        self.metadata = ReaderMetadata(
            max(0, end - start), start, end, count, None, None, None, None
        )
