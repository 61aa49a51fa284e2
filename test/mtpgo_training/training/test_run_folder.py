# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The files of a run: what is written, what is read back, and what is refused."""

import csv
import dataclasses
import json
import zipfile

import pytest
import torch
from tiny_run import CONFIG, with_options

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.run_folder import RunFolder, load_checkpoint, versions
from mtpgo_training.training.training_config import load_config

SPLITS = [{"name": "01", "source": "cars", "sha256": "ab", "split": "train"}]


def content(epoch):
    """What every checkpoint has."""
    weights = {"w": epoch * torch.arange(3.0)}
    empty = {"config": {}, "model_config": {}, "metrics": {}, "splits": SPLITS}
    return {"average": weights, "epoch": epoch, "step": 7, **empty}


@pytest.fixture
def folder(tmp_path):
    folder = RunFolder(tmp_path / "run")
    folder.start(CONFIG, SPLITS)
    return folder


def test_the_start_writes_the_configuration_and_the_origin(folder):
    assert load_config(folder.path / "config.yaml") == CONFIG
    facts = json.loads((folder.path / "run.json").read_text())
    assert facts == {
        "network": "mtp-go",
        "splits": SPLITS,
        "seed": CONFIG.seed,
        "initial_weights_sha256": None,
        "versions": versions(),
    }
    assert versions()["torch"] == torch.__version__


def test_only_a_new_or_empty_folder_is_used(tmp_path):
    (tmp_path / "empty").mkdir()
    RunFolder(tmp_path / "empty").require_new()
    (tmp_path / "file").write_text("")
    (tmp_path / "empty" / "x").write_text("")
    for name in ("file", "empty"):
        with pytest.raises(ConfigurationError, match=f"{name} exists already, expected a new one"):
            RunFolder(tmp_path / name).start(CONFIG, SPLITS)
    assert [path.name for path in (tmp_path / "empty").iterdir()] == ["x"]


def test_a_run_is_resumed_with_the_same_configuration_and_data_only(folder):
    folder.check_same(CONFIG, SPLITS)
    folder.check_same(with_options(trainer={"devices": 3}), SPLITS)
    folder.check_same(dataclasses.replace(CONFIG, num_threads=7), SPLITS)
    for config, difference in (
        (with_options(epochs=9), r"optimisation\.epochs \(8 there, 9 here\), expected the same"),
        (dataclasses.replace(CONFIG, seed=2), r"config\.yaml in seed \(1 there, 2 here\)"),
        (
            dataclasses.replace(CONFIG, model={**CONFIG.model, "order": 1}),
            r"model\.order \(None there, 1 here\)",
        ),
        (dataclasses.replace(CONFIG, model={}), r"model\.hidden \(8 there, None here\)"),
    ):
        with pytest.raises(ConfigurationError, match=difference):
            folder.check_same(config, SPLITS)
    with pytest.raises(ConfigurationError, match=r"recordings differ from those in .*run\.json"):
        folder.check_same(CONFIG, [{**SPLITS[0], "sha256": "cd"}])


@pytest.mark.parametrize("text", ["null", "[1]", "", "{"])
def test_a_damaged_origin_is_one_sentence(folder, text):
    (folder.path / "run.json").write_text(text)
    with pytest.raises(ConfigurationError, match=r"holds no run to resume .*run\.json is damaged"):
        folder.check_same(CONFIG, SPLITS)


def test_a_run_from_other_weights_is_not_resumed_without_a_checkpoint(tmp_path):
    folder = RunFolder(tmp_path / "run")
    folder.start(CONFIG, SPLITS, "ab" * 32)
    with pytest.raises(ConfigurationError, match="ended before its first checkpoint"):
        folder.check_same(CONFIG, SPLITS)
    folder.save(content(1), best=False)
    folder.check_same(CONFIG, SPLITS)


def test_only_the_last_checkpoint_has_what_resuming_needs(folder):
    folder.save(content(1), {"optimiser": {"lr": 0.1}}, best=True)
    folder.save(content(2), {"optimiser": {"lr": 0.2}}, best=False)
    best, last = load_checkpoint(folder.path), load_checkpoint(folder.last)
    assert (best["epoch"], last["epoch"]) == (1, 2)
    torch.testing.assert_close(best["average"]["w"], torch.arange(3.0))
    assert last["optimiser"] == {"lr": 0.2}
    assert "optimiser" not in best


def test_the_log_has_a_column_for_each_value_of_any_epoch(folder):
    folder.write_log([{"epoch": 1, "loss": 0.5}, {"epoch": 2, "loss": 0.25, "all_ade": 1.5}])
    with (folder.path / "log.csv").open(encoding="utf-8", newline="") as file:
        assert list(csv.reader(file)) == [
            ["epoch", "loss", "all_ade"],
            ["1", "0.5", ""],
            ["2", "0.25", "1.5"],
        ]


@pytest.mark.parametrize("content", [b"", b"no checkpoint", b"PK\x03\x04truncated"])
def test_an_unreadable_checkpoint_is_one_sentence(tmp_path, content):
    path = tmp_path / "last.pt"
    path.write_bytes(content)
    with pytest.raises(ConfigurationError, match=r"last.pt is no readable checkpoint") as caught:
        load_checkpoint(path)
    assert "\n" not in str(caught.value)


def test_a_missing_checkpoint_and_one_of_another_format_are_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r"the checkpoint .*best\.pt does not exist"):
        load_checkpoint(tmp_path)
    for content in ({"format": 99}, [1, 2]):
        torch.save(content, tmp_path / "best.pt")
        with pytest.raises(ConfigurationError, match=r"best\.pt is no checkpoint of .*format 1"):
            load_checkpoint(tmp_path)


class Large:
    """Becomes a hundred gigabytes when it is unpickled."""

    def __reduce__(self):
        return (bytearray, (10**11,))


def test_a_checkpoint_contains_tensors_and_plain_data_only(tmp_path):
    path = tmp_path / "last.pt"
    torch.save({"format": 1, "average": Large()}, path)
    with pytest.raises(
        ConfigurationError, match=r"last.pt is no readable checkpoint: it contains \S+bytearray"
    ):
        load_checkpoint(path)


def test_a_checkpoint_that_unpacks_to_too_much_is_not_read(tmp_path):
    torch.save({"format": 1}, tmp_path / "small.pt")
    with (
        zipfile.ZipFile(tmp_path / "small.pt") as small,
        zipfile.ZipFile(tmp_path / "last.pt", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as bomb,
    ):
        for name in small.namelist():
            bomb.writestr(name, small.read(name))
        with bomb.open(f"{small.namelist()[0].partition('/')[0]}/data/0", "w") as record:
            for _ in range(80):
                record.write(bytes(1 << 20))
    with pytest.raises(ConfigurationError, match="it has compressed records that unpack to 80 MB"):
        load_checkpoint(tmp_path / "last.pt")
