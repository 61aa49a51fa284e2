# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Learning curves from the logs of runs."""

import contextlib

import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from mtpgo_core.errors import ConfigurationError
from mtpgo_training import cli
from mtpgo_training.reports.learning_curve import draw_learning_curves, read_log
from mtpgo_training.training.run_folder import RunFolder


def row(epoch, **more):
    return {
        "epoch": epoch,
        "objective": "NLL" if epoch > 1 else "EWTA(2)",
        "total_seconds": 60.0 * epoch,
        **more,
    }


def scored(epoch, ade):
    baselines = {"cv_all_ade": 1.0, "ca_all_ade": 1.2}
    return row(epoch, all_ade=ade, all_min_ade=0.5 * ade, **baselines)


@pytest.fixture
def run(tmp_path):
    RunFolder(tmp_path / "first").write_log([scored(1, 1.1), row(2), scored(3, 0.8)])
    return tmp_path / "first"


def test_epochs_without_validation_are_left_out(run):
    assert [r["epoch"] for r in read_log(run)] == ["1", "3"]


def test_a_picture_is_drawn(run, tmp_path, capsys):
    output = tmp_path / "c.png"
    assert cli.main(["curve", str(run), str(run), "-o", str(output)]) == 0
    assert str(output) in capsys.readouterr().out
    assert imread(output).std() > 0.01


def test_a_run_of_one_epoch_has_points_inside_the_axes(tmp_path, monkeypatch):
    """Worse than the baselines, as a run is after an epoch of EWTA."""
    RunFolder(tmp_path / "short").write_log([scored(1, 4.0)])
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    with contextlib.suppress(FileNotFoundError):
        draw_learning_curves([tmp_path / "short"], tmp_path / "c.png")
    (axes,) = drawn[0].axes
    own = [line for line in axes.get_lines() if line.get_label().startswith("short")]
    assert [list(line.get_ydata()) for line in own] == [[4.0], [2.0]]
    for line in own:
        assert line.get_marker() == "o"
        assert axes.get_xlim()[0] <= line.get_xdata()[0] <= axes.get_xlim()[1]
        assert axes.get_ylim()[0] < line.get_ydata()[0] < axes.get_ylim()[1]


@pytest.mark.parametrize(
    ("cv_m", "labels"),
    [
        (1.0, ["constant velocity", "constant acceleration"]),
        (
            3.0,
            [
                f"{run}: constant {what}"
                for run in ("one", "two")
                for what in ("velocity", "acceleration")
            ],
        ),
    ],
)
def test_baselines_of_other_validation_recordings_are_drawn_for_each_run(
    tmp_path, monkeypatch, cv_m, labels
):
    RunFolder(tmp_path / "one").write_log([scored(1, 0.8)])
    RunFolder(tmp_path / "two").write_log([scored(1, 0.9) | {"cv_all_ade": cv_m}])
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    with contextlib.suppress(FileNotFoundError):
        draw_learning_curves([tmp_path / "one", tmp_path / "two"], tmp_path / "c.png")
    (axes,) = drawn[0].axes
    found = [line for line in axes.get_lines() if "constant" in line.get_label()]
    assert [line.get_label() for line in found] == labels
    assert found[-2].get_ydata()[0] == cv_m
    assert axes.get_ylim()[1] > cv_m


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ([row(1)], "has no epoch with the column all_ade"),
        ([scored(1, 1.0) | {"all_ade": ""}], "has no validated epoch yet"),
        (None, "log.csv cannot be read"),
    ],
)
def test_no_log_is_one_sentence(tmp_path, rows, sentence):
    if rows is not None:
        RunFolder(tmp_path / "r").write_log(rows)
    with pytest.raises(ConfigurationError, match=sentence) as caught:
        read_log(tmp_path / "r")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("1,NLL,60,1.0,0.5,1.0", "has None in the column ca_all_ade, expected a number"),
        ("1,NLL,60,abc,0.5,1.0,1.2", "has 'abc' in the column all_ade, expected a number"),
        ("1,NLL,,1.0,0.5,1.0,1.2", "has '' in the column total_seconds, expected a number"),
        ("1,NLL,60,1.0,0.5,1.0,x", "has 'x' in the column ca_all_ade, expected a number"),
    ],
)
def test_a_damaged_line_is_named(run, line, sentence):
    path = run / "log.csv"
    heads = "epoch,objective,total_seconds,all_ade,all_min_ade,cv_all_ade,ca_all_ade"
    path.write_text(f"{heads}\n{line}\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=sentence):
        read_log(run)
