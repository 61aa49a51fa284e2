# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The section ``data``: its presets, and the sentence for each value that is refused."""

import pytest
import yaml

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.data_config import PRESETS, DataConfig, with_preset
from mtpgo_training.training.training_config import dump_config, load_config


def test_values_that_are_given_have_priority_over_those_of_the_preset():
    given = with_preset({"preset": "round_paper", "block_s": 30.0, "mirror_probability": 0.5})
    assert given == {
        "preset": "round_paper",
        "split": "time",
        "block_s": 30.0,
        "validation_fraction": 0.1,
        "test_fraction": 0.1,
        "restart_probability": 0.0,
        "min_future_s": 5.0,
        "stride_s": 1.0,
        "centre_classes": ("car", "truck", "van"),
        "mirror_probability": 0.5,
    }


@pytest.mark.parametrize("data", [{}, {"stride_s": 0.4}, {"preset": ""}, None, [1, 2]])
def test_without_a_preset_the_section_is_unchanged(data):
    assert with_preset(data) is data


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_a_valid_section(name):
    config = DataConfig(preset=name, **PRESETS[name])
    assert config.split == "time"
    assert config.validation_fraction + config.test_fraction < 0.5


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_saved_in_the_configuration_as_plain_values(tmp_path, name):
    path = tmp_path / "config.yaml"
    path.write_text(f"data: {{preset: {name}, stride_s: 0.4}}")
    config = load_config(path)
    assert config.data.stride_s == 0.4  # what the file says goes before the preset
    saved = yaml.safe_load(dump_config(config))["data"]
    assert saved["preset"] == name
    assert (saved["split"], saved["validation_fraction"], saved["test_fraction"]) == (
        "time",
        0.1,
        0.1,
    )
    assert (saved["lane_change_share"] > 0.0) == (name == "highd_paper")
    path.write_text(dump_config(config))
    assert load_config(path) == config


def test_an_unknown_preset_is_answered_with_the_list(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text("data: {preset: highd}")
    with pytest.raises(ConfigurationError, match="'highd', expected one of 'highd_paper', 'round"):
        load_config(path)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"source_weight": {"cars": -1.0}}, r"source_weight.cars is -1.0, expected at least 0"),
        ({"split": "track"}, "data.split is 'track', expected one of 'recording', 'time'"),
        ({"split": "time", "test": ("01",)}, "'01' is given a use by name, expected fractions"),
        ({"block_s": 0.0}, "data.block_s is 0.0, expected more than 0"),
        ({"centre_classes": ("tram",)}, "data.centre_classes is 'tram', expected one of"),
        ({"lane_change_share": 1.0}, "data.lane_change_share is 1.0, expected 0 to less than 1"),
        ({"preset": "highd"}, "data.preset is 'highd', expected one of 'highd_paper', 'round_"),
        ({"source_weight": {"a/01": float("nan")}}, r"source_weight.a/01 is nan, expected at"),
        ({"split": "time", "train": ("a",)}, "data.split is 'time' but the recording 'a' is"),
    ],
)
def test_bad_values_are_one_sentence(changes, sentence):
    with pytest.raises(ConfigurationError, match=sentence) as caught:
        DataConfig(**changes)
    assert "\n" not in str(caught.value)


def test_the_shares_of_memories_of_trails_are_at_most_all():
    DataConfig(trails_none_probability=0.3, trails_partial_probability=0.7)
    with pytest.raises(
        ConfigurationError, match=r"trails_none_probability.* is 1\.1, expected at"
    ):
        DataConfig(trails_none_probability=0.5, trails_partial_probability=0.6)
