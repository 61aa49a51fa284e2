# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Model files that are none: one sentence each, naming the file."""

import json
import os
import subprocess
import sys
import zipfile

import pytest
import torch
from core_helpers import write_model

from mtpgo_core.errors import ModelFileError
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.model_file import (
    find_checkpoint,
    find_model,
    load_task,
    model_card,
    read_model,
    shipped_models,
)
from mtpgo_core.task.task_description import TASK_FILE, HistoryConfig, TaskDescription


def missing(path, good):
    return "does not exist"


def directory(path, good):
    path.mkdir()
    return "is a directory, expected a TorchScript file"


def empty(path, good):
    path.write_bytes(b"")
    return "is truncated or no TorchScript file"


def text(path, good):
    path.write_text("weights\n")
    return "is truncated or no TorchScript file"


def truncated(path, good):
    path.write_bytes(good.read_bytes()[:-1000])
    return "is truncated or no TorchScript file"


def half(path, good):
    data = good.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    return "is truncated or no TorchScript file"


def state_dict(path, good):
    torch.save({"weight": torch.zeros(3)}, path)
    return "is a zip archive without code, expected TorchScript"


def without_task(path, good):
    rewrite(good, path, None)
    return f"is TorchScript without {TASK_FILE}"


def not_json(path, good):
    rewrite(good, path, "{")
    return f"has an unusable {TASK_FILE}: the task description is no JSON"


def newer_schema(path, good):
    task = json.loads(TaskDescription().to_json()) | {"schema_version": 99}
    rewrite(good, path, json.dumps(task))
    return "has schema version 99, expected 1"


def unknown_field(path, good):
    task = json.loads(TaskDescription().to_json()) | {"colour": "red"}
    rewrite(good, path, json.dumps(task))
    return "has the unknown field 'colour'"


def ill_typed(path, good):
    task = json.loads(TaskDescription().to_json()) | {"modes": "eight"}
    rewrite(good, path, json.dumps(task))
    return "task.modes is 'eight', expected int"


def rewrite(source, target, task_text):
    """A copy of a model file with another task description."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for info in old.infolist():
            if not info.filename.endswith(f"extra/{TASK_FILE}"):
                new.writestr(info, old.read(info))
            elif task_text is not None:
                new.writestr(info, task_text)


DEFECTS = [
    missing,
    directory,
    empty,
    text,
    truncated,
    half,
    state_dict,
    without_task,
    not_json,
    newer_schema,
    unknown_field,
    ill_typed,
]


@pytest.mark.parametrize("load", [load_task, ModelRunner.load], ids=["task", "model"])
@pytest.mark.parametrize("defect", DEFECTS, ids=lambda d: d.__name__)
def test_a_defective_file_is_one_sentence(defect, load, tmp_path, model_file):
    path = tmp_path / "bad.pt"
    expected = defect(path, model_file)
    with pytest.raises(ModelFileError) as caught:
        load(path)
    message = str(caught.value)
    assert str(path) in message
    assert expected in message
    assert "\n" not in message


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_an_unreadable_file_says_so(tmp_path, model_file):
    path = tmp_path / "locked.pt"
    path.write_bytes(model_file.read_bytes())
    path.chmod(0)
    with pytest.raises(ModelFileError, match="cannot be read"):
        load_task(path)


def test_a_damaged_middle_is_no_traceback(tmp_path, model_file):
    data = bytearray(model_file.read_bytes())
    with zipfile.ZipFile(model_file) as archive:
        code = next(i for i in archive.infolist() if i.filename.endswith(".py"))
    start = code.header_offset + 200
    data[start : start + 400] = bytes(400)
    path = tmp_path / "damaged.pt"
    path.write_bytes(data)
    with pytest.raises(ModelFileError, match=r"damaged\.pt"):
        ModelRunner.load(path)


def test_the_task_comes_back_as_it_was_written(tmp_path):
    task = write_model(
        tmp_path / "m.pt",
        order=1,
        history=HistoryConfig(steps=11, max_gap_s=0.7),
        training={"recordings": [{"name": "01", "sha256": "ab"}]},
        metrics={"highway": {"ade_m": 0.5}},
    )
    assert load_task(tmp_path / "m.pt") == task


def test_reading_the_task_does_not_import_torch(model_file):
    code = (
        "import sys; from mtpgo_core.task.model_file import load_task; "
        f"load_task({str(model_file)!r}); assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_paths_stay_paths_and_names_are_looked_up(tmp_path, monkeypatch):
    assert str(find_model("some/where")) == "some/where"
    assert str(find_model("model.pt")) == "model.pt"
    weights = tmp_path / "share" / "mtpgo_ros" / "weights"
    weights.mkdir(parents=True)
    (weights / "junction.pt").write_bytes(b"")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    assert find_model("junction") == weights / "junction.pt"
    with pytest.raises(ModelFileError, match="'no_such' is neither a file nor a shipped model"):
        find_model("no_such")
    with pytest.raises(ModelFileError, match="is neither a file nor a shipped model"):
        find_model("y" * 5000)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("~nobody_of_that_name/model.pt", "does not exist"),
        ("y" * 5000 + ".pt", "cannot be read: File name too long"),
    ],
)
def test_a_name_that_no_file_can_have_is_one_sentence(name, sentence):
    with pytest.raises(ModelFileError, match=sentence):
        read_model(find_model(name))


def test_a_name_finds_the_shipped_checkpoint(tmp_path, monkeypatch):
    weights = tmp_path / "share" / "mtpgo_ros" / "weights"
    weights.mkdir(parents=True)
    (weights / "junction.ckpt").write_bytes(b"")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    assert find_checkpoint("junction") == weights / "junction.ckpt"
    with pytest.raises(ModelFileError, match="'no_such' is neither a file nor a shipped checkp"):
        find_checkpoint("no_such")


def test_a_run_folder_or_a_checkpoint_stays_a_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    assert str(find_checkpoint("run")) == "run"
    assert str(find_checkpoint("no/where")) == "no/where"
    torch.save({"weight": torch.zeros(3)}, tmp_path / "best.pt")
    assert str(find_checkpoint("best.pt")) == "best.pt"


def test_a_model_file_stands_for_the_checkpoint_beside_it(model_file, tmp_path):
    file = tmp_path / "mine.pt"
    file.write_bytes(model_file.read_bytes())
    with pytest.raises(ModelFileError, match=r"mine\.pt has no checkpoint mine\.ckpt beside it"):
        find_checkpoint(file)
    (tmp_path / "mine.ckpt").write_bytes(b"")
    assert find_checkpoint(file) == tmp_path / "mine.ckpt"


def test_every_shipped_model_is_found_by_name_and_has_a_card():
    names = shipped_models()
    assert "default" in names
    for name in names:
        path = find_model(name)
        assert load_task(path).name == name
        assert model_card(path).startswith("# Model card: ")


def test_an_unknown_name_is_answered_with_the_names_there_are():
    with pytest.raises(ModelFileError, match=r"'unknown_name' is neither .* one of .*default"):
        find_model("unknown_name")


def test_a_file_without_a_card_has_none(tmp_path):
    assert model_card(tmp_path / "mine.pt") is None
    (tmp_path / "mine.md").write_bytes(b"\xff\xfe\x00")
    assert model_card(tmp_path / "mine.pt") is None
