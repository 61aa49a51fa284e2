# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MCAP files that are whole, cut off or damaged: what is read is a part of what was written."""

import random

import pytest
from mcap.writer import CompressionType, IndexType, Writer

from msg_adapters.bags.mcap_file import McapFile
from msg_adapters.bags.mcap_records import McapError

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
