# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command ``mtpgo study``: interrupted, continued, with a failed run; what it refuses."""

import csv
import json
import signal

import pytest
import yaml
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError, MtpgoError
from mtpgo_training import cli
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.study.study_run import StudyRun
from mtpgo_training.training.interruption import Interruption

CONFIG = {
    "name": "tiny",
    "data": {"restart_probability": 0.0, "stride_s": 0.8},
    "scene": {"max_neighbours": 3},
    "model": {
        "hidden": 8,
        "modes": 2,
        "horizon_steps": 5,
        "layer": "graphconv",
        "integrator": "euler",
        "ode_hidden": 4,
    },
    "optimisation": {"epochs": 8, "batch_scenes": 8},
}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a configuration and five recordings."""
    folder = tmp_path_factory.mktemp("place")
    for seed in range(5):
        write_ind(braking_cars(f"{seed:02d}", seed=seed, tracks=4, seconds=5.0), folder / "site")
    (folder / "c.yaml").write_text(yaml.safe_dump(CONFIG), encoding="utf-8")
    return folder


def arguments(place, *more, study="comparison", out="out"):
    given = ["study", study, "--data", place / "site", "--layout", "ind", "--out", place / out]
    given += ["--config", place / "c.yaml", "--cache", place / "cache", "--steps-per-run", 24]
    return [*map(str, given), *more]


TWO_ROWS = ("--rows", "cv", "seq2seq", "mtp-go1", "--seeds", "1", "--extrapolate", "2")


@pytest.fixture
def in_this_process(monkeypatch):
    """Runs in this process; Ctrl-C is pressed as soon as the first checkpoint is there."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    pressed, checkpoint = [], []

    class Interrupting(Interruption):
        def requested(self):
            if not pressed and checkpoint[-1].exists():
                pressed.append(True)
                signal.raise_signal(signal.SIGINT)
            return super().requested()

    def run_here(jobs, processes, interruption, *, started, finished, failed):
        for job in jobs:
            started(job)
            checkpoint.append(job.folder / "run" / "last.pt")
            try:
                done = job.run()
            except MtpgoError as error:
                failed(job, error)
                continue
            if not done:
                interruption.received_signal = signal.SIGINT
                return
            finished(job)

    with monkeypatch.context() as patch:
        patch.setattr("mtpgo_training.study.study_progress.run_folds", run_here)
        patch.setattr("mtpgo_training.training.trainer.Interruption", Interrupting)
        yield patch
    signal.signal(signal.SIGINT, before)


