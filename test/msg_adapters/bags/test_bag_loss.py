# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The sentence about a loss."""

from pathlib import Path

import pytest

from msg_adapters.bags.bag_loss import BagLoss


@pytest.mark.parametrize(
    ("lost", "words"),
    [
        ({"messages": 3, "seconds": 0.25, "exact": True}, "read, 3 messages (0.2 s) lost"),
        ({"messages": 3, "seconds": 0.25}, "read, about 3 messages (0.2 s) lost"),
        ({"messages": 3}, "about 3 messages lost"),
        ({"messages": 0, "seconds": 0.0}, "no message of what was written is lost"),
        ({"seconds": 2.0}, "up to 2.0 s lost, of how many messages is not known"),
        ({}, "how much is lost is not known"),
    ],
)
def test_the_loss_is_stated_in_messages_and_seconds(lost, words):
    sentence = BagLoss(Path("a.mcap"), "is cut off", 7, 1.5, **lost).sentence()
    assert sentence.startswith("a.mcap is cut off: 7 messages (1.5 s) read, ")
    assert words in sentence


def test_nothing_read_is_said():
    sentence = BagLoss(Path("a"), "cannot be read (it is empty)", 0, 0.0).sentence()
    assert sentence == (
        "a cannot be read (it is empty): nothing of it is read, how much is lost is not known"
    )
