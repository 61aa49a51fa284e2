# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The checkpoint of a model file: small, plain, and a start for a training or an export."""

import dataclasses

import pytest
import torch
from site_data import base_checkpoint, write_base
from tiny_run import new_run

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task.model_file import find_checkpoint, load_task
from mtpgo_training import cli
from mtpgo_training.export.exporter import describe, load_model
from mtpgo_training.export.model_calibration import own_calibration
from mtpgo_training.export.shipped_checkpoint import require_pair, write_shipped_checkpoint
from mtpgo_training.training.checkpointing import start_from
from mtpgo_training.training.networks import weights_hash
from mtpgo_training.training.run_folder import load_checkpoint


def task_of(checkpoint, name="tiny"):
    """The task description of the model file that is exported from a checkpoint."""
    task = dataclasses.replace(describe(checkpoint, name), metrics={"validation": {"model": {}}})
    return dataclasses.replace(task, model=load_model(checkpoint).config.to_dict())


def test_it_holds_the_weights_alone_and_is_small(tmp_path):
    checkpoint = base_checkpoint()
    weights = checkpoint["average"]
    name = next(name for name, value in weights.items() if value.is_floating_point())
    shape = weights[name].shape
    weights[name] = torch.zeros(1000, *shape, dtype=torch.float64)[3]  # a view of large memory
    resumption = {"optimiser": {"state": torch.zeros(10_000)}, "model": weights, "state": {}}
    path = tmp_path / "tiny.ckpt"
    write_shipped_checkpoint(checkpoint | resumption, task_of(checkpoint, "other"), path)
    loaded = load_checkpoint(path)
    assert set(loaded) == {"format", "calibration", *checkpoint}
    assert loaded["covariance_scale"] == 1.3
    assert loaded["config"] == {**checkpoint["config"], "name": "other"}
    floats = [v for v in loaded["average"].values() if v.is_floating_point()]
    assert {value.dtype for value in floats} == {torch.float32}
    size = sum(value.numel() * value.element_size() for value in loaded["average"].values())
    assert path.stat().st_size < size + 40_000


def test_a_training_and_an_export_start_from_it(tmp_path):
    checkpoint, path = base_checkpoint(), tmp_path / "tiny.ckpt"
    write_shipped_checkpoint(checkpoint, task_of(checkpoint), path)
    run = new_run(seed=8)
    start_from(run, load_checkpoint(path), path)
    for name, value in load_model(load_checkpoint(path)).state_dict().items():
        assert torch.equal(run.model.state_dict()[name], value)


def test_an_export_writes_it_beside_the_model_file(tmp_path):
    run, model = write_base(tmp_path / "run"), tmp_path / "mine.pt"
    command = ["export", str(run), "-o", str(model), "--name", "mine"]
    assert cli.main([*command, "--checkpoint", str(tmp_path / "mine.ckpt")]) == 0
    checkpoint = load_checkpoint(find_checkpoint(model))
    assert checkpoint["config"]["name"] == "mine"
    assert weights_hash(load_model(checkpoint)) == load_task(model).weights_sha256
    assert own_calibration(checkpoint) == load_task(model).calibration


def test_a_place_that_cannot_be_written_is_one_sentence(tmp_path):
    checkpoint = base_checkpoint()
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(ConfigurationError, match=r"tiny\.ckpt cannot be written: "):
        write_shipped_checkpoint(checkpoint, task_of(checkpoint), tmp_path / "file" / "tiny.ckpt")


def test_a_checkpoint_of_another_model_beside_a_model_file_is_not_taken(tmp_path, capsys):
    model, beside = tmp_path / "mine.pt", tmp_path / "mine.ckpt"
    run, other = write_base(tmp_path / "run"), base_checkpoint()
    command = ["export", str(run), "-o", str(model)]
    assert cli.main([*command, "--checkpoint", str(beside)]) == 0
    require_pair(model, beside)
    assert cli.main(command) == 0  # the same again
    require_pair(model, beside)
    assert "mine.ckpt" not in capsys.readouterr().err
    name = next(name for name, value in other["average"].items() if value.is_floating_point())
    other["average"] = {**other["average"], name: other["average"][name] + 1.0}
    write_base(tmp_path / "other", average=other["average"])
    assert cli.main(["export", str(tmp_path / "other"), "-o", str(model)]) == 0
    assert f"{beside} is not the checkpoint of the model {model}" in capsys.readouterr().err
    with pytest.raises(ConfigurationError, match=r"mine\.ckpt has other weights than the model"):
        require_pair(model, beside)
    require_pair("mine", beside)  # the name of a checkpoint, which has no pair
