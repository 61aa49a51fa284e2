# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages from before a clock was set are left out, everything else is played."""

import pytest

from msg_adapters.bags.bag_reader import BagReader
from msg_adapters.bags.mcap_writer import McapWriter
from mtpgo_ros.bags.clock_gap import played_part

NOW_S = 1_700_000_000
DAY_S = 86_400


def part_of(path, times_s):
    with McapWriter(path) as bag:
        bag.add_topic("/x", "std_msgs/msg/Float64")
        for time_s in times_s:
            bag.write_bytes("/x", round(time_s * 1e9), b"\0\1\0\0" + bytes(8))
    with BagReader(path) as bag:
        part = played_part(bag, bag.topics())
    return part.start_ns * 1e-9, part.end_ns * 1e-9, list(part.sentences)


@pytest.mark.parametrize(
    ("times_s", "start_s", "end_s", "words"),
    [
        ([0, *(NOW_S + k for k in range(5))], NOW_S, NOW_S + 4, ["1 message before a gap of 53"]),
        ([1, 2, 3, *(NOW_S + k for k in range(5))], NOW_S, NOW_S + 4, ["3 messages before"]),
        ([5, 6, 7, 8, 9, NOW_S], 5, 9, ["1 message after a gap of 53.9 years left out"]),
        (
            [0, 3 * DAY_S, *(NOW_S + k for k in range(5))],
            NOW_S,
            NOW_S + 4,
            ["a gap of 3.0 days", "a gap of 53"],
        ),
        ([0, 3600, 7200], 0, 7200, []),
        ([k * DAY_S / 2 for k in range(9)], 0, 4 * DAY_S, []),
        ([0], 0, 0, []),
    ],
)
def test_a_gap_of_days_is_left_out_with_a_sentence(tmp_path, times_s, start_s, end_s, words):
    start, end, sentences = part_of(tmp_path / "a.mcap", times_s)
    assert (start, end) == (start_s, end_s)
    assert len(sentences) == len(words)
    for word, sentence in zip(words, sentences, strict=True):
        assert word in sentence
