# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A small training: it learns, it goes on after an interruption as if nothing had happened."""

import csv
import dataclasses

import pytest
import torch
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task import SceneConfig
from mtpgo_training.config import DataConfig, OptimisationConfig, TrainingConfig
from mtpgo_training.run_folder import RunFolder, load_checkpoint
from mtpgo_training.splits import NamedRecording
from mtpgo_training.train import train

CONFIG = TrainingConfig(
    num_threads=1,
    data=DataConfig(
        validation=("03",), validation_stride_s=1.0, stride_s=0.4, restart_probability=0.2
    ),
    scene=SceneConfig(max_neighbours=3),
    model={
        "hidden": 16,
        "modes": 2,
        "horizon_steps": 10,
        "layer": "graphconv",
        "integrator": "euler",
        "ode_hidden": 4,
    },
    optimisation=OptimisationConfig(
        epochs=8, batch_scenes=8, learning_rate=1e-2, warmup_steps=5, teacher_forcing=0.3
    ),
)


def recordings(*seeds):
    return [
        NamedRecording("cars", braking_cars(f"{seed:02d}", seed=seed, tracks=8, seconds=5.0))
        for seed in seeds
    ]


def run(folder, config=CONFIG, **options):
    return train(config, recordings(1, 2, 3), RunFolder(folder), progress=False, **options)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "whole"
    torch.set_num_threads(1)
    return run(folder), folder


def test_it_learns_what_constant_velocity_misses(whole):
    trainer, _ = whole
    scores = trainer.table.models
    assert scores["model"]["all"]["ade"] < 0.7 * scores["cv"]["all"]["ade"]
    assert scores["model"]["all"]["n"] == scores["cv"]["all"]["n"] > 20


def test_the_log_has_a_line_an_epoch_with_baselines_beside(whole):
    _, folder = whole
    with (folder / "log.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["epoch"] for row in rows] == [str(n) for n in range(1, 9)]
    assert rows[0]["objective"] == "EWTA(2)"
    assert rows[-1]["objective"] == "NLL"
    assert float(rows[-1]["all_ade"]) < float(rows[-1]["cv_all_ade"])
    assert {"all_fde", "all_anll", "centre_ade", "ca_all_ade"} <= set(rows[0])


def test_a_resumed_run_ends_with_the_same_weights(whole, tmp_path):
    trainer, _ = whole
    folder = tmp_path / "resumed"
    stopped = run(folder, max_minutes=0.0)
    assert stopped.epoch == 0  # the time was up within the first epoch
    first = run(folder, resume=True, max_minutes=1e-9)
    assert first.epoch == 0
    # Interrupt in the middle: forget what came after the third epoch.
    third = _train_until(folder, epoch=3)
    assert third.epoch == 3
    again = run(folder, resume=True)
    assert again.epoch == 8
    for name, value in trainer.model.state_dict().items():
        torch.testing.assert_close(again.model.state_dict()[name], value, rtol=0.0, atol=0.0)
    assert again.best == trainer.best
    assert len(again.rows) == 8


def _train_until(folder, epoch):
    """Go on with a run and kill it, as by a signal, when an epoch's checkpoint is written."""

    class Killed(Exception):  # noqa: N818
        pass

    class Folder(RunFolder):
        def write_log(self, rows):
            super().write_log(rows)
            if len(rows) == epoch:
                raise Killed

    with pytest.raises(Killed):
        train(CONFIG, recordings(1, 2, 3), Folder(folder), progress=False, resume=True)

    class At:
        pass

    at = At()
    at.epoch = load_checkpoint(RunFolder(folder).last)["epoch"]
    return at


def test_an_existing_folder_is_not_overwritten(whole):
    with pytest.raises(ConfigurationError, match="exists already, expected a new one or --resume"):
        run(whole[1])


def test_only_the_same_configuration_and_data_are_resumed(whole):
    other = dataclasses.replace(CONFIG, seed=2)
    with pytest.raises(ConfigurationError, match=r"differs from .*config.yaml"):
        run(whole[1], config=other, resume=True)
    with pytest.raises(ConfigurationError, match=r"recordings differ from those in .*run.json"):
        train(CONFIG, recordings(1, 3), RunFolder(whole[1]), resume=True, progress=False)


def test_nothing_to_resume_is_said(tmp_path):
    with pytest.raises(ConfigurationError, match="holds no run to resume"):
        run(tmp_path / "nothing", resume=True)


def test_an_unknown_model_option_is_named(tmp_path):
    config = dataclasses.replace(CONFIG, model={"hiden": 3})
    with pytest.raises(ConfigurationError, match=r"model: .*unknown field 'hiden'"):
        run(tmp_path / "x", config=config)
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("content", [b"", b"no checkpoint", b"PK\x03\x04truncated"])
def test_an_unreadable_checkpoint_is_one_sentence(tmp_path, content):
    path = tmp_path / "last.pt"
    path.write_bytes(content)
    with pytest.raises(ConfigurationError, match=r"last.pt is no readable checkpoint") as caught:
        load_checkpoint(path)
    assert "\n" not in str(caught.value)
