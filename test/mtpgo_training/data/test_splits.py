# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Splits: no frame has two uses, a whole window lies between blocks, names find recordings."""

import dataclasses
import itertools

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.data.data_sources import DataSource, read_sources
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.splits import USES, NamedRecording, split, window_s
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.scenes.prepared_recording import prepare, source_weight
from mtpgo_training.training.training_config import DataConfig

HISTORY = HistoryConfig()
GUARD_S = window_s(HISTORY, 25)
BY_TIME = DataConfig(
    split="time", block_s=20.0, validation_fraction=0.1, test_fraction=0.1, restart_probability=0.0
)


def recordings(*seconds, rate=10.0):
    return [
        NamedRecording("cars", braking_cars(f"{n:02d}", seconds=s, tracks=3, rate=rate, seed=n))
        for n, s in enumerate(seconds, start=1)
    ]


def parts_of(splits, whole):
    """(use, first, last) frames of the parts of a recording, by time."""
    found = [
        (int(item.recording.frame[0]), int(item.recording.frame[-1]), use)
        for use in USES
        for item in getattr(splits, use)
        if item.whole == whole
    ]
    return sorted(found)


@pytest.mark.parametrize("seed", range(4))
def test_no_frame_has_two_uses_and_the_guard_is_kept(seed):
    pool = recordings(300.0, 181.0, 97.0)
    splits = split(pool, BY_TIME, seed, GUARD_S)
    borders = 0
    for item in pool:
        for before, after in itertools.pairwise(parts_of(splits, item.whole)):
            assert before[2] != after[2]  # neighbours of one use are joined
            assert (after[0] - before[1]) / 10.0 >= GUARD_S - 1e-6
            borders += 1
    assert borders > 3


def test_no_instant_is_in_windows_of_two_uses():
    pool = recordings(200.0)
    splits = split(pool, BY_TIME, 3, GUARD_S)
    shown = {}
    for use in USES:
        times = []
        for item in getattr(splits, use):
            source = prepare(item.recording, HISTORY, SceneConfig(), BY_TIME, training=True)
            for tracked in source.windows:
                now = tracked.window.stamp_ns
                seen = tracked.window.valid.any(axis=0)
                times += [now - (15 - i) * 200_000_000 for i in np.flatnonzero(seen)]
                known = source.future.at(tracked.track, now, 25, 0.2).known.any(axis=0)
                times += [now + (k + 1) * 200_000_000 for k in np.flatnonzero(known)]
        shown[use] = np.unique(times)
    for one, two in itertools.combinations(USES, 2):
        assert len(shown[one])
        assert len(shown[two])
        apart = np.abs(shown[one][:, None] - shown[two][None]).min()
        assert apart >= GUARD_S * 1e9 - 1e3


def test_the_fractions_hold_for_the_time():
    pool = recordings(*[400.0] * 5)
    splits = split(pool, BY_TIME, 1, GUARD_S)
    time = {use: sum(i.recording.duration_s for i in getattr(splits, use)) for use in USES}
    assert 0.06 < time["validation"] / 2000.0 < 0.11
    assert 0.06 < time["test"] / 2000.0 < 0.11
    assert time["train"] / 2000.0 > 0.65  # the rest are guards


def test_the_draw_follows_from_the_seed():
    pool = recordings(300.0, 300.0)
    one, same = split(pool, BY_TIME, 1, GUARD_S), split(pool, BY_TIME, 1, GUARD_S)
    other = split(pool, BY_TIME, 2, GUARD_S)
    assert one.describe() == same.describe() != other.describe()


def test_parts_are_named_and_keep_the_hash_of_the_whole():
    described = split(recordings(120.0), BY_TIME, 0, GUARD_S).describe()
    assert all(entry["name"].startswith("01@") and entry["name"].endswith("s")
               for entry in described)  # fmt: skip
    assert len({entry["sha256"] for entry in described}) == 1
    assert {entry["split"] for entry in described} == set(USES)


