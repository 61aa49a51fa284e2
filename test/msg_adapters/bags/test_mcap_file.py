# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MCAP files that are whole, cut off or damaged: what is read is a part of what was written."""

import random
import struct
import zlib

import pytest
from mcap.writer import CompressionType, IndexType, Writer

from msg_adapters.bags.mcap_file import McapFile
from msg_adapters.bags.mcap_records import MAGIC, McapError

STEP_NS = 100_000_000
COMPRESSIONS = [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]


def payload(number):
    """Half noise, half zeros, so that a compressed chunk consists of several blocks."""
    return random.Random(number).randbytes(1000) + bytes(1000)


def write_file(path, count=40, *, end=True, **options):
    """Messages at 10 Hz on two channels, which are returned."""
    options = {"chunk_size": 20_000, "compression": CompressionType.ZSTD, **options}
    written = []
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channels = [writer.register_channel(f"/{name}", "cdr", schema) for name in "ab"]
        for number in range(count):
            channel = channels[number % 2]
            writer.add_message(channel, number * STEP_NS, payload(number), 0)
            written.append((number * STEP_NS, channel, payload(number)))
        if end:
            writer.finish()
    return written


def read_all(path):
    file = McapFile(path)
    try:
        return list(file.messages(file.channels)), file.loss()
    finally:
        file.close()


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"use_chunking": False},
        {"use_statistics": False},
        {"index_types": IndexType.NONE},
        {"repeat_channels": False},
        {"use_summary_offsets": False, "enable_crcs": False},
    ],
    ids=str,
)
def test_whole_files_of_every_form_are_read_without_a_loss(tmp_path, compression, options):
    path = tmp_path / "a.mcap"
    written = write_file(path, compression=compression, **options)
    assert read_all(path) == (written, None)
    file = McapFile(path)
    assert (file.start_ns, file.end_ns) == (0, 39 * STEP_NS)
    assert [file.channels[number].topic for number in (1, 2)] == ["/a", "/b"]
    assert file.counts == {1: 20, 2: 20}
    part = list(file.messages([2], 5 * STEP_NS, 10 * STEP_NS))
    assert part == [m for m in written[5:10] if m[1] == 2]
    file.close()


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("use_chunking", [True, False])
def test_a_file_cut_at_any_place_is_read_up_to_there(tmp_path, compression, use_chunking):
    path, cut = tmp_path / "a.mcap", tmp_path / "cut.mcap"
    written = write_file(path, compression=compression, use_chunking=use_chunking)
    whole = path.read_bytes()
    before = 0
    for size in [*range(100, len(whole) - 10, 1931), len(whole) - 10]:
        cut.write_bytes(whole[:size])
        read, loss = read_all(cut)
        assert read == written[: len(read)], size
        assert len(read) >= before
        before = len(read)
        assert loss is not None
        assert loss.read == len(read)
    assert before == len(written)


def test_an_incomplete_chunk_is_read_in_part(tmp_path):
    path = tmp_path / "a.mcap"
    options = {"chunk_size": 400_000, "compression": CompressionType.ZSTD}
    written = write_file(path, 400, **options)
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.rindex(b"zstd", 0, 350_000) + 140_000])
    read, loss = read_all(path)
    assert 200 < len(read) < 400
    assert read == written[: len(read)]
    # The chunk's header tells its last time; the number of messages follows from its size.
    assert loss.sentence().startswith(f"{path} is cut off, as when power is lost")
    # 197 messages fill a chunk.
    assert abs(loss.messages - (394 - len(read))) <= 1
    assert loss.seconds == pytest.approx(0.1 * (394 - len(read)))
    assert "about" in loss.sentence()


def test_a_killed_recorders_file_loses_nothing_that_was_written(tmp_path):
    path = tmp_path / "a.mcap"
    written = write_file(path, end=False)
    read, loss = read_all(path)
    assert read == written[: len(read)]
    assert len(read) > 30  # all but the chunk that the recorder still held
    assert "has no end" in loss.sentence()
    assert "no message of what was written is lost" in loss.sentence()


def test_zeros_behind_the_break_are_no_messages(tmp_path):
    # File systems may extend a file before its data reach the disk.
    path = tmp_path / "a.mcap"
    written = write_file(path, end=False)
    size = path.stat().st_size
    with path.open("ab") as stream:
        stream.write(bytes(50_000))
    read, loss = read_all(path)
    assert read == written[: len(read)]
    assert read
    assert f"damaged at byte {size}" in loss.sentence()


