# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings that a model has seen, found by their hashes."""

from mtpgo_training.evaluation.training_overlap import (
    overlap_by_model,
    overlap_warnings,
    training_hashes,
    uses_of,
)


def test_overlap_with_training_is_always_reported():
    training = {
        "recordings": [
            {"sha256": "a", "split": "train"},
            {"sha256": "a", "split": "test"},
            {"sha256": "b", "split": "validation"},
            {"sha256": "c", "split": "test"},
            {"sha256": "", "split": "train"},
        ]
    }
    assert uses_of(training, "a") == ["train", "test"]
    assert uses_of(training, "") == []
    seen = overlap_by_model(
        {"m": training}, {"01": "a", "02": "b", "03": "c", "04": "d", "05": ""}
    )
    assert seen == {"m": {"train": ["01"], "validation": ["02"]}}
    warnings = overlap_warnings(seen)
    assert warnings[0].startswith("m was trained on 01")
    assert warnings[1].startswith("m was chosen or calibrated on 02")


def test_only_training_and_validation_make_a_recording_known():
    entries = [{"sha256": use, "split": use} for use in ("train", "validation", "test")]
    broken = ["a text", {"split": "train"}]
    assert training_hashes({"recordings": [*entries, *broken]}) == {"train", "validation"}
    assert training_hashes({}) == set()
    assert uses_of({"recordings": [*entries, *broken]}, "test") == ["test"]


def test_each_model_and_use_has_one_sentence_with_all_its_recordings():
    overlaps = {"a": {"train": ["01", "02"], "validation": []}, "b": {"validation": ["03"]}}
    assert overlap_warnings(overlaps) == [
        "a was trained on 01, 02: its results include what it has memorised",
        "b was chosen or calibrated on 03: its results there are a little too good",
    ]
