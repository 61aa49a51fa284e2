# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command ``mtpgo adapt``: from recordings to a model file, and what it refuses."""

import shutil

import pytest
from site_data import site, write_base

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.model_file import load_task
from mtpgo_training import cli
from mtpgo_training.adapt import adapt_report
from mtpgo_training.data.writers.ind_writer import write_ind


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a base model and recordings of a site."""
    folder = tmp_path_factory.mktemp("place")
    write_base(folder / "base")
    for item in site():
        write_ind(item.recording, folder / "site")
    return folder


def arguments(place, out, *more, model="base"):
    given = [place / model, "--data", place / "site", "--layout", "ind", "-o", place / out]
    return ["adapt", *map(str, given), "--no-cache", "--epochs", "2", "--threads", "1", *more]


@pytest.fixture(scope="module")
def adapted(place):
    """A model that was written, and its checkpoint beside it."""
    more = ("--quiet", "--checkpoint", str(place / "mine.ckpt"), "--force")
    assert cli.main(arguments(place, "mine.pt", *more)) == 0
    return place / "mine.pt"


def test_the_model_file_runs_and_says_what_it_was_adapted_from(adapted, capsys):
    task = load_task(adapted)
    assert task.name == "mine"
    assert task.training["adapted_from"]["name"] == "tiny"
    used = {(r["source"], r["split"]) for r in task.training["recordings"]}
    assert used == {("home", "train"), ("site", "train"), ("site", "validation")}
    assert all(len(r["sha256"]) >= 2 for r in task.training["recordings"])
    ModelRunner.load(adapted)
    assert cli.main(["info", str(adapted)]) == 0
    assert "adapted    from tiny, sha256 " in capsys.readouterr().out


def test_one_can_adapt_again_by_the_name_of_the_model_file(adapted, place, capsys):
    assert cli.main(arguments(place, "twice.pt", "--force", model="mine.pt")) == 0
    said, errors = capsys.readouterr()
    assert errors == ""
    lines = said.splitlines()
    heads = [line.split()[0] for line in lines]
    assert heads == ["the", "begins", "ADE", "in", "trained", "written"]
    assert lines[0] == "the model was already trained on site/05, site/06"
    assert load_task(place / "twice.pt").training["adapted_from"]["name"] == "mine"


def test_a_model_that_became_worse_is_not_written(place, capsys, monkeypatch):
    real = adapt_report.require_better

    def worse(adaptation):
        object.__setattr__(adaptation.after, "ade_m", 99.0)
        real(adaptation)

    monkeypatch.setattr(adapt_report, "require_better", worse)
    assert cli.main(arguments(place, "worse.pt", "--quiet")) == 2
    errors = capsys.readouterr().err
    assert "worse than the one it began with on the validation part (ADE of moving" in errors
    assert errors.count("\n") == 1
    assert not (place / "worse.pt").exists()


@pytest.mark.parametrize(
    ("more", "model", "sentence"),
    [
        ([], "no_such/run", "the checkpoint {place}/no_such/run does not exist"),
        ([], "alone.pt", "alone.pt has no checkpoint alone.ckpt beside it"),
        (["--layout", "highd"], "base", "--layout is given 2 times for 1 times --data"),
        (["--minutes", "0"], "base", "adapt.minutes is 0"),
        (["--epochs", "0"], "base", "adapt.epochs is 0, expected more than 0"),
        (["--recordings", "01"], "base", "is left for data.validation out of 1 recordings"),
        (["--checkpoint", "{place}/site"], "base", "site is a directory, expected a file"),
    ],
)
def test_bad_input_is_one_sentence(place, adapted, capsys, more, model, sentence):
    shutil.copy(adapted, place / "alone.pt")
    words = [word.format(place=place) for word in more]
    assert cli.main(arguments(place, "new.pt", *words, model=model)) == 2
    errors = capsys.readouterr().err
    assert sentence.format(place=place) in errors
    assert errors.count("\n") == 1
    assert not (place / "new.pt").exists()


def test_an_unknown_name_is_answered_with_the_checkpoints_there_are(place, capsys):
    command = arguments(place, "new.pt")
    command[1] = "no_such_model"
    assert cli.main(command) == 2
    assert "'no_such_model' is neither a file nor a shipped checkpoint" in capsys.readouterr().err