@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_the_chunks_around_a_damaged_one_are_read(tmp_path, compression, indexed):
    path = tmp_path / "a.mcap"
    written = write_file(path, compression=compression)
    file = McapFile(path)
    chunks = file.chunks
    file.close()
    data = bytearray(path.read_bytes())
    middle = chunks[1].position + chunks[1].length // 2
    data[middle : middle + 40] = bytes(40)
    path.write_bytes(data if indexed else data[:-300])
    read, loss = read_all(path)
    lost = [m for m in written if chunks[1].start_ns <= m[0] <= chunks[1].end_ns]
    assert read == [m for m in written if m not in lost]
    assert (loss.messages, loss.exact, loss.read) == (len(lost), True, len(read))
    assert loss.seconds == pytest.approx((chunks[1].end_ns - chunks[1].start_ns) * 1e-9)
    assert f"{len(lost)} messages ({loss.seconds:.1f} s) lost" in loss.sentence()


def test_the_chunks_behind_a_broken_record_are_found(tmp_path):
    path = tmp_path / "a.mcap"
    written = write_file(path)
    file = McapFile(path)
    chunks = file.chunks
    file.close()
    data = bytearray(path.read_bytes())[:-300]  # without its index
    data[chunks[1].position : chunks[1].position + 9] = b"\xff" * 9
    path.write_bytes(data)
    read, loss = read_all(path)
    assert read == [m for m in written if not chunks[1].start_ns <= m[0] <= chunks[1].end_ns]
    assert f"damaged at byte {chunks[1].position}" in loss.sentence()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"frame,id\n1,2\n", "does not begin"),
        (b"\x89MCAP0\r\n\x01\xff\xff\xff", "cut off"),
        (b"\x89MCAP0\r\n\x01" + b"\xff" * 8, "cut off"),
    ],
)
def test_other_files_are_refused(tmp_path, content, words):
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(McapError, match=words):
        McapFile(path)


def test_changed_bytes_never_make_a_message_that_was_not_written(tmp_path):
    path, changed = tmp_path / "a.mcap", tmp_path / "changed.mcap"
    written = write_file(path, 20, chunk_size=8_000)
    known = {data for _, _, data in written}
    whole = path.read_bytes()
    rng = random.Random(1)
    for _ in range(100):
        data = bytearray(whole)
        for _ in range(rng.randrange(1, 20)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        if rng.random() < 0.5:
            del data[rng.randrange(len(data)) :]
        changed.write_bytes(data)
        try:
            read, _ = read_all(changed)
        except McapError:
            continue
        assert len(read) <= len(written)
        assert sum(data not in known for _, _, data in read) == 0


def test_chunks_of_an_unknown_compression_are_a_loss_that_is_counted(tmp_path):
    path = tmp_path / "a.mcap"
    written = write_file(path, compression=CompressionType.LZ4)
    path.write_bytes(path.read_bytes().replace(b"\3\0\0\0lz4", b"\3\0\0\0xyz"))
    messages, loss = read_all(path)
    assert not messages
    assert "the compression 'xyz' is not known" in loss.reason
    assert (loss.messages, loss.exact) == (len(written), True)


TEXT = ("std_msgs/msg/String", "ros2msg", "string data")


def record(kind, content):
    return bytes([kind]) + len(content).to_bytes(8, "little") + content


def texts(*values):
    return b"".join(len(text).to_bytes(4, "little") + text for text in map(str.encode, values))


def definitions(topic, number=1, kind=TEXT):
    """A schema and a channel of the same number."""
    own = number.to_bytes(2, "little")
    return record(3, own + texts(*kind)) + record(4, 2 * own + texts(topic, "cdr", ""))


def messages_of(numbers, channel=1):
    return b"".join(
        record(5, struct.pack("<HIQQ", channel, 0, n * STEP_NS, 0) + bytes([n])) for n in numbers
    )


def chunk(content, times=(0, 0), *, compression="", checksum=None):
    checksum = zlib.crc32(content) if checksum is None else checksum
    head = struct.pack("<QQQI", *times, len(content), checksum) + texts(compression)
    return record(6, head + len(content).to_bytes(8, "little") + content)


def write_records(path, *parts):
    """An MCAP file of these records, complete but without an index."""
    end = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC
    path.write_bytes(MAGIC + record(1, texts("ros2", "test")) + b"".join(parts) + end)
    return path


def heard(path):
    """The numbers of the messages by topic, and the loss in words."""
    file = McapFile(path)
    found = {}
    for _, channel, data in file.messages(file.channels):
        found.setdefault(file.channels[channel].topic, []).append(data[0])
    loss = file.loss()
    file.close()
    return found, "" if loss is None else loss.sentence()


@pytest.mark.parametrize("chunked", [True, False])
def test_files_that_were_joined_are_read_one_after_the_other(tmp_path, chunked):
    path, other = tmp_path / "a.mcap", tmp_path / "b.mcap"
    first = write_file(path, use_chunking=chunked)
    parts = definitions("/c") + definitions("/a", 2), messages_of([50, 51]), messages_of([52], 2)
    write_records(other, *((chunk(b"".join(parts)),) if chunked else parts))
    path.write_bytes(path.read_bytes() + other.read_bytes())
    file = McapFile(path)
    topics = {number: channel.topic for number, channel in file.channels.items()}
    found = [(topics[channel], data) for _, channel, data in file.messages(file.channels)]
    loss = file.loss()
    file.close()
    before = [("/a" if channel == 1 else "/b", data) for _, channel, data in first]
    assert found == [*before, ("/c", bytes([50])), ("/c", bytes([51])), ("/a", bytes([52]))]
    assert "holds 2 MCAP files, one behind the other: 43 messages" in loss.sentence()
    assert "no message of what was written is lost" in loss.sentence()


def test_a_whole_file_behind_one_that_is_cut_off_is_found(tmp_path):
    path, other = tmp_path / "a.mcap", tmp_path / "b.mcap"
    first = write_file(path)
    write_records(other, chunk(definitions("/c") + messages_of(range(50, 60))))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + other.read_bytes())
    file = McapFile(path)
    found = list(file.messages(file.channels))
    loss = file.loss()
    file.close()
    assert [data[0] for _, _, data in found[-10:]] == list(range(50, 60))
    assert [data for *_, data in found[:-10]] == [data for *_, data in first[: len(found) - 10]]
    assert len(found) > 20
    assert loss.messages >= 1
    assert "damaged at byte" in loss.sentence()