def test_a_part_is_read_again_by_its_name(tmp_path):
    write_ind(braking_cars("01", seconds=120.0, tracks=3), tmp_path)
    named = list(read_sources([DataSource(tmp_path, "ind")]))
    splits = split(named, BY_TIME, 0, GUARD_S)
    for use in USES:
        for item in getattr(splits, use):
            (again,) = load_recordings(tmp_path, "ind", [item.recording.name])
            assert again.name == item.recording.name
            np.testing.assert_array_equal(again.frame, item.recording.frame)
            np.testing.assert_array_equal(again.position, item.recording.position)
    both = load_recordings(tmp_path, "ind", ["01@0-5s", "01", "01@7.5-9s"])
    assert [r.name for r in both] == ["01", "01@0-5s", "01@7.5-9s"]
    for name, sentence in (
        ("02@0-5s", "has no recording '02', it has none"),
        ("01@500-600s", "no road user from 500 to 600 s, it lasts 119"),
    ):
        with pytest.raises(RecordingError, match=sentence):
            load_recordings(tmp_path, "ind", [name])


def test_recordings_of_one_block_are_assigned_as_a_whole():
    pool = recordings(*[15.0] * 10)
    splits = split(pool, BY_TIME, 0, GUARD_S)
    assert [len(getattr(splits, use)) for use in USES] == [8, 1, 1]
    assert all("@" not in item.name for use in USES for item in getattr(splits, use))


def test_too_short_for_blocks_is_one_sentence():
    sentence = r"no block of 20 s \(data\.block_s\) is left for data\.validation out of 1"
    data = dataclasses.replace(BY_TIME, validation_fraction=0.0, test_fraction=0.0)
    with pytest.raises(ConfigurationError, match=sentence):
        split(recordings(9.0), data, 0, GUARD_S)


BY_END = DataConfig(split="end", validation_fraction=0.25, restart_probability=0.0)


def test_the_end_of_a_recording_validates_and_the_guard_is_kept():
    splits = split(recordings(200.0), BY_END, 0, GUARD_S)
    (train, validation) = parts_of(splits, "01")
    assert (train[2], validation[2]) == ("train", "validation")
    assert train[0] == 0
    assert 1498 - 40 - 1 <= train[1] <= 1498 - 40 + 1  # three quarters of 199.9 s, half a guard
    assert (validation[0] - train[1]) / 10.0 == pytest.approx(GUARD_S, abs=0.2)
    assert validation[1] == 1999
    other_seed = split(recordings(200.0), BY_END, 5, GUARD_S)
    assert parts_of(other_seed, "01") == [train, validation]


def test_the_last_recordings_of_each_directory_validate():
    pool = named(*(f"{d}/{i:02d}" for d in "ab" for i in range(4)))
    splits = split(pool, BY_END, 0, GUARD_S)
    assert names(splits.validation) == ["a/03", "b/03"]
    assert names(splits.train) == ["a/00", "a/01", "a/02", "b/00", "b/01", "b/02"]
    both = dataclasses.replace(BY_END, test_fraction=0.25)
    splits = split(pool, both, 0, GUARD_S)
    assert names(splits.validation) == ["a/02", "b/02"]
    assert names(splits.test) == ["a/03", "b/03"]


def test_a_border_near_an_end_is_moved_so_that_both_parts_have_a_whole_window():
    data = dataclasses.replace(BY_END, validation_fraction=0.02)
    (train, validation) = parts_of(split(recordings(100.0), data, 0, GUARD_S), "01")
    assert (validation[1] - validation[0]) / 10.0 == pytest.approx(GUARD_S, abs=0.2)
    assert train[0] == 0


def test_too_short_to_be_divided_is_one_sentence():
    sentence = r"no part of at least 12 s \(data.split is 'end'\) is left for data.validation"
    with pytest.raises(ConfigurationError, match=sentence):
        split(recordings(20.0), BY_END, 0, GUARD_S)


