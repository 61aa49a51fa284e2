# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of several trainings: new, or one to continue, also when others begin just now."""

import dataclasses
import json

import pytest
import torch
from tiny_run import with_options
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.crossval.planned_training import (
    PlannedFiles,
    keep_facts,
    require_folder_of,
    train_planned,
)
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.run_files import CONFIG_FILE, FACTS_FILE
from mtpgo_training.training.run_folder import load_checkpoint
from mtpgo_training.training.trial.schedule_plan import Budget


@pytest.mark.parametrize("place", ["none", "empty"])
def test_a_new_folder_gets_what_determines_the_results(tmp_path, place):
    facts = tmp_path / place / "study.json"
    (tmp_path / "empty").mkdir()
    keep_facts(facts, {"study": "layers", "rows": [1]}, "study", ("rows",))
    assert json.loads(facts.read_text())["study"] == "layers"
    keep_facts(facts, {"study": "layers", "rows": [1]}, "study", ("rows",))
    with pytest.raises(ConfigurationError, match="study is static, but layers in"):
        keep_facts(facts, {"study": "static", "rows": [1]}, "study", ("rows",))
    with pytest.raises(ConfigurationError, match="the rows differ from those in"):
        keep_facts(facts, {"study": "layers", "rows": [2]}, "study", ("rows",))


def test_something_else_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_text("")
    for path in (tmp_path, tmp_path / "notes.txt"):
        with pytest.raises(ConfigurationError, match="which holds no study, expected a new"):
            require_folder_of(path / "study.json", "study")


def test_what_another_process_is_about_to_write_is_nothing_else(tmp_path):
    """Tasks of a job array begin at the same time, with the same folder."""
    (tmp_path / ".study.json.k3j4").write_text('{"stu')
    require_folder_of(tmp_path / "study.json", "study")
    keep_facts(tmp_path / "study.json", {"study": "layers"}, "study", ())


def test_a_training_that_was_killed_before_its_first_checkpoint_begins_again(tmp_path):
    """Also one that begins with the weights of another, which it finds where they were."""
    config = dataclasses.replace(
        with_options(epochs=1, batch_scenes=8),
        data=DataConfig(stride_s=1.0, validation_stride_s=1.0, validation=("00",)),
    )
    cars = [
        NamedRecording("cars", braking_cars(f"0{n}", tracks=4, seconds=4.0, seed=n))
        for n in range(2)
    ]
    first, second = PlannedFiles(tmp_path / "first"), PlannedFiles(tmp_path / "second")
    train_planned(first, config, cars, Budget(), None)
    train_planned(second, config, cars, Budget(), None, init_from=first.run)
    whole = load_checkpoint(second.run)
    for file in second.run.iterdir():
        if file.is_file() and file.name not in (CONFIG_FILE, FACTS_FILE):
            file.unlink()
    train_planned(second, config, cars, Budget(), None, init_from=first.run)
    again = load_checkpoint(second.run)
    assert again["splits"] == whole["splits"]
    for name, value in whole["average"].items():
        torch.testing.assert_close(again["average"][name], value, rtol=0.0, atol=0.0)
    # With a checkpoint it needs the others no more.
    train_planned(second, config, cars, Budget(), None, init_from=tmp_path / "nowhere")
