# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The description of a model as text."""

from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.export.model_info import model_text


def lines(**fields):
    return model_text(TaskDescription(name="made", **fields)).splitlines()


def test_the_task_is_described_in_full():
    text = lines(version="1.2", weights_sha256="ab", model={"network": "lstm"})
    assert text[:6] == [
        "made (exported by version 1.2)",
        "network    lstm",
        "states     x, y, vx, vy",
        "horizon    25 steps of 0.2 s, 8 modes",
        "history    16 steps of 0.2 s",
        "scene      policy cover, frame centre_heading, up to 31 neighbours within 100 m",
    ]
    assert text[8] == "weights    sha256 ab"
    unknown = lines()
    assert unknown[0] == "made (exported by version unknown)"
    assert unknown[1] == "network    mtp-go"


def test_recordings_are_listed_by_use():
    uses = (("01", "train"), ("02", "test"), ("03", "train"))
    recordings = [{"source": "cars", "name": name, "split": use} for name, use in uses]
    assert lines(training={"recordings": recordings})[9:] == [
        "train      cars/01, cars/03",
        "validation -",
        "test       cars/02",
    ]


def test_the_runs_that_the_model_was_chosen_from_are_listed():
    runs = [{"seed": 1, "validation_ade_m": 0.5}, {"seed": 7, "validation_ade_m": 0.4}]
    assert lines(training={"chosen_from": runs, "licence": "free", "attribution": ""})[12:] == [
        "chosen     from 2 runs by validation ADE: 0.500 m (seed 1), 0.400 m (seed 7)",
        "licence    free",
    ]


def test_metrics_without_a_value_are_left_out():
    scores = {"ade": 0.51249, "n": 7, "fnll": None}
    assert lines(metrics={"validation": {"model": {"all": scores}}})[12:] == [
        "metrics    validation:",
        "           model  all     ade 0.512  n 7",
    ]