def test_a_division_by_time_and_names_do_not_go_together():
    with pytest.raises(ConfigurationError, match=r"data\.split is 'end' but the recording '01'"):
        DataConfig(split="end", validation=("01",))


def test_fractions_of_recordings_are_drawn_for_the_test_too():
    pool = recordings(*[5.0] * 10)
    data = DataConfig(validation_fraction=0.1, test_fraction=0.2)
    splits = split(pool, data, 5)
    assert [len(getattr(splits, use)) for use in USES] == [7, 1, 2]
    # The draw for validation is the one without a test.
    assert splits.validation == split(pool, DataConfig(validation_fraction=0.1), 5).validation


def test_where_the_training_is_named_all_others_can_be_drawn():
    named = DataConfig(train=("01",), validation_fraction=0.1, test_fraction=0.5)
    splits = split(recordings(20.0, 20.0, 20.0), named, seed=1)
    assert [len(getattr(splits, use)) for use in USES] == [1, 1, 1]
    assert splits.train[0].name == "cars/01"
    splits = split(recordings(20.0, 20.0), DataConfig(train=("01",)), seed=1)
    assert [item.name for item in splits.validation] == ["cars/02"]


def test_the_weight_of_a_recording_is_that_of_its_parts():
    """As a study and a sweep split: first by time, then the parts by their names."""
    data = dataclasses.replace(BY_TIME, source_weight={"cars/01": 2.0})
    parts = split(recordings(200.0, 200.0), data, 1, GUARD_S)
    pool = [item for use in USES for item in getattr(parts, use)]
    again = dataclasses.replace(
        data, split="recording", validation=tuple(item.name for item in parts.validation),
        test=tuple(item.name for item in parts.test), train=tuple(i.name for i in parts.train),
    )  # fmt: skip
    assert split(pool, again, 1) == parts
    weights = {item.whole: source_weight(item, again) for item in parts.train}
    assert weights == {"01": 2.0, "02": 1.0}
    with pytest.raises(ConfigurationError, match="source_weight names 'cars/03'"):
        split(pool, dataclasses.replace(again, source_weight={"cars/03": 2.0}), 1)


def test_a_weight_for_a_recording_that_is_not_there_is_refused():
    data = DataConfig(source_weight={"cars/07": 1.0})
    with pytest.raises(ConfigurationError, match="'cars/07', expected one of cars/01, cars/02"):
        split(recordings(5.0, 5.0), data, 0)


def named(*names):
    pairs = (name.split("/") for name in names)
    return [NamedRecording(d, braking_cars(n, tracks=1, seconds=1.0)) for d, n in pairs]


def names(group):
    return [item.name for item in group]


def test_names_find_recordings_with_and_without_their_directory():
    splits = split(
        named("a/01", "a/02", "b/01", "b/03"),
        DataConfig(validation=("b/01",), test=("02",)),
        seed=1,
    )
    assert names(splits.train) == ["a/01", "b/03"]
    assert names(splits.validation) == ["b/01"]
    assert names(splits.test) == ["a/02"]


def test_a_fraction_draws_whole_recordings_the_same_ones_for_a_seed():
    pool = named(*(f"a/{i:02d}" for i in range(10)))
    data = DataConfig(validation_fraction=0.3)
    first, again = split(pool, data, 1), split(pool, data, 1)
    assert names(first.validation) == names(again.validation)
    assert len(first.validation) == 3
    assert len(first.train) == 7
    assert not set(names(first.train)) & set(names(first.validation))


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (DataConfig(validation=("09",)), r"names '09', expected one of a/01, a/02"),
        (DataConfig(validation=("01",), test=("a/01",)), r"a/01 is in data.validation and in"),
        (DataConfig(validation=("01", "02")), r"no recording is left for data.train"),
        (DataConfig(validation_fraction=0.0), r"no recording is left for data.validation"),
    ],
)
def test_a_split_that_cannot_be_made_is_refused(data, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        split(named("a/01", "a/02"), data, seed=1)
