# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""SQLite files whose recorder was killed: what it left beside them is read, and they stay."""

import shutil
import sqlite3

import pytest

from msg_adapters.bags import stored_bag
from msg_adapters.bags.sqlite_file import files_left_beside
from msg_adapters.bags.stored_bag import StoredBag
from mtpgo_core.errors import RecordingError

TABLES = """
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
 serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
 timestamp INTEGER NOT NULL, data BLOB NOT NULL);
INSERT INTO topics VALUES(1, '/x', 'std_msgs/msg/String', 'cdr', '');
"""


@pytest.fixture(autouse=True)
def _say_everything_again(monkeypatch):
    monkeypatch.setattr(stored_bag, "_told", set())


@pytest.fixture
def left(tmp_path):
    """A database as it is while it is written, copied beside what is not in it yet."""

    def left(steps, journal="WAL"):
        path = tmp_path / "written.db3"
        with sqlite3.connect(path) as database:
            database.execute(f"PRAGMA journal_mode={journal}")
            database.executescript(TABLES)
            for step in steps:
                if isinstance(step, str):
                    database.execute(step).fetchall()
                else:
                    rows = [(k, b"\0\1\0\0" + bytes(500)) for k in step]
                    database.executemany("INSERT INTO messages VALUES(NULL,1,?,?)", rows)
                    database.commit()
            folder = tmp_path / "copied"
            folder.mkdir()
            for file in tmp_path.glob("written.db3*"):
                shutil.copyfile(file, folder / file.name)
            database.rollback()
        database.close()
        return folder / "written.db3"

    return left


def times(path):
    with StoredBag(path) as bag:
        return [time_ns for _, time_ns, _ in bag.messages()], [c.msgcount for c in bag.connections]


@pytest.mark.parametrize("checkpoint", [True, False])
def test_messages_that_are_in_the_write_ahead_log_only_are_read(left, checkpoint, caplog):
    first = [range(20), "PRAGMA wal_checkpoint(TRUNCATE)"] if checkpoint else [range(20)]
    path = left([*first, range(20, 50)])
    before = {file.name: file.read_bytes() for file in path.parent.iterdir()}
    assert [file.name for file in files_left_beside(path)] == ["written.db3-wal"]
    assert times(path) == (list(range(50)), [50])
    assert f"{path} was not closed" in caplog.text
    assert "written.db3-wal is read as well" in caplog.text
    assert {file.name: file.read_bytes() for file in path.parent.iterdir()} == before


def test_changes_that_were_never_completed_are_taken_back(left, caplog):
    path = left(
        [range(400), "PRAGMA cache_size=2", "BEGIN", "UPDATE messages SET timestamp=7"], "DELETE"
    )
    assert [file.name for file in files_left_beside(path)] == ["written.db3-journal"]
    assert times(path) == (list(range(400)), [400])
    assert "written.db3-journal is read as well" in caplog.text


def test_a_log_that_cannot_be_used_is_named_and_the_rest_is_read(left, caplog, monkeypatch):
    path = left([range(20), "PRAGMA wal_checkpoint(TRUNCATE)", range(20, 30)])

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shutil, "copyfile", full)
    assert times(path) == (list(range(20)), [20])
    assert "written.db3-wal cannot be used: No space left on device" in caplog.text


def test_a_database_that_was_closed_is_read_where_it_is(left, caplog):
    path = left([range(5)], "DELETE")
    (path.parent / "written.db3-wal").write_bytes(b"")
    assert files_left_beside(path) == []
    assert times(path) == (list(range(5)), [5])
    assert not caplog.records