def test_a_study_of_two_rows_interrupted_continued_and_with_a_failed_run(
    place, capsys, in_this_process
):
    """An interrupt ends the training after a step; the same command continues it."""
    out = place / "out"
    assert cli.main(arguments(place, *TWO_ROWS)) == 128 + signal.SIGINT
    printed = capsys.readouterr()
    assert "interrupted; to continue: mtpgo study comparison " in printed.out
    assert not (out / "runs" / "seq2seq-seed1" / "scores.json").exists()
    content = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert [row["gap"] for row in content["rows"]] == [
        "no run has scored it yet",
        "not run yet: seed 1",
        "not run yet: seed 1",
    ]

    assert cli.main(arguments(place, *TWO_ROWS)) == 0
    printed = capsys.readouterr()
    assert "2 runs, 0 done before" in printed.out
    config = (out / "runs" / "seq2seq-seed1" / "run" / "config.yaml").read_text(encoding="utf-8")
    assert "\nnum_threads: 1\n" in config, "processes beside each other have one thread each"
    log = (out / "runs" / "seq2seq-seed1" / "run" / "log.csv").read_text(encoding="utf-8")
    assert [line.split(",")[0] for line in log.splitlines()[1:]] == [*"12345678"]
    content = json.loads((out / "result.json").read_text(encoding="utf-8"))
    rows = {row["name"]: row for row in content["rows"]}
    assert all(row["gap"] is None for row in rows.values())
    assert rows["seq2seq"]["paper"]["ade"] == {"value": 0.57, "half_width": None}
    assert rows["mtp-go1"]["values"]["ade"]["mean"] > 0.0
    assert rows["cv"]["values"]["ade"]["seeds"] == 1
    (beyond,) = rows["mtp-go1"]["extrapolation"]
    assert (beyond["trained_s"], beyond["time_s"][-1]) == (1.0, 2.0)
    assert "<img" in (out / "index.html").read_text(encoding="utf-8")
    assert "| MTP-GO1 |" in (out / "result.md").read_text(encoding="utf-8")
    assert "\\bottomrule" in (out / "result.tex").read_text(encoding="utf-8")
    with (out / "result.csv").open(encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 3 * 6
    assert lines[0]["row"] == "cv"

    def broken(self):
        assert self.seed == 2, "a run that is done is run again"
        raise ConfigurationError("the loss is not finite")

    in_this_process.setattr(StudyRun, "run", broken)
    assert cli.main([*arguments(place, *TWO_ROWS), "--seeds", "2"]) == 2
    printed = capsys.readouterr()
    assert "2 done before" in printed.out
    assert "gap: MTP-GO1: seed 2 failed: the loss is not finite" in printed.out
    assert "mtp-go1-seed2: the loss is not finite" in printed.err
    assert "2 of 4 runs failed (seq2seq-seed2, mtp-go1-seed2); the same command" in printed.err


def test_strides_that_are_no_whole_number_of_frames_are_told(place, capsys, monkeypatch):
    monkeypatch.setattr("mtpgo_training.study.study_progress.run_folds", lambda *_, **__: None)
    given = ["--stride", "1.05", "--set", "data.stride_s=0.45", "--rows", "mtp-go1", "--quiet"]
    assert cli.main(arguments(place, *given, out="rounded")) == 2  # no run is done
    scored, cut, _ = capsys.readouterr().err.splitlines()
    told = "which is no whole number of frames:"
    assert scored.startswith(f"mtpgo: warning: --stride is 1.05 s, {told} instants are scored ")
    assert cut.startswith(
        f"mtpgo: warning: data.stride_s is 0.45 s, {told} windows can be cut every 0.4 s (site/"
    )


@pytest.mark.parametrize(
    ("given", "study", "message"),
    [
        ((), "tables", "the study is 'tables', expected one of layers, static"),
        (("--rows", "mtp-go3"), "comparison", "--rows names 'mtp-go3', expected of the study"),
        (("--rows", "cv"), "comparison", "expected a row that is trained"),
        ((), "static", "needs pedestrian, bicycle, car, but the recordings for data.train have"),
        (("--recordings", "00", "01"), "layers", "2 recordings are given, expected at least 3"),
        (("--data-set", "ind"), "layers", "--data-set is 'ind', expected for the study layers"),
        (("--extrapolate", "1"), "layers", "--extrapolate is 1 s, expected more than"),
        (
            ("--patience", "2", "--set", "optimisation.calibration_epochs=1"),
            "layers",
            "trainer.patience_epochs is 2, expected 0 with optimisation.calibration_epochs 1",
        ),
        (("--part", "3/2"), "layers", "--part is '3/2', expected I/N"),
        (("--set", "model.depth=3"), "layers", "depth"),
        (("--minutes-per-run", "1"), "layers", "expected one"),
        (
            ("--find-lr", "--set", "optimisation.learning_rate=1"),
            "layers",
            "optimisation.learning_rate is given with --set and --find-lr",
        ),
        (("--measure",), "layers", "--measure is given without --list, expected both"),
        (("--list",), "layers", "is given with --list, which lists all rows of the paper's"),
    ],
)
def test_bad_input_is_one_sentence(place, capsys, given, study, message):
    assert cli.main(arguments(place, *given, study=study, out="refused")) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1
    assert message in error[0]


def test_a_folder_of_another_study_or_of_something_else_is_refused(place, capsys):
    other = place / "other"
    other.mkdir()
    (other / "study.json").write_text('{"study": "static"}', encoding="utf-8")
    assert cli.main(arguments(place, study="layers", out="other")) == 2
    assert "study is layers, but static in" in capsys.readouterr().err
    (other / "study.json").rename(other / "notes.txt")
    assert cli.main(arguments(place, study="layers", out="other")) == 2
    assert "which holds no study" in capsys.readouterr().err


def test_the_list_shows_all_rows_of_the_four_studies(capsys):
    assert cli.main(["study", "--list"]) == 0
    printed = capsys.readouterr().out
    for name in ("gat+-5", "mtp-go2-s", "trajectron++", "model.ekf=false model.ode=false"):
        assert name in printed
