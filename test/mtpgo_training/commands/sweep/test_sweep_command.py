# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo train --sweep``: one table, a failure stays alone, what is done is not done again."""

import json
import pickle
import shlex

import pytest
import yaml
from traffic import braking_cars

from mtpgo_core.errors import MtpgoError
from mtpgo_training import cli
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.sweep import sweep_run
from mtpgo_training.training.run_folder import load_checkpoint

CONFIG = {
    "name": "tiny",
    "num_threads": 1,
    "data": {
        "validation_fraction": 0.4,
        "stride_s": 2.0,
        "validation_stride_s": 2.0,
        "restart_probability": 0.0,
    },
    "scene": {"max_neighbours": 3},
    "model": {
        "hidden": 8,
        "modes": 2,
        "horizon_steps": 5,
        "layer": "graphconv",
        "integrator": "euler",
        "ode_hidden": 4,
    },
    "optimisation": {"epochs": 1, "batch_scenes": 8},
}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder, whose name a shell must quote, with a configuration and three recordings."""
    folder = tmp_path_factory.mktemp("it's a place")
    for seed in (1, 2, 3):
        write_ind(braking_cars(f"{seed:02d}", seed=seed, tracks=4, seconds=4.5), folder / "cars")
    (folder / "c.yaml").write_text(yaml.safe_dump(CONFIG), encoding="utf-8")
    return folder


@pytest.fixture
def inline(monkeypatch):
    """Runs in this process; the list of those that were started."""
    names = []

    def run_here(jobs, processes, interruption, *, started, finished, failed):
        for job in jobs:
            names.append(job.name)
            started(job)
            try:
                done = pickle.loads(pickle.dumps(job)).run()
            except MtpgoError as error:
                failed(job, error)
            else:
                assert done
                finished(job)

    monkeypatch.setattr("mtpgo_training.study.study_progress.run_folds", run_here)
    return names


def command(place, out, *more):
    given = [place / "c.yaml", "--data", place / "cars", "--layout", "ind", "--out", place / out]
    return ["train", *map(str, given), "--no-cache", *more]


def test_a_sweep_from_its_first_run_to_its_table(place, inline, capsys, monkeypatch):
    words = command(place, "a b", "--sweep", "model.hidden=4,8", "seed=1..2")
    real = sweep_run.train

    def failing(config, *args, **options):
        if config.model["hidden"] == 8 and config.seed == 2:
            raise MtpgoError("the loss is odd")
        return real(config, *args, **options)

    monkeypatch.setattr(sweep_run, "train", failing)
    assert cli.main(words) == 2
    said, errors = capsys.readouterr()
    assert "1 of 4 runs failed (model.hidden=8,seed=2)" in errors
    assert "gap: model.hidden=8: seed 2 failed: the loss is odd" in said
    assert "written to" in said

    # The same command trains what is missing only.
    monkeypatch.setattr(sweep_run, "train", real)
    inline.clear()
    assert cli.main(words) == 0
    said, errors = capsys.readouterr()
    assert errors == ""
    assert inline == ["model.hidden=8,seed=2"]
    content = json.loads((place / "a b" / "result.json").read_text(encoding="utf-8"))
    first, second = content["rows"]
    assert (first["settings"], first["seeds"]) == ({"model.hidden": "4"}, [1, 2])
    assert second["gap"] is None
    assert content["comparable"]
    assert content["baselines"]["cv"]["ade"] > 0.0
    ades = [run["values"]["model"]["ade"] for run in content["runs"][:2]]
    assert first["values"]["ade"]["mean"] == pytest.approx(sum(ades) / 2)
    assert first["values"]["ade"]["spread"] == pytest.approx(abs(ades[0] - ades[1]) / 2**0.5)
    # All runs were validated on the same recordings, whatever their seed.
    used = {
        tuple(s["name"] for s in load_checkpoint(path)["splits"] if s["split"] == "validation")
        for path in (place / "a b" / "runs").glob("*/run")
    }
    assert len(used) == 1
    following = next(line for line in said.splitlines() if line.startswith("next: "))
    words = shlex.split(following.removeprefix("next: "))
    assert words[:2] == ["mtpgo", "export"]
    assert (place / "a b" / "runs") in (place / words[2]).parents
    markdown = (place / "a b" / "result.md").read_text(encoding="utf-8")
    assert " ± " in markdown
    assert "moving 90% 1s" in markdown  # the horizon of the runs
    assert "in 90%" not in markdown
    lines = (place / "a b" / "result.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 5
    assert lines[0].startswith("model.hidden,seed,ade,")
    assert ",anll,coverage_90_moving_1s,minutes," in lines[0]

    # More seeds may be added, another configuration may not.
    more = command(place, "a b", "--sweep", "model.hidden=4", "seed=1..2")
    inline.clear()
    assert cli.main([*more, "--quiet"]) == 0
    assert not inline
    assert cli.main([*more, "--set", "optimisation.epochs=2"]) == 2
    assert "the configuration differ from those in" in capsys.readouterr().err


def test_swept_strides_that_are_no_whole_number_of_frames_are_told(place, inline, capsys):
    words = ["--sweep", "data.stride_s=2,0.45,0.45001", "--quiet", "--set", "seed=3"]
    assert cli.main(command(place, "strides", *words)) == 0
    assert capsys.readouterr().err.splitlines() == [
        f"mtpgo: warning: data.stride_s is {stride} s, which is no whole number of frames: "
        f"windows can be cut every {taken} s (cars/01 and 2 more)"
        for stride, taken in (("0.45", "0.4"), ("0.45001", "0.5"))
    ]


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["--sweep", "model.hidden=4,0"], "--sweep model.hidden=0 seed=1: "),
        (["--sweep", "model.no=4"], "--sweep model.no=4 seed=1: "),
        (["--sweep", "seed=1..2", "--seed", "1"], "seed is given with --sweep and --seed"),
        (["--sweep", "model.order=1,2", "--set", "model.order=1"], "--sweep and --set"),
        (
            ["--sweep", "data.stride_s=0.4,0.5", "--set", "optimisation.consistency_weight=1"],
            "--sweep data.stride_s=0.5 seed=1: data.stride_s is 0.5 but",
        ),
        (
            ["--find-lr", "--sweep", "optimisation.learning_rate=0.1,0.2"],
            "optimisation.learning_rate is given with --sweep and --find-lr, which finds one",
        ),
        (["--sweep", "trainer.devices=1,2"], "which does not change what is trained"),
        (["--sweep", "name=a,b"], "--sweep names name, which does not change what is trained"),
        (["--sweep", "seed"], "expected KEY=VALUE"),
        (["--jobs", "2"], "--jobs is 2 without --sweep"),
        (["--sweep", "seed=1,2", "--devices", "2"], "--devices is 2 with --sweep, whose runs"),
        (["--sweep", "seed=1,2", "--out", "{cars}"], "holds no sweep, expected a new folder"),
    ],
)
def test_what_cannot_be_swept_is_said_before_anything_is_trained(
    place, inline, capsys, more, sentence
):
    before = sorted(place.rglob("*"))
    words = [word.format(cars=place / "cars") for word in more]
    assert cli.main([*command(place, "new"), *words]) == 2
    errors = capsys.readouterr().err
    assert sentence in errors
    assert errors.count("\n") == 1
    assert not inline
    assert sorted(place.rglob("*")) == before
