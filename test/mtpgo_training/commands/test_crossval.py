# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command ``mtpgo crossval``, interrupted and continued, and what it refuses."""

import json
import os
import signal
import threading

import pytest
import yaml
from traffic import braking_cars

from mtpgo_training import cli
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.training.run_folder import load_checkpoint

CONFIG = {
    "name": "tiny",
    "data": {"validation": ["east/02", "west/02"], "restart_probability": 0.0},
    "scene": {"max_neighbours": 3},
    "model": {
        "hidden": 8,
        "modes": 2,
        "horizon_steps": 5,
        "layer": "graphconv",
        "integrator": "euler",
        "ode_hidden": 4,
    },
    "optimisation": {"epochs": 16, "batch_scenes": 8},
}

STEPS = 48
"""Of a training; three an epoch."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a configuration and two sites of two recordings each."""
    folder = tmp_path_factory.mktemp("place")
    for seed, (site, name) in enumerate(
        [("east", "01"), ("east", "02"), ("west", "01"), ("west", "02")]
    ):
        write_ind(braking_cars(name, seed=seed, tracks=4, seconds=5.0), folder / site)
    (folder / "c.yaml").write_text(yaml.safe_dump(CONFIG), encoding="utf-8")
    return folder


def arguments(place, out, *more):
    given = [place / "c.yaml", "--data", place / "east", "--data", place / "west"]
    given += ["--layout", "ind", "--out", place / out, "--cache", place / "cache"]
    return ["crossval", *map(str, given), "--steps-per-fold", str(STEPS), "--stride", "0.5", *more]


@pytest.fixture
def in_this_process(monkeypatch):
    """Folds run in this process, and Ctrl-C is pressed as soon as a checkpoint is there."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    over = threading.Event()

    def press(path):
        while not over.wait(0.01):
            if path.exists():
                os.kill(os.getpid(), signal.SIGINT)
                return

    def run_here(jobs, processes, interruption, **_):
        for job in jobs:
            watch = threading.Thread(target=press, args=(job.folder / "run" / "last.pt",))
            watch.start()
            try:
                if not job.run():
                    interruption.received_signal = signal.SIGINT
            finally:
                over.set()
                watch.join()

    with monkeypatch.context() as patch:
        patch.setattr("mtpgo_training.crossval.fold_processes.run_folds", run_here)
        yield patch
    signal.signal(signal.SIGINT, before)


def test_two_sites_interrupted_and_continued(place, capsys, in_this_process):
    """An interrupt ends the training after a step; the same command continues it."""
    east = place / "out" / "folds" / "east"
    assert cli.main(arguments(place, "out", "--folds", "east")) == 130
    in_this_process.undo()
    said_first, errors = capsys.readouterr()
    assert errors == ""
    assert "interrupted; to continue: the same command" in said_first
    stopped = load_checkpoint(east / "run" / "last.pt")["step"]
    assert 0 < stopped < STEPS
    assert not (east / "scores.json").exists()

    assert cli.main(arguments(place, "out", "--jobs", "2")) == 0
    said, errors = capsys.readouterr()
    assert errors == ""
    for expected in ("2 of 2 folds, 0 done before", "west: all", "mean of sites: moving"):
        assert expected in said
    assert load_checkpoint(east / "run" / "last.pt")["step"] > stopped
    plan = next(line for line in said_first.splitlines() if line.startswith("plan"))
    assert plan in (east / "fold.log").read_text()
    content = json.loads((place / "out" / "result.json").read_text())
    for fold, other in zip(content["folds"], ("west", "east"), strict=True):
        assert fold["training"]["train"] == [f"{other}/01"]
        assert fold["training"]["validation"] == [f"{other}/02"]
        name = fold["fold"]
        assert fold["sites"][name]["recordings"] == [f"{name}/01", f"{name}/02"]
        assert (place / "out" / "folds" / name / "model.pt").is_file()

    # A third time nothing is trained, and a comparison with itself finds no change.
    assert cli.main(arguments(place, "out", "--quiet")) == 0
    assert cli.main(["crossval", "--compare", str(place / "out"), str(place / "out")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("mean of sites: all") and " 1.00 " in line for line in lines)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (
            ["--folds", "north"],
            "--folds names 'north', expected a fold or a site in it, of 'east'",
        ),
        (
            ["--set", "crossval.folds.all=[east, west]"],
            "one fold leaves out all sites (east, west",
        ),
        (["--set", "crossval.sites.a=east"], "crossval.sites.a is 'east', expected a list"),
        (["--set", "crossval.folds={1: [east]}"], "a name in crossval.folds is 1, expected text"),
        (["--set", "model.layer=gat3"], "layer is 'gat3', expected one of"),
        (["--minutes-per-fold", "3"], "--minutes-per-fold and --steps-per-fold are given"),
        (["--compare", "a", "b"], "--compare is given with a configuration, --data or --out"),
    ],
)
def test_what_cannot_be_is_one_sentence(place, capsys, more, sentence):
    assert cli.main(arguments(place, "refused", *more)) == 2
    assert sentence in capsys.readouterr().err
    assert not (place / "refused").exists()


def test_what_is_missing_is_named(place, capsys):
    assert cli.main(["crossval", str(place / "c.yaml"), "--out", str(place / "refused")]) == 2
    assert "--data is not given, expected it unless with --compare" in capsys.readouterr().err