@pytest.mark.parametrize("rest", [bytes(4096), b"junk", b"\x89MCAP0\r\n"])
def test_bytes_behind_the_end_are_said_and_cost_nothing(tmp_path, rest):
    path = tmp_path / "a.mcap"
    written = write_file(path)
    path.write_bytes(path.read_bytes() + rest)
    read, loss = read_all(path)
    assert read == written
    assert f"has {len(rest)} bytes behind its end that are not part of it" in loss.sentence()
    assert "no message of what was written is lost" in loss.sentence()


def test_a_file_cut_within_the_head_of_a_record_is_cut_off_and_not_damaged(tmp_path):
    path = tmp_path / "a.mcap"
    head = write_records(path, definitions("/a")).read_bytes().index(b"\x0f\x04")
    whole = path.read_bytes()
    for size, words in ((head, "has no end"), (head + 4, "is cut off"), (head + 11, "within its")):
        path.write_bytes(whole[:size])
        assert words in heard(path)[1], size
    # A recorder that was killed before the first message leaves a file shorter than a footer.
    path.write_bytes(whole[: whole.index(b"test") + 4])
    found, loss = heard(path)
    assert (found, "has no end, as when its recorder is killed" in loss) == ({}, True)


def test_a_right_check_sum_counts_for_more_than_the_times_of_a_chunk(tmp_path):
    content = definitions("/a") + messages_of(range(10))
    path = write_records(tmp_path / "a.mcap", chunk(content))
    assert heard(path) == ({"/a": list(range(10))}, "")
    file = McapFile(path)
    assert (file.start_ns, file.end_ns) == (0, 9 * STEP_NS)
    assert [data[0] for _, _, data in file.messages([1], 7 * STEP_NS)] == [7, 8, 9]
    file.close()
    # Where nothing else shows a damage, they do.
    found, loss = heard(write_records(path, chunk(content, checksum=0)))
    assert found == {"/a": [0]}
    assert "lies outside the times of its chunk" in loss


def test_the_loss_of_a_chunk_is_estimated_from_what_it_should_hold(tmp_path):
    parts = [chunk(definitions("/a") + messages_of(range(10)))]
    path = write_records(
        tmp_path / "a.mcap", *parts, chunk(messages_of(range(10, 20)), checksum=7)
    )
    found, loss = heard(path)
    assert found == {"/a": list(range(10))}
    assert "about 10 messages (" in loss
    other = chunk(messages_of(range(10, 20)), compression="some other")
    found, loss = heard(write_records(path, *parts, other))
    assert found == {"/a": list(range(10))}
    assert "the compression 'some other' is not known" in loss
    assert "about 10 messages (" in loss


def test_a_number_that_is_defined_again_stands_for_something_else_from_there_on(tmp_path):
    path = tmp_path / "a.mcap"
    other = ("std_msgs/msg/Char", "ros2msg", "uint8 data")
    again = definitions("/b", kind=other) + messages_of([3, 4])
    write_records(path, chunk(definitions("/a") + messages_of([1, 2])), chunk(again))
    assert heard(path) == ({"/a": [1, 2], "/b": [3, 4]}, "")
    file = McapFile(path)
    kinds = {c.topic: file.schemas[c.schema_id].name for c in file.channels.values()}
    file.close()
    assert kinds == {"/a": TEXT[0], "/b": other[0]}
    # The same definition again is the same channel.
    write_records(path, *(chunk(definitions("/a") + messages_of([n])) for n in (1, 2)))
    assert heard(path) == ({"/a": [1, 2]}, "")


