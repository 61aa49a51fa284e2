# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The benchmark compares two implementations of the same function."""

import json

import pytest
import torch

from models.mtp_go_config import INFLATION
from mtpgo_training.benchmark import latency_benchmark as latency
from mtpgo_training.benchmark.reference_mtp_go import ReferenceMTPGO
from mtpgo_training.cli import main


@pytest.mark.parametrize("agents", [1, 2, 5])
def test_the_two_implementations_agree(agents):
    model = latency.make_model(seed=agents)
    scene = latency.make_scene(agents, model.config, seed=agents)
    with torch.inference_mode():
        mine = latency.exported(model)(*scene)
    theirs = ReferenceMTPGO(model.config, model.state_dict())(*scene)
    assert latency.largest_difference_m(mine, theirs) < 1e-4
    torch.testing.assert_close(mine[0], theirs[0], rtol=0, atol=1e-5)
    torch.testing.assert_close(mine[1], theirs[1], rtol=0, atol=1e-4)
    # In float32 the order of the sums shows where variances grow large.
    torch.testing.assert_close(mine[2], theirs[2], rtol=1e-3, atol=10 * INFLATION)


def test_the_scene_and_the_model_are_not_trivial():
    """The modes are metres apart, and neighbours matter."""
    model = latency.make_model()
    scene = latency.make_scene(4, model.config)
    with torch.no_grad():
        mean = model(*scene)[1]
        alone = model(*(part[:, :1] for part in scene))[1]
    assert (mean[:, :, 1:, -1, :2] - mean[:, :, :1, -1, :2]).norm(dim=-1).max() > 1.0
    assert (mean[:, :1] - alone).abs().max() > 1e-3


def test_command(tmp_path, capsys):
    out = tmp_path / "latency.json"
    arguments = ["benchmark", "latency", "--agents", "2", "3", "--seconds", "0.1"]
    assert main([*arguments, "--json", str(out)]) == 0
    rows = json.loads(out.read_text())["rows"]
    assert [row["agents"] for row in rows] == [2, 3]
    for row in rows:
        assert row["threads"] == 1
        assert 0.0 < row["median_ms"] <= row["p99_ms"]
        assert row["ratio"] == pytest.approx(row["baseline_median_ms"] / row["median_ms"])
        assert 0.0 < row["gemm_share"] < 1.0
        assert row["difference_m"] < 1e-4
    assert "| 3 | 1 |" in capsys.readouterr().out


def test_a_disagreement_is_an_error(monkeypatch):
    real = ReferenceMTPGO.forward

    def shifted(self, *scene):
        log_weight, mean, covariance = real(self, *scene)
        return log_weight, mean + 1.0, covariance

    monkeypatch.setattr(ReferenceMTPGO, "forward", shifted)
    with pytest.raises(Exception, match="differ by"):
        latency.measure(2, 0.01, 100.0)


@pytest.mark.parametrize("arguments", [["--agents", "0"], ["--threads", "-1"]])
def test_counts_are_positive(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["benchmark", "latency", *arguments])
    assert caught.value.code == 2
    assert "expected at least 1" in capsys.readouterr().err
