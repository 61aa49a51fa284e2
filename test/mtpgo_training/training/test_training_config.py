# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Configuration files and settings: what is read, what is refused, and with which sentence."""

from pathlib import Path

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.training_config import (
    DataConfig,
    TrainingConfig,
    dump_config,
    load_config,
)

CONFIGS = Path(__file__).parents[3] / "config" / "training"


def written(tmp_path, text):
    path = tmp_path / "c.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_configuration_survives_the_file(tmp_path):
    config = TrainingConfig(
        name="1e3",
        seed=5,
        data=DataConfig(validation=("a/01",), source_weight={"a": 0.5}),
        model={"hidden": 8},
    )
    assert load_config(written(tmp_path, dump_config(config))) == config


def test_an_empty_file_is_the_default(tmp_path):
    assert load_config(written(tmp_path, "")) == TrainingConfig()


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda p: p.name)
def test_shipped_configurations_load(path):
    assert load_config(path).optimisation.epochs > 0


def test_there_are_shipped_configurations():
    assert list(CONFIGS.glob("*.yaml"))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("data: {stride: 1.0}", r"c.yaml.data has the unknown field 'stride'"),
        ("seed: many", r"c.yaml.seed is 'many', expected int"),
        ("data: {stride_s: 0}", r"data.stride_s is 0.0, expected more than 0"),
        ("data: {mirror_probability: 2}", r"data.mirror_probability is 2.0, expected 0 to 1"),
        ("optimisation: {learning_rate_schedule: x}", r"'x', expected one of 'cosine'"),
        ("[1, 2]", r"expected a mapping"),
        ("a: [", r"c.yaml is no YAML"),
        ("seed: 1\nseed: 2", r"c.yaml is no YAML: the key .seed. is given a second time"),
        ("seed: -1", r"seed is -1, expected 0 to 1e\+09"),
        ("seed: 2000000000", r"seed is 2000000000, expected 0 to 1e\+09"),
        ("num_threads: -1", r"num_threads is -1, expected 0 to 1024"),
        ("optimisation: {warmup_steps: -5}", r"warmup_steps is -5, expected at least 0"),
        (
            "optimisation: {weight_decay: -1}",
            r"weight_decay is -1.0, expected at least 0 and finite",
        ),
        (
            "optimisation: {mean_weight: .nan}",
            r"mean_weight is nan, expected at least 0 and finite",
        ),
        ("optimisation: {learning_rate: .inf}", r"learning_rate is inf, expected more than 0"),
        ("optimisation: {learning_rate_floor: 2}", r"learning_rate_floor is 2.0, expected 0 to 1"),
        (
            "data: {rotation_std_rad: -1}",
            r"rotation_std_rad is -1.0, expected at least 0 and finite",
        ),
        ("scene: {classes: [car, ufo]}", r"classes is .*'ufo'.*, expected each once of 'unknown'"),
        ("scene: {classes: [car, car]}", r"classes is .'car', 'car'., expected each once of"),
        ("data: {scale_std: 9}", r"scale_std is 9.0, expected 0 to 1"),
        ("data: {min_future_s: .nan}", r"min_future_s is nan, expected at least 0 and finite"),
        ("data: {stride_s: .inf}", r"stride_s is inf, expected more than 0 and finite"),
        ("data: {source_weight: {a: .inf}}", r"source_weight.a is inf, expected at least 0 and"),
        ("data: {source_weight: {a: x}}", r"source_weight.a is .x., expected at least 0 and"),
    ],
)
def test_a_bad_file_is_answered_with_the_place(tmp_path, text, sentence):
    with pytest.raises(ConfigurationError, match=sentence) as caught:
        load_config(written(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_settings_count_as_if_the_file_said_so(tmp_path):
    path = written(tmp_path, "data: {stride_s: 1.0, source_weight: {a: 2.0}}\nseed: 4")
    settings = ["data.stride_s=0.4", "data.source_weight.b/01=0.5", "model.order=1", "seed=9"]
    config = load_config(path, settings)
    assert (config.data.stride_s, config.seed, config.model) == (0.4, 9, {"order": 1})
    assert config.data.source_weight == {"a": 2.0, "b/01": 0.5}
    assert (
        load_config(path, ["optimisation.learning_rate=1e-3"]).optimisation.learning_rate == 1e-3
    )
    assert load_config(path, ["data.validation=[a/01]"]).data.validation == ("a/01",)
    assert (
        load_config(path, ["optimisation.learning_rate=2E-3"]).optimisation.learning_rate == 2e-3
    )
    same = written(tmp_path, "optimisation: {learning_rate: 1e-3}\nname: 1e3x")
    assert load_config(same).optimisation.learning_rate == 1e-3


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("seed", r"--set is given 'seed', expected KEY=VALUE"),
        ("data.x=[", r"--set is given 'data.x=\[', expected KEY=VALUE in YAML"),
        ("seed.x=1", r"--set 'seed.x=1' names the field 'x' of 4, which has none"),
        ("sed=1", r"c.yaml with --set has the unknown field 'sed'"),
        ("data.stride=1", r"with --set.data has the unknown field 'stride'"),
        ("seed=many", r"with --set.seed is 'many', expected int"),
    ],
)
def test_a_bad_setting_is_one_sentence(tmp_path, setting, sentence):
    with pytest.raises(ConfigurationError, match=sentence) as caught:
        load_config(written(tmp_path, "seed: 4"), [setting])
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r"nowhere.yaml cannot be read"):
        load_config(tmp_path / "nowhere.yaml")
