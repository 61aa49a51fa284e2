# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Model files that attack who loads them: one sentence each, and nothing of them has happened."""

import re
import threading
import tracemalloc

import hostile_models
import pytest

from mtpgo_core.errors import ModelFileError
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task import model_trial
from mtpgo_core.task.model_file import find_model, is_shipped, read_model

PATIENCE_S = 200.0
"""Longest wait for the end of a process (s); chosen: a busy machine's."""

WITHOUT_TORCH = {
    "writes_a_file": "uses torch.from_file, which no model needs",
    "saves_a_file": "uses torch.save",
    "runs_while_loading": "uses torch.from_file",
    "runs_in_a_default_argument": "uses torch.from_file",
    "bomb": "compressed records that unpack to|unpacks to 300 MB, expected at most 256 MB",
    "bomb_that_lies": "is truncated or no TorchScript file: Bad CRC-32",
    "many_records": "has 100000 records, expected at most 20000",
    "two_of_a_name": "has two records of the same name",
    "a_pickle": "is truncated or no TorchScript file: File is not a zip file",
    "of_another_schema": "has schema version 99, expected 1",
    "of_a_huge_task": "task.horizon_steps is 1000000000, expected 1 to 1000",
    "with_a_forged_hash": "is not what was exported: its content has the SHA-256",
    "nested_json": "has an unusable task.json: the task description is no JSON: maximum recursion",
}
"""What is refused before torch sees the file."""

BY_TRIAL = {
    "prints": "uses the operator prim::Print, which no model needs",
    "loops_for_ever": "has a loop of 9223372036854775807 repetitions",
    "loops_by_its_data": "has a loop that ends by a condition",
    "counts_for_ever": "has a loop of 1000000000000 repetitions, expected at most 1000000",
    "repeats_what_the_data_say": "uses the operator aten::Int",
    "asks_for_memory": "does not run on the input .* can't allocate memory",
    "grows": "does not run on the input .* can't allocate memory",
    "not_a_number": "has weights that are not finite numbers",
    "answers_nan": "gives an output that is not finite for a scene of standing agents",
    "of_another_torch": "of another version than torch .* version 999",
}
"""What the other process refuses."""


@pytest.fixture
def written(tmp_path):
    """Return a function that writes a hostile file; what it would write is never there."""
    trace = tmp_path / "trace"

    def write(name):
        make = getattr(hostile_models, name)
        takes_a_place = make.__code__.co_varnames[:1] == ("place",)
        path = tmp_path / f"{name}.pt"
        path.write_bytes(make(str(trace)) if takes_a_place else make())
        return path

    yield write
    assert not trace.exists()


@pytest.fixture
def little_memory(monkeypatch):
    monkeypatch.setattr(model_trial, "MEMORY_MB", 300)


def refusal(load, path):
    with pytest.raises(ModelFileError) as caught:
        load(path)
    text = str(caught.value)
    assert text.startswith(f"model file {path} ")
    assert "\n" not in text
    return text


@pytest.mark.parametrize("name", WITHOUT_TORCH)
def test_it_is_refused_before_torch_sees_it(written, name, monkeypatch):
    monkeypatch.setattr("torch.jit.load", None)
    monkeypatch.setattr(model_trial, "start_trials", None)
    path = written(name)
    tracemalloc.start()
    text = refusal(ModelRunner.load, path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert re.search(WITHOUT_TORCH[name], text), text
    assert peak < 30 << 20
    assert refusal(read_model, path) == text


@pytest.mark.parametrize("name", BY_TRIAL)
def test_it_is_refused_by_the_other_process(written, name, monkeypatch, little_memory):
    monkeypatch.setattr("torch.jit.load", None)
    with pytest.raises(ModelFileError, match=BY_TRIAL[name]) as caught:
        ModelRunner.load(written(name))
    assert "\n" not in str(caught.value)


def test_a_file_that_passed_is_not_tried_again(model_file, monkeypatch):
    ModelRunner.load(model_file)
    monkeypatch.setattr(model_trial, "start_trials", None)
    assert ModelRunner.load(model_file).sha256 == read_model(model_file).archive.sha256


def test_the_graph_is_checked_here_as_well(written):
    for name in ("prints", "loops_by_its_data", "not_a_number", "answers_nan"):
        with pytest.raises(ModelFileError, match=BY_TRIAL[name]):
            ModelRunner.load(written(name), trusted=True)


def test_a_model_that_computes_too_long_ends_the_other_process(written, monkeypatch):
    monkeypatch.setattr(model_trial, "PROCESSOR_TIME_S", 1)
    path = written("loops_in_loops")
    text = refusal(ModelRunner.load, path)
    assert "computes for more than 1 s of processor time" in text


def test_loading_is_interrupted_by_a_request_to_stop(written, monkeypatch):
    monkeypatch.setattr(model_trial, "PROCESSOR_TIME_S", 10_000)  # the model does not end before
    path = written("loops_in_loops")
    asked = threading.Event()
    threading.Timer(0.3, asked.set).start()
    with pytest.raises(ModelFileError, match="was interrupted"):
        ModelRunner.load(path, stopped=asked.is_set)
    assert model_trial._worker is None


def test_an_interrupt_from_the_keyboard_ends_the_trial(written):
    def stopped():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ModelRunner.load(written("loops_in_loops"), stopped=stopped)
    assert model_trial._worker is None


def test_the_other_process_ends_after_a_while(model_file, monkeypatch):
    monkeypatch.setattr(model_trial, "IDLE_S", 0.05)
    with model_trial._one_at_a_time:  # which its end waits for
        model_trial.start_trials()
        worker = model_trial._worker
    worker.wait(timeout=PATIENCE_S)
    model_trial.end_trials()
    assert model_trial._worker is None


def test_a_pinned_model_must_have_its_hash(model_file):
    right = read_model(model_file).archive.sha256
    assert ModelRunner.load(model_file, sha256=f" {right.upper()}").sha256 == right
    with pytest.raises(ModelFileError, match=f"has the SHA-256 {right}, expected {'0' * 64}"):
        ModelRunner.load(model_file, sha256="0" * 64)


def test_an_own_model_is_loaded_without_a_trial(monkeypatch):
    monkeypatch.setattr(model_trial, "start_trials", None)
    assert is_shipped(find_model("default"))
    ModelRunner.load(find_model("default"))
