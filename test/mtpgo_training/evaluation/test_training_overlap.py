# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings that a model has seen, found by their hashes."""

from mtpgo_training.evaluation.training_overlap import (
    is_known,
    overlap_by_model,
    overlap_warnings,
    uses_of,
)


def test_overlap_with_training_is_always_reported():
    training = {
        "recordings": [
            {"sha256": "a", "split": "train"},
            {"sha256": "a", "split": "test"},
            {"sha256": "b", "split": "validation"},
            {"sha256": "b", "split": "calibration"},
            {"sha256": "c", "split": "test"},
            {"sha256": "d", "split": "test"},
            {"sha256": "d", "split": "calibration"},
            {"sha256": "", "split": "train"},
        ]
    }
    assert uses_of(training, "a") == ["train", "test"]
    assert uses_of(training, "") == []
    seen = overlap_by_model(
        {"m": training}, {"01": "a", "02": "b", "03": "c", "04": "d", "05": "", "06": "e"}
    )
    assert seen == {"m": {"train": ["01"], "validation": ["02"], "calibration": ["04"]}}
    warnings = overlap_warnings(seen)
    assert warnings[0].startswith("m was trained on 01")
    assert warnings[1].startswith("m was chosen or calibrated on 02")
    assert warnings[2].startswith("m was calibrated on 04")


def test_only_training_and_validation_make_a_recording_known():
    entries = [{"sha256": use, "split": use} for use in ("train", "validation", "test")]
    broken = ["a text", {"split": "train"}]
    training = {"recordings": [*entries, *broken]}
    known = [use for use in ("train", "validation", "test", "other") if is_known(training, use)]
    assert known == ["train", "validation"]
    assert not is_known({}, "train")
    assert uses_of({"recordings": [*entries, *broken]}, "test") == ["test"]


def test_other_parts_of_a_recording_are_not_known():
    """As after an adaptation to the first 480 s, of which the last quarter is validation."""
    entries = [
        {"sha256": "a", "name": "01@0-480s@0-350s", "split": "train"},
        {"sha256": "a", "name": "01@0-480s@358-472s", "split": "validation"},
        {"sha256": "b", "name": "02", "split": "train"},
    ]
    training = {"recordings": entries}
    assert uses_of(training, "a", "01@480-846s") == []
    assert uses_of(training, "a", "data/01@340-355s") == ["train"]
    assert uses_of(training, "a", "01@350-400s") == ["validation"]
    assert uses_of(training, "a", "01@340-846s@0-20s") == ["train", "validation"]  # 340 to 360 s
    assert uses_of(training, "a", "01@340-846s@140-846s") == []  # from 480 s on
    assert uses_of(training, "a", "01") == ["train", "validation"]
    assert uses_of(training, "b", "02@60-70s") == ["train"]


def test_each_model_and_use_has_one_sentence_with_all_its_recordings():
    overlaps = {"a": {"train": ["01", "02"], "validation": []}, "b": {"validation": ["03"]}}
    assert overlap_warnings(overlaps) == [
        "a was trained on 01, 02: its results include what it has memorised",
        "b was chosen or calibrated on 03: its results there are a little too good",
    ]
