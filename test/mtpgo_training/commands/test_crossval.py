# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command ``mtpgo crossval``, interrupted, continued and scored again; what it refuses."""

import json
import os
import signal
import threading

import pytest
import yaml
from crossval_results import content, group
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_training import cli
from mtpgo_training.calibration.calibration_samples import SAMPLES_FILE, CalibrationSamples
from mtpgo_training.commands.crossval import _print_results
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.training.run_folder import load_checkpoint

CONFIG = {
    "name": "tiny",
    "data": {"validation": ["east/02", "west/02"], "restart_probability": 0.0},
    "crossval": {"sites": {"coast": ["north"]}, "folds": {"both": ["east", "coast"]}},
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
    """A folder with a configuration and recordings of three sites."""
    folder = tmp_path_factory.mktemp("place")
    for seed, (site, name) in enumerate(
        [("east", "01"), ("east", "02"), ("west", "01"), ("west", "02"), ("north", "01")]
    ):
        write_ind(braking_cars(name, seed=seed, tracks=4, seconds=5.0), folder / site)
    (folder / "c.yaml").write_text(yaml.safe_dump(CONFIG), encoding="utf-8")
    return folder


def arguments(place, out, *more):
    given = [place / "c.yaml"]
    for site in ("east", "west", "north"):
        given += ["--data", place / site, "--layout", "ind"]
    given += ["--out", place / out, "--cache", place / "cache"]
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


def test_two_folds_interrupted_continued_and_scored_again(place, capsys, in_this_process):
    """An interrupt ends the training after a step; the same command continues it."""
    both = place / "out" / "folds" / "both"
    assert cli.main(arguments(place, "out", "--folds", "coast")) == 130
    in_this_process.undo()
    said_first, errors = capsys.readouterr()
    assert errors == ""
    assert "interrupted; to continue: mtpgo crossval " in said_first
    stopped = load_checkpoint(both / "run" / "last.pt")["step"]
    assert 0 < stopped < STEPS
    assert not (both / "training.json").exists()

    assert cli.main(arguments(place, "out", "--jobs", "2")) == 0
    said, errors = capsys.readouterr()
    assert errors == ""
    for expected in (
        "both: leaves out coast, east (3 recordings)",
        "2 of 2 folds, 0 done before",
        "east: moving",
        "coast: all",
        "west: moving",
        "mean of sites: moving",
    ):
        assert expected in said
    assert load_checkpoint(both / "run" / "last.pt")["step"] > stopped
    plan = next(line for line in said_first.splitlines() if line.startswith("plan"))
    assert plan in (both / "fold.log").read_text()
    content = json.loads((place / "out" / "result.json").read_text())
    trained = {fold["fold"]: fold["training"] for fold in content["folds"]}
    assert trained["both"]["train"] == ["west/01"]
    assert trained["west"]["train"] == ["east/01", "north/01"]
    assert trained["west"]["validation"] == ["east/02"]
    by_fold = {fold["fold"]: fold["sites"] for fold in content["folds"]}
    assert {name: site["recordings"] for name, site in by_fold["both"].items()} == {
        "east": ["east/01", "east/02"],
        "coast": ["north/01"],
    }
    for site in by_fold["both"].values():
        assert site["breakdowns"]["recorded"]["by_recording"]["model"]["all"].keys() == set(
            site["recordings"]
        )
    assert set(CalibrationSamples.load(both / SAMPLES_FILE).sites) == {"east", "coast"}

    # A third time nothing is trained, and a comparison with itself finds no change.
    assert cli.main(arguments(place, "out", "--quiet")) == 0
    capsys.readouterr()
    assert cli.main(["crossval", "--compare", str(place / "out"), str(place / "out")]) == 0
    lines = capsys.readouterr().out.splitlines()
    unchanged = next(line for line in lines if line.startswith("mean of sites, recorded: all"))
    assert " 1.00 " in unchanged

    # Without its scores a trained fold is scored again, with the same result.
    (both / "scores.json").unlink()
    in_this_process.setattr("mtpgo_training.crossval.planned_training.train", pytest.fail)
    in_this_process.setattr(
        "mtpgo_training.crossval.fold_processes.run_folds",
        lambda jobs, *_, **__: [job.run() for job in jobs],
    )
    assert cli.main(arguments(place, "out", "--quiet")) == 0
    again = json.loads((place / "out" / "result.json").read_text())
    assert list(again["folds"][0]["sites"]) == ["coast", "east"]
    before, after = (r["mean_of_sites"]["simulated"]["moving"] for r in (content, again))
    assert (after["n"], after["ade"]) == (before["n"], pytest.approx(before["ade"]))

    # A second stage begins with the weights of the same fold.
    begun = {}

    def begin(config, recordings, folder, *, init_from, **_):
        begun[config.name] = init_from
        raise ConfigurationError("that is enough")

    in_this_process.setattr("mtpgo_training.crossval.planned_training.train", begin)
    init = ("--folds", "coast", "--init-from", str(place / "out"))
    assert cli.main(arguments(place, "second", *init)) == 2
    assert "that is enough" in capsys.readouterr().err
    assert begun == {"tiny-without-both": both / "run"}


def test_strides_that_are_no_whole_number_of_frames_are_told(place, capsys, monkeypatch):
    monkeypatch.setattr("mtpgo_training.crossval.fold_processes.run_folds", lambda *_, **__: None)
    told = "which is no whole number of frames:"
    given = ["--stride", "0.35", "--set", "data.validation_stride_s=0.45", "--quiet"]
    assert cli.main(arguments(place, "rounded", "--folds", "west", *given)) == 0
    assert capsys.readouterr().err.splitlines() == [
        f"mtpgo: warning: --stride is 0.35 s, {told} "
        "instants are scored every 0.4 s (west/01 and 1 more)",
        f"mtpgo: warning: data.validation_stride_s is 0.45 s, {told} "
        "windows can be cut every 0.4 s (east/01 and 4 more)",
    ]
    # Values of the configuration file and whole numbers of frames are not told.
    config = {**CONFIG, "data": {**CONFIG["data"], "stride_s": 0.25, "validation_stride_s": 0.25}}
    (place / "odd.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    words = arguments(place, "whole", "--set", "data.stride_s=0.3", "--quiet")
    words[1] = str(place / "odd.yaml")
    assert cli.main(words) == 0
    assert capsys.readouterr().err == ""


def test_a_site_that_could_not_be_scored_is_told(capsys):
    results = content({"a": {"all": group(1.0)}, "b": {}}) | {"mean_of_sites": {"recorded": {}}}
    _print_results(results, manoeuvres=False, since_start=False)
    errors = capsys.readouterr().err
    assert errors.startswith("mtpgo: warning: no road user of the site b could be scored")
    assert errors.count("\n") == 1


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (
            ["--folds", "north"],
            "--folds names 'north', expected a fold or a site in it, of 'coast'",
        ),
        (
            ["--set", "crossval.folds={all: [coast, east, west]}"],
            "one fold leaves out all sites (",
        ),
        (["--set", "crossval.sites.a=east"], "crossval.sites.a is 'east', expected a list"),
        (["--set", "crossval.folds={1: [east]}"], "a name in crossval.folds is 1, expected text"),
        (["--set", "model.layer=gat3"], "layer is 'gat3', expected one of"),
        (
            ["--set", "optimisation.consistency_weight=1", "--set", "data.stride_s=0.5"],
            "data.stride_s is 0.5 but optimisation.consistency_weight compares",
        ),
        (["--minutes-per-fold", "3"], "--minutes-per-fold and --steps-per-fold are given"),
        (
            ["--init-from", "nowhere"],
            "--init-from is nowhere, which is no folder, expected a cross",
        ),
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


@pytest.mark.parametrize(
    "more",
    [["--folds", "a"], ["--stride", "1"], ["--tracker", "recorded"], ["--set", "seed=2"]],
)
def test_what_a_comparison_does_not_do_is_refused(capsys, more):
    assert cli.main(["crossval", "--compare", "a", "b", *more]) == 2
    sentence = f"{more[0]} is given with --compare, which trains and scores nothing"
    assert sentence in capsys.readouterr().err
