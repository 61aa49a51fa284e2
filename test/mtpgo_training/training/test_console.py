# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The lines that a run prints: columns under their titles, and what comes next."""

import math
from pathlib import Path

import torch
from tiny_run import CONFIG, new_run, with_options
from torch_geometric.data import Data
from traffic import braking_cars

from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.training.console import epoch_line, setting_text, summary, title_line
from mtpgo_training.training.data_loading import Scenes

ROW = {
    "epoch": 12,
    "objective": "0.50 EWTA(1) + 0.50 NLL",
    "loss": 1.23456,
    "all_ade": 0.5,
    "all_min_ade": 0.25,
    "cv_all_ade": 1.0,
    "ca_all_ade": 2.0,
    "all_coverage_90": 0.5,
    "all_coverage_90_moving_3s": 0.75,
    "all_coverage_90_moving_5s": 0.9123,
    "seconds": 61.25,
    "skipped": 0,
}


def test_a_line_has_its_values_under_their_titles():
    line = epoch_line(ROW, 5.0)
    titles = "epoch  objective                      loss    ADE m minADE m       cv       ca"
    assert title_line(5.0) == titles + "  moving 90% 5s  seconds"
    assert line == (
        "12     0.50 EWTA(1) + 0.50 NLL       1.235    0.500    0.250    1.000    2.000"
        "          0.912     61.2"
    )
    assert len(line) == len(title_line(5.0))
    assert "moving 90% 3s" in title_line(3.0)
    assert "0.750" in epoch_line(ROW, 3.0)


def test_an_epoch_without_a_validation_has_dashes():
    kept = ("epoch", "objective", "loss", "seconds", "skipped")
    row = {name: ROW[name] for name in kept} | {"objective": "NLL"}
    expected = ["12", "NLL", "1.235", "-", "-", "-", "-", "-", "61.2"]
    assert epoch_line(row, 5.0).split() == expected
    unknown = dict.fromkeys(ROW.keys() - row.keys(), math.nan)
    assert epoch_line(row | unknown, 5.0).split() == expected


def test_skipped_steps_are_reported_below_the_line():
    first, second = epoch_line({**ROW, "skipped": 3}, 5.0).splitlines()
    assert first == epoch_line(ROW, 5.0)
    assert second == "  3 steps were skipped: loss or gradient was not finite"


def named(source, count):
    return tuple(
        NamedRecording(source, braking_cars(f"{n}", tracks=1, seconds=1.0)) for n in range(count)
    )


def test_the_setting_counts_recordings_scenes_and_agents():
    run = new_run()
    validation = [Data(primary=torch.tensor(rows)) for rows in ([True, False], [True, True])]
    splits = Splits(named("a", 2) + named("b", 1), named("b", 1), ())
    scenes = Scenes([None] * 30, validation)
    torch.set_num_threads(1)

    def lines(processes=1):
        device = torch.device("cpu")
        text = setting_text(run, scenes, splits, Path("r"), device, processes)
        return [line.split(maxsplit=1) for line in text.splitlines()]

    parameters = sum(value.numel() for value in run.model.parameters())
    assert lines() == [
        ["train", "2 of a, 1 of b: 30 scenes an epoch"],
        ["validate", "1 of b: 2 scenes, 3 agents"],
        ["test", "none"],
        ["network", f"mtp-go, {parameters} parameters"],
        ["device", "cpu, 1 thread(s), precision 32-true"],
        ["run", f"r, seed {CONFIG.seed}, epochs 1 to 8"],
    ]
    run.state.epoch, run.state.batch = 2, 5
    device, last = lines(2)[-2:]
    assert device[1] == "cpu, 2 processes of 1 thread(s), precision 32-true"
    assert last[1] == f"r, seed {CONFIG.seed}, epochs 3 to 8, from batch 6"


AGAIN = "mtpgo train c.yaml --out r --resume"


def test_the_summary_says_how_to_continue():
    run = new_run()
    run.state.epoch, run.state.seconds, run.state.epoch_seconds = 3, 100.0, 20.0
    assert summary(run, Path("r"), AGAIN) == "3 of 8 epochs done in 2.0 min, see r"
    run.stopping = True
    assert summary(run, Path("r"), AGAIN).splitlines()[1] == f"to continue: {AGAIN}"
    run.state.epoch = 8
    assert "--resume" not in summary(run, Path("r"), AGAIN)


def test_the_summary_of_a_validated_run_names_its_epoch_and_the_export():
    values = dict.fromkeys(
        ("ade", "fde", "mr", "apde", "anll", "fnll", "min_ade", "min_fde"), 0.5
    ) | dict.fromkeys(("coverage_50", "coverage_90", "coverage_95"), 0.5)
    run = new_run(with_options(keep="last"))
    run.state.metrics = {"model": {"all": {**values, "n": 7, "n_final": 7}}}
    run.state.metrics["model"]["all"] |= {"moving_n": 5, "coverage_90_moving_1s": 0.9125}
    run.state.metrics["model"]["all"]["sites_coverage_90_moving_1s"] = 0.8
    run.state.best_epoch = 4
    first, *_, coverage, _, last = summary(run, Path("r"), AGAIN).splitlines()
    assert first == "last epoch 4, validation, all agents, calibrated:"
    assert coverage.startswith("0.912 of moving road users are inside their 90 % ellipse after 1")
    assert last == "next: mtpgo export r -o tiny.pt"
