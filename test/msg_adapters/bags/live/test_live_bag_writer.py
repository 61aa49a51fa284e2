# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What was written of a live bag stays: after an error, on a full disk, at any moment."""

import contextlib
import resource

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from msg_adapters.bags.live import live_bag_writer
from msg_adapters.bags.live.live_bag_writer import LiveBagWriter
from msg_adapters.bags.stored_bag import StoredBag
from mtpgo_core.errors import RecordingError

NAMES = ["bag", "bag.mcap"]
DATA = b"\0\1\0\0" + bytes(2000)


@contextlib.contextmanager
def disk_of(size):
    """No file of this process may become larger (bytes)."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def begun(path):
    bag = LiveBagWriter(path)
    bag.add_topic("/x", "std_msgs/msg/String")
    return bag


def write(bag, first, last):
    for number in range(first, last):
        bag.write_bytes("/x", number, DATA)


def times(path):
    with StoredBag(path) as bag:
        return [time_ns for _, time_ns, _ in bag.messages()], bag.losses()


@pytest.mark.parametrize("name", NAMES)
def test_messages_can_be_read_when_they_are_flushed(tmp_path, name, monkeypatch):
    monkeypatch.setattr(live_bag_writer, "FLUSH_PERIOD_S", 0.0)
    path = tmp_path / "new" / name
    bag = begun(path)
    assert [p.name for p in path.parent.iterdir()] == [name]  # its own name from the beginning
    assert times(path)[0] == []
    write(bag, 0, 3)
    bag.flush_if_due()
    assert times(path)[0] == [0, 1, 2]
    write(bag, 3, 800)  # a chunk is full after a megabyte
    assert 500 < len(times(path)[0]) < 800
    bag.close()
    assert times(path) == (list(range(800)), [])
    assert (bag.messages, bag.duration_s) == (800, pytest.approx(799e-9))
    assert [p.name for p in path.parent.iterdir()] == [name]
    with AnyReader([path]) as reader:
        assert [c.msgcount for c in reader.connections] == [800]
    single = path if path.is_file() else path / "bag.mcap"
    with single.open("rb") as stream:
        found = list(make_reader(stream, validate_crcs=True).iter_messages())
    assert len(found) == 800


@pytest.mark.parametrize("name", NAMES)
def test_messages_are_not_flushed_before_they_are_due(tmp_path, name, monkeypatch):
    monkeypatch.setattr(live_bag_writer, "FLUSH_PERIOD_S", 3600.0)
    bag = begun(tmp_path / name)
    write(bag, 0, 3)
    bag.flush_if_due()
    assert times(tmp_path / name)[0] == []
    bag.close()


@pytest.mark.parametrize("name", NAMES)
def test_an_error_leaves_a_complete_bag(tmp_path, name):
    path = tmp_path / name
    bag = begun(path)
    write(bag, 0, 5)
    with pytest.raises(KeyError), bag:
        bag.write_bytes("/a topic that was not added", 1, DATA)
    assert times(path) == ([0, 1, 2, 3, 4], [])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("room_for_index", [True, False])
def test_a_full_disk_keeps_what_was_flushed(tmp_path, name, room_for_index):
    path = tmp_path / name
    bag = begun(path)
    write(bag, 0, 10)
    bag.flush()
    write(bag, 10, 20)
    bag.flush()
    size = (path if path.is_file() else path / "bag.mcap").stat().st_size
    bag.add_topic("/late", "std_msgs/msg/Float64")
    write(bag, 20, 30)
    with disk_of(size + (8000 if room_for_index else 300)):
        with pytest.raises(RecordingError, match=f"{path} cannot be written: File too large"):
            bag.flush()
        assert bag.messages == 20
        if room_for_index:
            bag.close()
        else:
            with pytest.raises(RecordingError, match="cannot be written"):
                bag.close()
    read, losses = times(path)
    assert read == list(range(20))
    assert [p.name for p in tmp_path.iterdir()] == [name]
    if room_for_index:
        assert losses == []
        with AnyReader([path]) as reader:
            counts = {c.topic: c.msgcount for c in reader.connections}
        assert counts == {"/x": 20, "/late": 0}
    else:
        assert [(loss.messages, loss.read) for loss in losses] == [(0, 20)]


@pytest.mark.parametrize("name", NAMES)
def test_a_disk_without_any_room_leaves_nothing(tmp_path, name):
    with disk_of(5), pytest.raises(RecordingError, match="cannot be written"):
        LiveBagWriter(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", NAMES)
def test_an_existing_path_is_left_alone(tmp_path, name):
    begun(tmp_path / name).close()
    before = times(tmp_path / name)
    with pytest.raises(RecordingError, match="exists already"):
        LiveBagWriter(tmp_path / name)
    assert times(tmp_path / name) == before
