# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Remarks: said once for what is read together, and again from the cache, wherever files are."""

import pytest

from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.checks.reading_remarks import (
    keeping,
    keeping_all,
    packed_remarks,
    remark,
    say_again,
)
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.parallel.kept_results import kept_or_made


def said(caplog):
    sentences = [record.getMessage() for record in caplog.records]
    caplog.clear()
    return sentences


def test_a_remark_is_said_once_within_a_block_and_kept_around_it(caplog):
    inner, outer = [], []
    with keeping(outer):
        with keeping(inner):
            remark("a: odd")
            remark("a: odd")
        remark("a: odd")
        remark("b: odd")
    remark("b: odd")
    assert said(caplog) == ["mtpgo: a: odd", "mtpgo: b: odd", "mtpgo: b: odd"]
    assert (inner, outer) == (["a: odd"], ["a: odd", "b: odd"])


def test_remarks_of_items_are_kept_and_no_others(caplog):
    def items():
        for i in range(3):
            remark("a: odd")
            yield i

    kept = []
    for i in keeping_all(items(), kept):
        remark(f"{i}: between")
    assert kept == ["a: odd"]
    assert len(said(caplog)) == 4


def test_a_remark_names_the_files_where_they_are_now(tmp_path, caplog):
    old, new = [[tmp_path / f / name for name in ("a", "a.csv")] for f in ("old", "new")]
    column = packed_remarks([f"{old[1]}: odd", f"{tmp_path / 'old'}: bag", "table a: odd"], old)
    say_again(column, new)
    assert said(caplog) == [
        f"mtpgo: {new[1]}: odd", f"mtpgo: {tmp_path / 'new'}: bag", "mtpgo: table a: odd"
    ]  # fmt: skip


COLUMNS = "columns: {track: id, frame: f, x: x, y: y, class: k}\nframe_rate: 10\n"


@pytest.fixture
def options(tmp_path):
    (tmp_path / "columns.yaml").write_text(COLUMNS)
    return ReadingOptions(columns=tmp_path / "columns.yaml")


def test_what_was_lost_is_said_again_from_the_cache(tmp_path, caplog, options):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.csv").write_text("f,id,x,y,k\n0,1,0,0,ufo\n1,1,,,ufo\n")
    cache = RecordingCache(tmp_path / "cache")
    for folder, kept in (("one", None), ("one", cache), ("one", cache), ("two", cache)):
        load_recordings(tmp_path / folder, "table", options=options, cache=kept)
        path = tmp_path / folder / "a.csv"
        lost, unknown = said(caplog)
        assert lost.startswith(f"mtpgo: {path}: 1 row(s) without a position")
        assert unknown.startswith(f"mtpgo: {path}: no class is known by the name 'ufo'")
    assert len([entry for entry in cache.folder.iterdir() if entry.is_dir()]) == 1


def test_a_clue_to_another_unit_is_said_each_time(tmp_path, caplog, options):
    rows = "".join(f"{f * 1000},1,{f},0,car\n{f * 1000 + 999},1,{f},0,car\n" for f in range(9))
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "a.csv").write_text("f,id,x,y,k\n" + rows)
    cache = RecordingCache(tmp_path / "cache")
    for _ in range(2):
        load_recordings(tmp_path / "d", "table", options=options, cache=cache)
        (sentence,) = said(caplog)
        assert "table a, recording a: a row of a road user every" in sentence


def test_a_kept_result_comes_with_its_remarks(tmp_path, caplog):
    def make():
        remark("a.csv: odd")
        return 3

    for _ in range(2):
        assert kept_or_made(tmp_path, {"what": "test"}, make, [], make) == 3
        assert said(caplog) == ["mtpgo: a.csv: odd"]
