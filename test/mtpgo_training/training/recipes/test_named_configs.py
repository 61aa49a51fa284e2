# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Configurations by name, from any directory, and files that are made of others."""

import pytest

from models.mtp_go_config import ModelConfig
from mtpgo_core.errors import ConfigurationError
from mtpgo_training import cli
from mtpgo_training.training.networks import network_config
from mtpgo_training.training.recipes.named_configs import find_config, named_configs
from mtpgo_training.training.training_config import dump_config, load_config

PAPER = [
    f"mtp-go{k}{s}-{d}" for k in (1, 2) for s in ("", "-s") for d in ("highd", "round", "ind")
]


def test_every_model_and_data_set_of_the_paper_has_a_name(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        cli.main(["train", "--list"])
    assert ended.value.code == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert set(PAPER) < set(listed)
    assert listed == [config.name for config in named_configs()]


def test_the_summary_of_a_configuration_is_a_whole_sentence():
    summaries = {config.name: config.summary for config in named_configs()}
    assert summaries["own_recordings"] == (
        "A recipe for recordings of your own, from random weights: the network and the losses of"
        " the shipped model, without names of recordings"
    )
    assert summaries["mtp-go1-highd"] == (
        "MTP-GO1 on highD as in the paper: first-order neural ODE"
    )
    assert all(". " not in summary and "\n" not in summary for summary in summaries.values())


@pytest.mark.parametrize("name", PAPER)
def test_the_papers_configurations(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    config = load_config(find_config(name))
    assert config.name == name
    model = network_config(config.network, config.model, config.history, config.scene)
    assert isinstance(model, ModelConfig)
    assert model.order == int(name[6])
    assert model.static_features == ("-s-" in name)
    switches = ("conditioned", "agent_frame", "tied", "hold_standing")
    assert not any(getattr(model, switch) for switch in switches)
    assert (model.motion_input, model.noise_input) == ("network", "velocity")
    assert (model.covariance_inflation, model.noise_floor, model.observation_std_m) == (0, 0, 0)
    assert (config.scene.angles, config.scene.departed_agents) == ("radians", True)
    options = config.optimisation
    assert (options.reduction, options.teacher_forcing, options.calibrated) == ("sum", 1.0, False)
    assert config.scene.context == ("lanes" if name.endswith("highd") else "polar")
    again = tmp_path / "again.yaml"
    again.write_text(dump_config(config), encoding="utf-8")
    assert load_config(again) == config


def test_an_unknown_name_is_answered_with_the_known_ones(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError, match=r"'mtp-go3', expected .* mtp-go2-highd"):
        find_config("mtp-go3")
    (tmp_path / "mine").write_text("name: mine", encoding="utf-8")
    assert load_config(find_config("mine")).name == "mine"


def test_a_name_may_have_its_folder_and_suffix(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    path = find_config("mtp-go1-ind")
    for given in ("paper/mtp-go1-ind", "paper/mtp-go1-ind.yaml", "mtp-go1-ind.yaml"):
        assert find_config(given) == path
    (tmp_path / "default").mkdir()
    assert find_config("default").name == "default.yaml"
    with pytest.raises(ConfigurationError, match=r"no\.yaml cannot be read"):
        load_config(find_config("no.yaml"))


def test_a_file_stands_on_others(tmp_path):
    (tmp_path / "a.yaml").write_text("seed: 3\nmodel: {hidden: 8, modes: 2}", encoding="utf-8")
    (tmp_path / "b.yaml").write_text("base: [a]\nmodel: {hidden: 9}", encoding="utf-8")
    config = load_config(tmp_path / "b.yaml", ["seed=4"])
    assert (config.seed, config.model) == (4, {"hidden": 9, "modes": 2})
    (tmp_path / "a.yaml").write_text("base: [b]", encoding="utf-8")
    with pytest.raises(ConfigurationError, match="names 'b', which is based on this file"):
        load_config(tmp_path / "b.yaml")
    (tmp_path / "b.yaml").write_text("base: a", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"base in .* expected a list of files"):
        load_config(tmp_path / "b.yaml")


def test_a_home_folder_that_no_user_has_is_a_path_like_any_other():
    assert str(find_config("~no_such_user/c.yaml")) == "~no_such_user/c.yaml"
