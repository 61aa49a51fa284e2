# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command ``mtpgo train``: what it says, what it refuses, and two processes that are one."""

import dataclasses
import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import torch
import yaml
from traffic import braking_cars

from mtpgo_training import cli
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.export.exporter import load_model
from mtpgo_training.training.networks import weights_hash
from mtpgo_training.training.run_folder import load_checkpoint
from mtpgo_training.training.training_config import load_config

ROOT = Path(__file__).parents[3]

THREADS = int(os.environ["OMP_NUM_THREADS"])

CONFIG = {
    "name": "tiny",
    "num_threads": THREADS,
    "data": {"validation": ["03"], "stride_s": 0.4, "restart_probability": 0.0},
    "scene": {"max_neighbours": 3, "sizes": True, "trails": True},
    "model": {
        "hidden": 8,
        "modes": 2,
        "horizon_steps": 5,
        "layer": "graphconv",
        "integrator": "euler",
        "ode_hidden": 4,
        "static_features": True,
        "static_inputs": "all",
        "hold_standing": True,
    },
    "optimisation": {
        "epochs": 3,
        "batch_scenes": 8,
        "average_decay": 0.9,
        "likelihood": "trajectory",
    },
}
"""With the options that the paper does not have, so that two processes are compared on them."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a configuration and three recordings."""
    folder = tmp_path_factory.mktemp("place")
    for seed in (1, 2, 3):
        cars = braking_cars(f"{seed:02d}", seed=seed, tracks=6, seconds=4.5)
        write_ind(cars, folder / "cars")
    (folder / "c.yaml").write_text(yaml.safe_dump(CONFIG), encoding="utf-8")
    return folder


def arguments(place, out, *more):
    given = [place / "c.yaml", "--data", place / "cars", "--layout", "ind", "--out", place / out]
    return ["train", *map(str, given), "--no-cache", *more]


@pytest.fixture(scope="module")
def whole(place):
    assert cli.main(arguments(place, "whole", "--quiet")) == 0
    return place / "whole"


def test_a_run_says_what_it_does_and_what_comes_next(place, capsys):
    status = cli.main(arguments(place, "told", "--epochs", "2", "--name", "other"))
    said, errors = capsys.readouterr()
    assert (status, errors) == (0, "")
    for expected in (
        "prepare    3 recordings for training and validation\n",
        "train      2 of cars: ",
        "validate   1 of cars: ",
        "network    mtp-go, ",
        f"device     cpu, {THREADS} thread(s), precision 32-true",
        "seed 1, epochs 1 to 2",
        "best epoch ",
        f"next: mtpgo export {place / 'told'} -o other.pt",
    ):
        assert expected in said
    lines = [line.split() for line in said.splitlines()]
    assert [line[:2] for line in lines if len(line) == 9] == [["1", "EWTA(2)"], ["2", "NLL"]]
    assert load_config(place / "told" / "config.yaml").optimisation.epochs == 2


def test_a_run_in_a_given_time_is_planned_validated_and_exportable(place, capsys):
    assert cli.main(arguments(place, "timed", "--minutes", "0.02")) == 0
    said = capsys.readouterr().out
    assert "\nplan       " in said
    assert said.index("\nmeasure    ") < said.index("\ntrain      ")
    assert " for 0.02 min in all\n" in said
    assert "next: mtpgo export" in said
    assert (place / "timed" / "plan.json").is_file()
    assert load_checkpoint(place / "timed")["metrics"]["model"]["all"]["ade"] > 0.0


def test_the_command_that_continues_can_be_pasted(place, whole, capsys):
    given = arguments(place, "it's a run", "--epochs", "1", "--max-minutes", "1e-9")
    assert cli.main([*given, "--init-from", str(whole)]) == 0
    said = capsys.readouterr().out
    told = ("to continue: ", "next: ")
    lines = dict(line.split(": ", 1) for line in said.splitlines() if line.startswith(told))
    words = shlex.split(lines["to continue"])
    assert words == ["mtpgo", *given, "--resume"]
    assert shlex.split(lines["next"])[2] == str(place / "it's a run")
    words.remove("--max-minutes")
    words.remove("1e-9")
    assert cli.main(words[1:]) == 0
    assert "1 of 1 epochs done" in capsys.readouterr().out


def test_a_quiet_run_says_nothing(place, capsys):
    assert cli.main(arguments(place, "quiet", "--quiet", "--epochs", "1")) == 0
    assert capsys.readouterr() == ("", "")


def test_a_given_stride_that_is_no_whole_number_of_frames_is_told(place, capsys):
    given = ("--quiet", "--epochs", "1", "--set", "data.stride_s=0.45")
    assert cli.main(arguments(place, "rounded", *given)) == 0
    assert capsys.readouterr().err == (
        "mtpgo: warning: data.stride_s is 0.45 s, which is no whole number of frames: windows can "
        "be cut every 0.4 s (cars/01 and 2 more)\n"
    )


def test_a_run_starts_from_a_shipped_model_by_its_name(place, whole, tmp_path, monkeypatch):
    weights = tmp_path / "share" / "mtpgo_ros" / "weights"
    weights.mkdir(parents=True)
    shutil.copy(whole / "best.pt", weights / "junction.ckpt")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    given = ("--quiet", "--epochs", "1", "--init-from", "junction")
    assert cli.main(arguments(place, "from_name", *given)) == 0
    facts = json.loads((place / "from_name" / "run.json").read_text(encoding="utf-8"))
    best = load_checkpoint(whole)
    assert facts["initial_weights_sha256"] == weights_hash(load_model(best, calibrated=False))


