# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of the report; the whole page is tested with the command."""

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.reports import page
from mtpgo_training.reports.page import prepare_folder


def test_the_folder_is_created_or_refused(tmp_path):
    prepare_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigurationError, match="is a file, expected a folder"):
        prepare_folder(tmp_path / "file")


def test_the_subtitle_names_the_first_twelve_recordings():
    names = [f"{i:02d}" for i in range(1, 15)]
    for count, text in (
        (1, "On 1 recording: 01."),
        (12, f"On 12 recordings: {', '.join(names[:12])}."),
        (14, f"On 14 recordings: {', '.join(names[:12])} and 2 more."),
    ):
        assert page._subtitle({"recordings": dict.fromkeys(names[:count], "")}) == text


def test_the_facts_say_what_was_evaluated():
    content = {
        "weights": {"m": "0123456789abcdef0123"},
        "tasks": {"m": {"policy": "cover", "max_neighbours": 16, "radius_m": 60.0}},
        "recordings": {"01": "fedcba98765432100123"},
        "policy": None,
        "stride_s": 0.2,
        "layout": ["highd"],
        "min_future_s": 0.0,
        "one_sample": False,
        "tracker": "recorded",
        "tracker_seed": None,
    }
    assert page._facts(content) == [
        ("m", "weights 0123456789abcdef, policy cover, up to 16 neighbours within 60 m"),
        ("layout", "highd"),
        ("instants", "every 0.2 s"),
        ("least future", "0 s"),
        ("recording 01", "SHA-256 fedcba9876543210"),
    ]
    changed = {"policy": "each", "stride_s": None, "layout": [], "one_sample": True}
    changed |= {
        "trails": False,
        "tracker": "simulated",
        "tracker_seed": 4,
        "unknown_classes": True,
        "path_smoothing_s": 0.4,
    }
    facts = dict(page._facts(content | changed))
    assert facts["observations"] == "of a simulated tracker, seed 4"
    assert facts["classes"] == "every road user was observed as one of an unknown class"
    assert facts["paths"] == "smoothed with a memory of 0.4 s"
    assert facts["trails"] == "no earlier road user was known"
    assert "policy each" in facts["m"]
    assert facts["layout"] == "the bag's own observations"
    assert facts["instants"] == "those of the bag"
    assert facts["past"].startswith("forgotten before each instant")


def test_a_models_name_becomes_a_file_name():
    assert page._file_name("runs/my model-1.0_b") == "runs_my_model-1.0_b"
