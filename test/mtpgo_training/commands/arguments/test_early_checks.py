# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is checked before a command works: nothing is read, made or loaded for it."""

import shutil
import sys
from pathlib import Path

import drone_files
import pytest

from mtpgo_core.errors import ConfigurationError, ModelFileError, RecordingError
from mtpgo_core.task.model_file import find_model
from mtpgo_training import cli
from mtpgo_training.commands.arguments.early_checks import (
    files_of_run,
    require_apart,
    require_bags,
    require_different,
    require_folder,
    require_makeable,
    require_models,
    require_modules,
    require_sources,
)
from mtpgo_training.data.data_sources import DataSource
from mtpgo_training.data.readers.reading_options import ReadingOptions


def test_all_models_are_found_before_one_is_read(tmp_path, monkeypatch):
    from mtpgo_training.commands.arguments import early_checks

    opened = []
    real = early_checks.read_model
    monkeypatch.setattr(
        early_checks, "read_model", lambda path: opened.append(path.name) or real(path)
    )
    with pytest.raises(ModelFileError, match=r"no\.pt does not exist"):
        require_models(["default", str(tmp_path / "no.pt")])
    assert opened == ["no.pt"]
    with pytest.raises(ModelFileError, match="'nowhere' is neither a file nor a shipped model"):
        require_models(["default", "nowhere"])
    (tmp_path / "odd.pt").write_bytes(b"no model")
    with pytest.raises(ModelFileError, match=r"odd\.pt"):
        require_models([str(tmp_path / "odd.pt")])


def test_libraries_are_looked_for_without_loading_them(monkeypatch):
    monkeypatch.delitem(sys.modules, "tensorboard", raising=False)
    require_modules("tensorboard", "google.protobuf")
    assert "tensorboard" not in sys.modules
    for name in ("no_such_module", "no_such.module"):
        with pytest.raises(ModuleNotFoundError) as caught:
            require_modules(name)
        assert caught.value.name == name


@pytest.mark.parametrize("blocked", ["pyarrow"])
def test_the_libraries_of_the_files_are_looked_for(tmp_path, monkeypatch, blocked):
    (tmp_path / "a.parquet").write_bytes(b"")
    (tmp_path / "columns.yaml").write_text(
        "columns: {track: id, time: t, x: x, y: y}", encoding="utf-8"
    )
    source = DataSource(tmp_path, "table", None, ReadingOptions(columns=tmp_path / "columns.yaml"))
    require_sources([source])
    monkeypatch.setitem(sys.modules, blocked, None)
    with pytest.raises(ModuleNotFoundError) as caught:
        require_sources([source])
    assert caught.value.name == blocked


def test_directories_and_descriptions_are_looked_for(tmp_path):
    cars = drone_files.write_highd(tmp_path / "highd")
    assert len(require_sources([DataSource(cars, "highd")])) == 1
    with pytest.raises(RecordingError, match="does not exist"):
        require_sources([DataSource(cars, "highd"), DataSource(tmp_path / "no", "highd")])
    with pytest.raises(RecordingError, match="has no recording '7'"):
        require_sources([DataSource(cars, "highd", ("7",))])
    options = ReadingOptions(columns=tmp_path / "no.yaml")
    with pytest.raises(ConfigurationError, match=r"--columns is .*no\.yaml, which is no file"):
        require_sources([DataSource(cars, "table", None, options)])
    with pytest.raises(RecordingError, match="second does not exist, expected a bag"):
        require_bags([cars, tmp_path / "second"])