def test_messages_of_a_channel_that_the_index_calls_otherwise_are_a_loss(tmp_path):
    path = tmp_path / "a.mcap"
    write_file(path, compression=CompressionType.NONE)
    whole = path.read_bytes()
    place = whole.index(b"/b", whole.index(b"\x0f\x04\0\0\0\0\0\0\0"))  # in the summary
    path.write_bytes(whole[:place] + b"/z" + whole[place + 2 :])
    # A wrong check sum of the summary would have the file read without it.
    path.write_bytes(path.read_bytes()[:-12] + bytes(4) + MAGIC)
    read, loss = read_all(path)
    assert "channel 2 is /b in a chunk, /z in the index" in loss.sentence()
    # Those of the chunk that has the other definition.
    assert 0 < loss.messages == 40 - len(read)
    assert sum(channel == 1 for _, channel, _ in read) == 20


def test_times_that_no_clock_has_are_a_loss(tmp_path):
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/a", "cdr", writer.register_schema(*TEXT[:2], b"x"))
        writer.add_message(channel, 2**63 + 5, b"x", 0)
        writer.finish()
    read, loss = read_all(path)
    assert (read, loss.messages) == ([], 1)


def with_other_statistics(path, change):
    """Write a file whose statistics count ``change`` messages more for each channel."""
    data = bytearray(path.read_bytes())
    summary = int.from_bytes(data[-28:-20], "little")
    position = summary
    while data[position] != 11:
        position += 9 + int.from_bytes(data[position + 1 : position + 9], "little")
    fields = position + 9
    total = int.from_bytes(data[fields : fields + 8], "little")
    first = fields + 42 + 4  # behind numbers, times and the length of the list
    for number, (_, more) in enumerate(sorted(change.items())):
        place = first + 10 * number + 2
        count = int.from_bytes(data[place : place + 8], "little") + more
        data[place : place + 8] = count.to_bytes(8, "little")
        total += more
    data[fields : fields + 8] = total.to_bytes(8, "little")
    path.write_bytes(data)


def test_fewer_messages_than_the_statistics_count_are_a_loss_of_those_read(tmp_path):
    path = tmp_path / "a.mcap"
    written = write_file(path, enable_crcs=False)
    with_other_statistics(path, {1: 5, 2: 0})
    found, loss = read_all(path)
    assert found == written
    assert "its chunks hold fewer messages than its summary counts" in loss.sentence()
    assert (loss.read, loss.messages, loss.exact) == (40, 5, True)
    file = McapFile(path)
    assert [m for m in written if m[1] == 2] == list(file.messages([2]))
    assert file.loss() is None
    assert list(file.messages([1], 5 * STEP_NS, 10 * STEP_NS))
    assert file.loss() is None  # a part tells nothing of the whole
    file.close()


def test_a_chunk_with_fewer_messages_than_its_index_is_a_loss(tmp_path):
    path = tmp_path / "a.mcap"
    written = write_file(path, compression=CompressionType.NONE, enable_crcs=False)
    file = McapFile(path)
    chunk = file.chunks[1]
    file.close()
    data = bytearray(path.read_bytes())
    # Of the last message in the chunk a record of an application is made.
    content = data[chunk.position : chunk.position + chunk.length]
    last = content.rindex(b"\x05" + (22 + 2000).to_bytes(8, "little"))
    data[chunk.position + last] = 0x80
    path.write_bytes(data)
    found, loss = read_all(path)
    assert len(found) == len(written) - 1
    assert set(found) < set(written)
    assert "a chunk holds fewer messages than the index counts" in loss.sentence()
    assert (loss.read, loss.messages, loss.exact) == (39, 1, True)


def test_messages_of_a_channel_that_no_record_defines_are_a_loss(tmp_path):
    path = tmp_path / "a.mcap"
    written = write_file(path, compression=CompressionType.NONE, enable_crcs=False)
    data = bytearray(path.read_bytes())
    file = McapFile(path)
    chunk = file.chunks[0]
    file.close()
    content = data[chunk.position : chunk.position + chunk.length]
    last = content.rindex(b"\x05" + (22 + 2000).to_bytes(8, "little"))
    place = chunk.position + last + 9
    data[place : place + 2] = (77).to_bytes(2, "little")
    path.write_bytes(data)
    found, loss = read_all(path)
    assert len(found) == len(written) - 1
    assert "the definition of a topic is lost" in loss.sentence()
    assert loss.messages == 1