def test_two_processes_are_one(place, whole):
    """Each takes its half of every batch, and both score half of the validation."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "CUDA_VISIBLE_DEVICES": ""}
    done = subprocess.run(
        [sys.executable, "-m", "mtpgo_training.cli", *arguments(place, "two", "--devices", "2")],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "find_unused" not in done.stderr
    assert "device     cpu, 2 processes of 1 thread(s)" in done.stdout
    assert done.stdout.count("next: mtpgo export") == 1
    one, two = load_checkpoint(whole / "last.pt"), load_checkpoint(place / "two" / "last.pt")
    assert two["step"] == one["step"] > 6
    for name, value in one["model"].items():
        torch.testing.assert_close(two["model"][name], value, rtol=1e-4, atol=1e-5)
    for row, expected in zip(two["state"]["rows"], one["state"]["rows"], strict=True):
        assert row["agents"] == expected["agents"]
        for key in ("loss", "all_ade", "all_coverage_90", "all_coverage_90_moving_1s"):
            assert row[key] == pytest.approx(expected[key], rel=1e-3, abs=2e-4)


def test_another_network_is_trained_on_the_same_configuration(place):
    assert cli.main(arguments(place, "seq", "--quiet", "--epochs", "1", "--model", "seq2seq")) == 0
    checkpoint = load_checkpoint(place / "seq")
    assert checkpoint["network"] == "seq2seq"
    assert checkpoint["config"]["name"] == "tiny-seq2seq"


@pytest.mark.parametrize("precision", ["bf16-mixed"])
def test_a_run_in_mixed_precision_stays_close(place, whole, precision):
    assert cli.main(arguments(place, precision, "--quiet", "--precision", precision)) == 0
    full, mixed = (
        load_checkpoint(whole / "last.pt"),
        load_checkpoint(place / precision / "last.pt"),
    )
    assert all(value.dtype == torch.float32 for value in mixed["average"].values())
    first, given = full["state"]["rows"][0], mixed["state"]["rows"][0]
    assert given["skipped"] == 0
    assert given["loss"] == pytest.approx(first["loss"], rel=0.05)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["--out", "{whole}"], "exists already, expected a new one or --resume"),
        (["--model", "lstm"], "network is 'lstm', expected one of 'mtp-go', 'seq2seq'"),
        (["--precision", "64"], "trainer.precision is '64', expected one of '32-true'"),
        (["--devices", "-1"], "trainer.devices is -1, expected at least 0"),
        (["--devices", "99"], "expected at least 198 of both for 99 processes"),
        (["--epochs", "0"], "optimisation.epochs is 0, expected more than 0"),
        (["--resume"], "holds no run to resume"),
        (["--resume", "--out", "{whole}", "--seed", "5"], "config.yaml in seed (1 there, 5 here)"),
        (["--resume", "--init-from", "{whole}"], "--init-from is given with --resume"),
        (
            ["--find-lr", "--set", "optimisation.learning_rate=0.1"],
            "optimisation.learning_rate is given with --set and --find-lr, which finds one",
        ),
        (["--init-from", "{place}/c.yaml"], "c.yaml is no readable checkpoint"),
        (["--init-from", "no_such_model"], "is neither a file nor a shipped checkpoint, expected"),
        (["--init-from", "{whole}", "--model", "seq2seq"], "are of 'mtp-go', but the configured"),
        (["--layout", "highd"], "has the layout"),
    ],
)
def test_bad_input_is_one_sentence(place, whole, capsys, more, sentence):
    before = sorted(place.iterdir())
    words = [word.format(place=place, whole=whole) for word in more]
    command = arguments(place, "new")
    if "--layout" in words:
        command.remove("--layout")
        command.remove("ind")
    assert cli.main([*command, *words]) == 2
    said, errors = capsys.readouterr()
    assert errors.count("\n") == 1
    assert sentence in errors
    assert "next:" not in said
    assert sorted(place.iterdir()) == before


def test_a_device_that_is_not_there_is_one_sentence(place, capsys):
    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    config = {**CONFIG, "trainer": {"accelerator": "gpu"}}
    (place / "gpu.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    command = arguments(place, "gpu")
    command[1] = str(place / "gpu.yaml")
    assert cli.main(command) == 2
    errors = capsys.readouterr().err
    assert "(accelerator 'gpu', 1 device(s), precision '32-true') does not fit" in errors
    assert errors.count("\n") == 1


def test_without_the_extra_it_is_named(place, capsys, monkeypatch):
    for name in [n for n in sys.modules if n.startswith("mtpgo_training.training.trainer")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "lightning_fabric", None)
    assert cli.main(arguments(place, "no")) == 2
    errors = capsys.readouterr().err
    assert errors.startswith(
        "mtpgo: train needs lightning_fabric, which comes with the extra 'training'"
    )
    assert errors.count("\n") == 1


def test_fabric_is_loaded_only_when_a_run_starts():
    code = (
        "import sys\nfrom mtpgo_training import cli\ncli.build_parser('train')\n"
        "print('lightning_fabric' in sys.modules, 'torch' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.split() == ["False", "False"]


def test_overriding_leaves_the_rest_alone(place):
    from mtpgo_training.commands.train import overridden

    parser = cli.build_parser("train")
    config = load_config(place / "c.yaml")
    same = overridden(config, parser.parse_args(arguments(place, "x")))
    assert same == config
    other = overridden(config, parser.parse_args(arguments(place, "x", "--devices", "3")))
    assert other == dataclasses.replace(
        config, trainer=dataclasses.replace(config.trainer, devices=3)
    )