def test_outputs_are_checked_without_making_them(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    require_makeable(tmp_path / "a" / "b" / "c.mcap")
    require_folder(tmp_path / "a" / "b")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    with pytest.raises(ConfigurationError, match=r"cannot be written: .*file is no directory"):
        require_makeable(tmp_path / "file" / "b")
    with pytest.raises(ConfigurationError, match="is a file, expected a folder"):
        require_folder(tmp_path / "file")
    with pytest.raises(ConfigurationError, match="-o and --checkpoint are both"):
        require_different([("-o", Path("x")), ("--json", None), ("--checkpoint", Path("./x"))])


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("evaluate --model default {d}/no.pt --data {d}/cars --layout highd", "no.pt does not"),
        ("evaluate --model default --data {d}/no --layout highd", "no does not exist"),
        ("evaluate --model default --predictions {d}/no", "no does not exist, expected a bag"),
        ("evaluate --model default --data {d}/cars --layout highd --report {d}/f", "is a file"),
        ("train default --data {d}/cars {d} --out {d}/r", "unrecognized arguments"),
        ("train default --data {d}/no --layout highd --out {d}/r", "no does not exist"),
        ("train default --data {d}/cars --layout highd --out {d}/f", "is a file, expected a fol"),
        ("train default --data {d}/cars --layout highd --out {d}/r --init-from {d}/no.ckpt", "no"),
        ("crossval default --data {d}/no --layout highd --out {d}/r", "no does not exist"),
        ("crossval default --data {d}/cars --layout highd --out {d}/cars", "holds no cross-valid"),
        ("study layers --data {d}/no --layout highd --out {d}/r", "no does not exist"),
        ("study layers --data {d}/cars --layout highd --out {d}/cars", "holds no study"),
        ("adapt default --data {d}/no --layout highd -o {d}/m.pt", "no does not exist"),
        ("adapt {d}/no.ckpt --data {d}/cars --layout highd -o {d}/m.pt", "no.ckpt does not exist"),
        ("adapt default --data {d}/cars --layout highd -o {d}/m --checkpoint {d}/m", "are both"),
        ("export {d}/no -o {d}/m.pt", "no does not exist"),
        ("export {d}/cars -o {d}/m.onnx", "m.onnx, expected a file that ends in .pt"),
        ("export {d}/cars -o {d}/m.pt --calibration {d}/no", "no does not exist"),
        ("curve {d}/no -o {d}/c.png", "no is no folder"),
        ("convert highd {d}/cars -o {d}/f/x", "cannot be written: "),
        ("demo {d}/cars --layout highd -o {d}/f", "is a file, expected a folder"),
        ("demo {d}/cars --layout highd -o {d}/r -p rate=5", "expected NAME:=VALUE"),
        ("demo --layout ind -o {d}/r", "--layout ind is given without a directory of recordings"),
        ("view {d}/cars --layout highd --gif {d}/x.png", "x.png, expected a file that ends in .g"),
        ("simulate highway -o {d}/f", "is a file, expected a folder"),
        ("benchmark conversion --data {d}/no --layout highd", "no does not exist"),
    ],
)
def test_every_command_checks_its_paths_first(tmp_path, capsys, monkeypatch, words, sentence):
    """Whatever reads a recording, loads a model or trains fails at once here."""
    from mtpgo_core.prediction.model_runner import ModelRunner
    from mtpgo_training.data.readers import reading_job

    def work(*_, **__):
        raise AssertionError("the work began")

    monkeypatch.setattr(reading_job, "_read_unit", work)
    monkeypatch.setattr(ModelRunner, "load", work)
    drone_files.write_highd(tmp_path / "cars")
    (tmp_path / "f").write_text("", encoding="utf-8")
    before = sorted(tmp_path.rglob("*"))
    try:
        status = cli.main([*words.format(d=tmp_path).split()])
    except SystemExit as ended:
        status = ended.code
    said = capsys.readouterr()
    assert status == 2
    assert sentence in said.err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    "words",
    [
        "evaluate --model {d}/m.pt --data {d}/cars --layout highd --json {d}/m.pt",
        "evaluate --model {d}/m.pt --data {d}/cars --layout highd --json {d}/cars/01_tracks.csv",
        "evaluate --predictions {d}/bag --json {d}/bag/bag.mcap",
        "data {d}/cars --layout highd --json {d}/cars/01_tracks.csv",
        "data {d}/cars --layout highd --picture {d}/link.csv",
        "view {d}/cars --layout highd --html {d}/cars/01_tracksMeta.csv",
        "view {d}/cars --layout highd --model {d}/m.pt --gif {d}/m.pt",
        "adapt {d}/run --data {d}/cars --layout highd -o {d}/run/best.pt",
        "adapt {d}/run --data {d}/cars --layout highd -o {d}/n.pt --checkpoint {d}/run/log.csv",
        "adapt {d}/m.pt --data {d}/cars --layout highd -o {d}/m.pt",
        "adapt {d}/m.ckpt --data {d}/cars --layout highd -o {d}/n.pt --checkpoint {d}/m.ckpt",
        "export {d}/run -o {d}/run/last.pt",
        "export {d}/run/best.pt -o {d}/n.pt --checkpoint {d}/run/run.json",
        "curve {d}/run -o {d}/run/log.csv",
    ],
)
def test_no_command_writes_over_what_it_reads(tmp_path, capsys, words):
    drone_files.write_highd(tmp_path / "cars")
    (tmp_path / "link.csv").symlink_to(tmp_path / "cars" / "01_tracks.csv")
    shutil.copy(find_model("default"), tmp_path / "m.pt")
    for name in ("m.ckpt", "run/run.json", "run/best.pt", "run/last.pt", "run/log.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("precious", encoding="utf-8")
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag.mcap").write_text("precious", encoding="utf-8")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert cli.main([*words.format(d=tmp_path).split()]) == 2
    assert "which is read and would be lost, expected another file\n" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_a_run_folder_may_hold_further_outputs(tmp_path):
    """A model may be exported into the folder of its run, again and again."""
    for name in ("run.json", "model.pt"):
        (tmp_path / name).write_text("", encoding="utf-8")
    require_apart([("-o", tmp_path / "model.pt"), ("--json", None)], files_of_run(tmp_path))
    require_apart([("-o", tmp_path / "new.pt")], [tmp_path / "new.pt"])
