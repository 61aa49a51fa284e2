# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The training benchmark compares the same function on the same weights, or fails."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.benchmark import training_benchmark as training
from mtpgo_training.cli import main


@pytest.mark.parametrize("phase", training.PHASES)
def test_losses_and_gradients_agree(phase):
    """Scenes of different sizes, late entries, futures that end: padded against edge lists."""
    assert training.largest_difference(3, phase, seed=5) < 1e-4


def test_no_parameter_is_left_out_of_the_comparison():
    model = training.make_model().requires_grad_(True)
    batch = training.arc_batch(2, model.config)
    aim = training.PHASES["NLL"]
    _, grads = training.gradients(lambda: training.batch_loss(model, batch, aim), model)
    missing = set(dict(model.named_parameters())) - set(grads)
    assert missing == {"motion.inner", "motion.inner_bias"}  # there is one hidden layer


def test_implementations_that_differ_are_an_error(monkeypatch):
    wrong = {"NLL": replace(training.PHASES["NLL"], nll=0.5)}
    right = training.plain_loss
    monkeypatch.setattr(training, "plain_loss", lambda m, b, aim: right(m, b, wrong["NLL"]))
    with pytest.raises(ConfigurationError, match="in the NLL phase the gradients of the"):
        training.measure("NLL", scenes=2, threads=1, rounds=1)


def test_command(tmp_path: Path, capsys, monkeypatch):
    monkeypatch.setattr(training, "PHASES", {"EWTA": training.PHASES["EWTA"]})
    out = tmp_path / "training.json"
    given = ["--scenes", "3", "--threads", "1", "--rounds", "1", "--json", str(out)]
    assert main(["benchmark", "training", *given]) == 0
    printed = capsys.readouterr().out
    assert "| EWTA | 3 |" in printed
    assert printed.startswith("$ mtpgo benchmark training --scenes 3 --threads 1 --rounds 1\n")
    (row,) = json.loads(out.read_text())["rows"]
    assert row["processes"] == row["threads"] == 1
    assert row["ratio"] > 0.0
    assert row["gradient_difference"] < 1e-4