@pytest.mark.parametrize("column", ["timestamp", "data"])
@pytest.mark.parametrize("value", ["'text'", "1.5", "NULL"])
def test_cells_of_another_type_are_lost_messages(left, caplog, column, value):
    if (column, value) == ("data", "1.5"):
        value = "4000000000"  # so many bytes would be made of it
    nullable = (
        "ALTER TABLE messages RENAME TO strict",
        ("CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)"),
    )
    moved = "INSERT INTO messages SELECT * FROM strict", "DROP TABLE strict"
    broken = f"UPDATE messages SET {column}={value} WHERE timestamp IN (1, 3)"
    path = left([range(5), *nullable, *moved, broken, range(5, 6)], journal="DELETE")
    assert times(path)[0] == [0, 2, 4, 5]
    said = [r.getMessage() for r in caplog.records if "without a time or" in r.getMessage()]
    assert said
    assert "2 messages lost" in said[0].replace("(0.0 s) ", "")


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    """A database of 300 messages of 2 to 11 kB, and what each of them holds."""
    path = tmp_path_factory.mktemp("closed") / "closed.db3"
    contents = [b"\0\1\0\0" + bytes([1 + n % 255]) * (2000 + 30 * n) for n in range(300)]
    with sqlite3.connect(path) as database:
        database.executescript(TABLES)
        rows = list(enumerate(contents))
        database.executemany("INSERT INTO messages VALUES(NULL,1,?,?)", rows)
        database.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
    database.close()
    return path.read_bytes(), contents


@pytest.mark.parametrize("damage", ["cut", "zeros"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_what_is_left_of_a_damaged_database_is_read(closed, tmp_path, damage, share, caplog):
    whole, contents = closed
    path, place = tmp_path / "damaged.db3", int(share * len(whole))
    damaged = whole[:place] + bytes(len(whole) - place if damage == "zeros" else 0)
    path.write_bytes(damaged)
    with StoredBag(path) as bag:
        found = [(time_ns, bytes(data)) for _, time_ns, data in bag.messages()]
        (loss,) = bag.losses()
    # Later messages are longer.
    assert 300 * share < len(found) < 300
    assert found == list(enumerate(contents))[: len(found)]
    assert loss.read == len(found)
    assert f"{path} is damaged (" in caplog.text
    assert path.read_bytes() == damaged
    assert [file.name for file in tmp_path.iterdir()] == ["damaged.db3"]


def test_a_database_of_something_else_is_refused_as_before(tmp_path):
    path = tmp_path / "other.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE friends(name)")
    database.close()
    with pytest.raises(RecordingError, match="no such table"):
        StoredBag(path)


def test_messages_of_topics_that_are_not_in_the_table_are_a_loss_that_is_counted(left, caplog):
    steps = [range(20), "UPDATE messages SET topic_id=7 WHERE timestamp >= 15"]
    path = left([*steps, range(20, 25)], journal="DELETE")
    assert times(path)[0] == [*range(15), *range(20, 25)]
    (record,) = caplog.records
    assert record.getMessage() == (
        f"{path} has messages of topics that its table of topics does not have (7):"
        " 20 messages (0.0 s) read, 5 messages lost"
    )


def test_a_bag_of_whose_topics_none_is_in_the_table_is_refused(left):
    path = left([range(20), "DELETE FROM topics", range(0)], journal="DELETE")
    with pytest.raises(RecordingError, match="does not have \\(1\\)"):
        StoredBag(path)


def test_a_damaged_database_says_both_what_is_damaged_and_which_topics_it_lacks(
    left, tmp_path, caplog
):
    path = left([range(400), "UPDATE messages SET topic_id=NULL WHERE 0"], journal="DELETE")
    with sqlite3.connect(path) as database:
        database.execute("UPDATE messages SET topic_id=9 WHERE timestamp IN (3, 4)")
    database.close()
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    found, _ = times(path)
    assert 200 < len(found) < 300
    assert found == [n for n in range(len(found) + 2) if n not in (3, 4)]
    assert "is damaged (" in caplog.text
    assert "and has messages of topics that its table of topics does not have (9)" in caplog.text


@pytest.mark.parametrize("column", ["name", "type", "serialization_format"])
def test_a_topic_without_a_name_or_type_does_not_cost_the_others(left, column):
    loose = (
        "CREATE TABLE loose(id INTEGER, name, type, serialization_format, offered_qos_profiles)"
    )
    change = [loose, "INSERT INTO loose SELECT * FROM topics", "DROP TABLE topics"]
    change += ["ALTER TABLE loose RENAME TO topics", "INSERT INTO topics SELECT * FROM topics"]
    change.append("UPDATE topics SET id=2 WHERE rowid=2")
    path = left(
        [range(5), *change, f"UPDATE topics SET {column}=NULL WHERE id=2", range(5, 6)], "DELETE"
    )
    assert times(path)[0] == list(range(6))
