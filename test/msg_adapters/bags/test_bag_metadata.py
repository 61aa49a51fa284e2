# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Metadata and QoS profiles of foreign bags: read where they are plain, else left."""

import json
import time

import pytest

from msg_adapters.bags.bag_metadata import qos_of, read_metadata

QOS = """- history: 1
  depth: {depth}
  reliability: 1
  durability: 2
  deadline: {{sec: 0, nsec: 0}}
  lifespan: {{sec: {sec}, nsec: 0}}
  liveliness: 1
  liveliness_lease_duration: {{sec: 0, nsec: 0}}
  avoid_ros_namespace_conventions: {avoid}
"""
PLAIN = {"depth": 5, "sec": 0, "avoid": "false"}
BOMB = "a0: &a0 {q: x, r: y}\n" + "".join(
    f"a{i}: &a{i} {{<<: [*a{i - 1}, *a{i - 1}]}}\n" for i in range(1, 40)
)
LISTS = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 40))
LONGEST_S = 10.0
"""Most processor time of one text. The slowest took 0.35 s, whatever its length, as the library
looks 1024 characters ahead; 2 to the power of 40 lists or 60 000 levels would take hours."""


@pytest.fixture(autouse=True)
def _at_once():
    start_s = time.process_time()
    yield
    assert time.process_time() - start_s < LONGEST_S


def test_a_plain_profile_is_read():
    (profile,) = qos_of(QOS.format(**PLAIN))
    assert (profile.depth, profile.deadline.sec) == (5, 0)
    assert qos_of("") == qos_of(None) == []


@pytest.mark.parametrize(
    "given",
    [
        {"depth": "[1]"},
        {"depth": "1e999"},
        {"depth": "0x" + "f" * 5000},
        {"sec": "{a: b}"},
        {"avoid": "[1]"},
    ],
    ids=lambda given: str(given)[:20],
)
def test_a_profile_of_other_kinds_is_passed_over(given):
    assert qos_of(QOS.format(**{**PLAIN, **given})) == []


@pytest.mark.parametrize(
    "text",
    [
        BOMB,
        json.dumps(BOMB),
        "[" * 60_000,
        "[{" * 30_000,
        "- " * 60_000,
        "#" * 70_000,
        "!!merge a: {b: c}",
    ],
)
def test_a_text_that_stands_for_too_much_is_passed_over(text):
    assert qos_of(text) == []


def about(tmp_path, text, more=""):
    (tmp_path / "metadata.yaml").write_text(
        f"{text}rosbag2_bagfile_information:\n  relative_file_paths: [a_0.mcap]\n{more}"
    )
    return read_metadata(tmp_path)


def test_metadata_of_any_content_are_read_at_once(tmp_path):
    assert "cannot be read" in about(tmp_path, BOMB).problem
    topic = "{topic_metadata: {name: /x, type: a/B, type_description_hash: *a39}}"
    found = about(
        tmp_path, LISTS, f"  compression_mode: *a39\n  topics_with_message_count: [{topic}]\n"
    )
    assert (found.files, found.problem) == (["a_0.mcap"], "")
    assert found.digests == {("/x", "a/B"): ""}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "it is empty"),
        (bytes(300), "it is empty"),
        (b"\xff\xfe\0x", "it is no text in UTF-8"),
        (b"- 1\n- 2\n", "it does not describe a bag"),
        (b"other: 1\n", "it does not describe a bag"),
        (b"rosbag2_bagfile_information: {", "it is no YAML of plain values"),
        (b"a: &a {b: 1}\nc: {<<: *a}\n", "it is no YAML of plain values"),
    ],
)
def test_why_metadata_cannot_be_read_is_said_in_words(tmp_path, content, words):
    (tmp_path / "metadata.yaml").write_bytes(content)
    found = read_metadata(tmp_path)
    assert found.problem == f"has a metadata.yaml that cannot be read ({words})"
    assert found.files == []
