# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A small training run: it learns, and a resumed run gives the same bits."""

import csv
import dataclasses
import json
import math
import os
import shutil
import signal
import time

import pytest
import torch
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.scene.trails.trail_branches import BRANCHES
from mtpgo_core.task.task_description import SceneConfig
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.export.exporter import load_model
from mtpgo_training.reports.learning_curve import read_log
from mtpgo_training.training.run_folder import RunFolder, load_checkpoint, write_checkpoint
from mtpgo_training.training.trainer import train
from mtpgo_training.training.training_config import (
    DataConfig,
    OptimisationConfig,
    TrainingConfig,
    load_config,
)

THREADS = int(os.environ["OMP_NUM_THREADS"])

CONFIG = TrainingConfig(
    num_threads=THREADS,
    data=DataConfig(
        validation=("03",), validation_stride_s=1.0, stride_s=0.4, restart_probability=0.2
    ),
    scene=SceneConfig(max_neighbours=3),
    model={
        "hidden": 16,
        "modes": 2,
        "horizon_steps": 10,
        "layer": "graphconv",
        "integrator": "euler",
        "ode_hidden": 4,
    },
    optimisation=OptimisationConfig(
        epochs=8, batch_scenes=8, learning_rate=1e-2, warmup_steps=5, teacher_forcing=0.3
    ),
)

FEW_SCENES = dataclasses.replace(
    CONFIG, data=dataclasses.replace(CONFIG.data, stride_s=2.0, validation_stride_s=2.0)
)
"""For tests in which it does not matter what is learned."""


def recordings(*seeds):
    return [
        NamedRecording("cars", braking_cars(f"{seed:02d}", seed=seed, tracks=8, seconds=5.0))
        for seed in seeds
    ]


def run(folder, config=CONFIG, **options):
    return train(config, recordings(1, 2, 3), RunFolder(folder), **options)


def assert_same_weights(one, other):
    for name, value in one.state_dict().items():
        torch.testing.assert_close(other.state_dict()[name], value, rtol=0.0, atol=0.0)


def assert_same_run(one, other):
    assert_same_weights(one.model, other.model)
    assert_same_weights(one.average, other.average)


def with_options(config=CONFIG, *, trainer=(), **optimisation):
    """The configuration with other values in the sections optimisation and trainer."""
    return dataclasses.replace(
        config,
        optimisation=dataclasses.replace(config.optimisation, **optimisation),
        trainer=dataclasses.replace(config.trainer, **dict(trainer)),
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "whole"
    torch.set_num_threads(THREADS)
    return run(folder), folder


def test_it_learns_what_constant_velocity_misses(whole):
    done, _ = whole
    row = done.state.rows[-1]
    assert row["all_ade"] < 0.7 * row["cv_all_ade"]
    best = done.state.metrics
    assert best["model"]["all"]["n"] == best["cv"]["all"]["n"] > 20
    # So few agents move the factors only part of the way to a coverage of 0.9.
    assert best["model"]["all"]["coverage_90"] == pytest.approx(0.9, abs=0.06)


def test_the_log_has_a_line_per_epoch_with_baselines(whole):
    _, folder = whole
    with (folder / "log.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["epoch"] for row in rows] == [str(n) for n in range(1, 9)]
    assert rows[0]["objective"] == "EWTA(2)"
    assert rows[-1]["objective"] == "NLL"
    assert float(rows[-1]["all_ade"]) < float(rows[-1]["cv_all_ade"])
    assert {"all_fde", "all_anll", "centre_ade", "ca_all_ade", "total_seconds"} <= set(rows[0])
    assert 0.0 <= float(rows[-1]["all_coverage_90_moving_1s"]) <= 1.0
    assert rows[-1]["skipped"] == "0"
    assert list((folder / "tensorboard").glob("events.*"))


def test_the_checkpoints_are_plain_data_and_name_their_network(whole):
    done, folder = whole
    best, last = load_checkpoint(folder), load_checkpoint(folder / "last.pt")
    assert best["network"] == last["network"] == "mtp-go"
    assert best["epoch"] == done.state.best_epoch
    assert "optimiser" not in best
    assert_same_weights(done.average, load_model(last))


class Killed(Exception):  # noqa: N818
    """Stands for a signal that cannot be caught: nothing runs after it."""


def kill_after_saves(folder, count, config=CONFIG, **options):
    """Start or resume a run and end it when it has written ``count`` checkpoints."""

    class Folder(RunFolder):
        saves = 0

        def save(self, *args, **kwargs):
            super().save(*args, **kwargs)
            Folder.saves += 1
            if Folder.saves == count:
                raise Killed

    with pytest.raises(Killed):
        train(config, recordings(1, 2, 3), Folder(folder), **options)
    return load_checkpoint(folder / "last.pt")["state"]


def use_validation_errors(monkeypatch, errors):
    """Replace the validation's scores: the model's ADE of each validation is given (m).

    What is scored stays real, so that a validation of the best epoch with calibrated covariances
    can follow; it repeats the error of its epoch.
    """
    from mtpgo_training.training import validation

    real, left = validation.validate, list(errors)
    current = []

    def validate(model, batches, calibration, **options):
        if calibration.is_none:
            current[:] = [left.pop(0)]
        scores, samples = real(model, batches, calibration, **options)
        averages = scores.averages()
        averages["model"]["all"]["ade"] = current[0]

        class Known:
            def averages(self):
                return averages

        return Known(), samples

    monkeypatch.setattr(validation, "validate", validate)


# The losses of the 8 epochs: EWTA, EWTA and NLL, then NLL alone from the third epoch on.
BEST_AT_5 = [0.1, 0.1, 0.9, 0.8, 0.6, 0.7, 0.6, 0.9]


@pytest.mark.parametrize(("keep", "expected"), [("best", 5), ("last", 8)])
def test_the_best_epoch_or_the_last_is_kept(tmp_path, monkeypatch, keep, expected):
    use_validation_errors(monkeypatch, BEST_AT_5)
    done = run(tmp_path / "r", with_options(FEW_SCENES, keep=keep))
    assert [row["all_ade"] for row in done.state.rows] == BEST_AT_5
    assert done.state.best_epoch == expected
    checkpoint = load_checkpoint(tmp_path / "r")
    assert checkpoint["epoch"] == expected
    assert checkpoint["metrics"]["model"]["all"]["ade"] == BEST_AT_5[expected - 1]


def test_a_resumed_run_ends_with_the_same_weights(whole, tmp_path):
    done, _ = whole
    folder = tmp_path / "resumed"
    stopped = run(folder, max_minutes=0.0)  # the time is up after the first step
    assert (stopped.state.epoch, stopped.state.batch) == (0, 1)
    assert stopped.out_of_time
    assert load_checkpoint(folder)["metrics"]["model"]["all"]["ade"] == pytest.approx(
        stopped.state.metrics["model"]["all"]["ade"]
    )
    assert load_checkpoint(folder / "last.pt")["state"]["best_epoch"] == 0
    with (folder / "log.csv").open(encoding="utf-8") as file:
        (line,) = csv.DictReader(file)
    assert (line["epoch"], line["steps"]) == ("1", "1")
    assert float(line["all_ade"]) > 0.0
    state = kill_after_saves(folder, 3, resume=True)
    assert (state["epoch"], state["batch"]) == (3, 0)
    again = run(folder, resume=True)
    assert again.state.epoch == 8
    assert_same_run(done, again)
    assert again.state.best == done.state.best
    names = set(done.state.rows[0]) - {"seconds", "total_seconds"}
    for row, expected in zip(again.state.rows, done.state.rows, strict=True):
        assert {k: row[k] for k in names} == {k: expected[k] for k in names}


def test_a_run_continued_after_a_time_limit_keeps_the_best_of_its_epochs(tmp_path, monkeypatch):
    folder, errors = tmp_path / "r", list(BEST_AT_5)
    errors.insert(5, 0.2)  # of the first step of the sixth epoch, after which the time is up
    use_validation_errors(monkeypatch, errors)
    kill_after_saves(folder, 5)
    stopped = run(folder, resume=True, max_minutes=0.0)
    assert (stopped.state.epoch, stopped.state.batch) == (5, 1)
    assert load_checkpoint(folder)["metrics"]["model"]["all"]["ade"] == 0.2
    done = run(folder, resume=True)
    assert done.state.best_epoch == 5
    checkpoint = load_checkpoint(folder)
    assert checkpoint["metrics"]["model"]["all"]["ade"] == BEST_AT_5[4]
    assert (checkpoint["epoch"], checkpoint["metrics"]) == (5, done.state.metrics)


def test_a_run_in_a_given_time_comes_to_the_end_of_its_schedule(tmp_path):
    """Its clock began in the past: almost nothing of the minute is left to measure and train."""
    start_s = time.monotonic()
    options = {"max_minutes": 1.0, "started_s": start_s - 56.0, "shorten": True}
    done = run(tmp_path / "r", with_options(epochs=2000), **options)
    assert done.config.optimisation.epochs < 2000
    stored = load_config(tmp_path / "r" / "config.yaml")
    assert stored == done.config
    assert load_checkpoint(tmp_path / "r")["metrics"]
    again = run(tmp_path / "r", with_options(epochs=2000), resume=True, max_minutes=0.0)
    assert again.config == done.config
    assert again.finished or again.state.step == done.state.step + 1
    with pytest.raises(ConfigurationError, match=r"epochs \(2000 there, 3000 here\)"):
        run(tmp_path / "r", with_options(epochs=3000), resume=True)


def test_a_run_killed_within_an_epoch_resumes_from_the_checkpoint_there(whole, tmp_path):
    done, _ = whole
    often = with_options(trainer={"checkpoint_minutes": 1e-9})
    state = kill_after_saves(tmp_path / "r", 14, often)
    assert state["epoch"] == 1
    assert 0 < state["batch"] < state["step"] < 20
    assert_same_run(done, run(tmp_path / "r", resume=True))


def test_a_run_of_a_version_that_logged_less_is_resumed(tmp_path, capsys):
    folder, config = tmp_path / "r", with_options(FEW_SCENES, epochs=2)
    kill_after_saves(folder, 1, config)
    checkpoint = load_checkpoint(folder / "last.pt")
    (row,) = checkpoint["state"]["rows"]
    for name in [name for name in row if "moving" in name]:
        del row[name]
    write_checkpoint(folder / "last.pt", checkpoint)
    run(folder, config, resume=True, verbose=True)
    titles = next(s for s in capsys.readouterr().out.splitlines() if s.startswith("epoch "))
    assert "moving 90% 1s" in titles  # of two seconds
    first, second = read_log(folder)
    assert first["all_coverage_90_moving_1s"] == ""
    assert 0.0 <= float(second["all_coverage_90_moving_1s"]) <= 1.0
    assert int(second["all_moving_n"]) > 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_run_after_the_step(tmp_path, number):
    before, raised = signal.getsignal(number), []

    class Folder(RunFolder):
        def write_log(self, rows):
            super().write_log(rows)
            if rows[-1]["epoch"] == 1 and not raised:
                raised.append(number)
                signal.raise_signal(number)

    stopped = train(CONFIG, recordings(1, 2, 3), Folder(tmp_path / "r"))
    assert (stopped.state.epoch, stopped.state.batch) == (1, 1)
    assert stopped.received_signal == number
    assert load_checkpoint(tmp_path / "r" / "last.pt")["state"]["batch"] == 1
    assert signal.getsignal(number) == before


def test_an_existing_folder_is_not_overwritten(whole):
    with pytest.raises(ConfigurationError, match="exists already, expected a new one or --resume"):
        run(whole[1])


def test_only_the_same_configuration_and_data_are_resumed(whole):
    other = dataclasses.replace(CONFIG, seed=2)
    with pytest.raises(ConfigurationError, match=r"differs from .*config.yaml in seed \(1 there"):
        run(whole[1], config=other, resume=True)
    with pytest.raises(ConfigurationError, match=r"recordings differ from those in .*run.json"):
        train(CONFIG, recordings(1, 3), RunFolder(whole[1]), resume=True)


def test_threads_and_trainer_options_may_change_when_a_run_is_resumed(whole):
    config = with_options(trainer={"validate_every_epochs": 2})
    done = run(whole[1], dataclasses.replace(config, num_threads=3 - THREADS), resume=True)
    torch.set_num_threads(THREADS)
    assert done.state.epoch == 8
    assert_same_run(whole[0], done)


def test_a_folder_without_a_run_cannot_be_resumed(tmp_path):
    with pytest.raises(ConfigurationError, match="holds no run to resume"):
        run(tmp_path / "nothing", resume=True)


def test_a_run_can_start_from_the_weights_of_another(whole, tmp_path):
    short = with_options(learning_rate=1e-12)
    tuned = run(tmp_path / "tuned", short, init_from=whole[1], max_minutes=0.0)
    expected = load_model(load_checkpoint(whole[1])).state_dict()
    for name, value in tuned.model.state_dict().items():
        torch.testing.assert_close(value, expected[name])
    facts = json.loads((tmp_path / "tuned" / "run.json").read_text(encoding="utf-8"))
    assert len(facts["initial_weights_sha256"]) == 64


def test_validation_recordings_that_the_first_weights_have_seen_are_told(tmp_path, caplog):
    def with_seed(seed):
        data = dataclasses.replace(FEW_SCENES.data, validation=(), validation_fraction=0.4)
        return dataclasses.replace(with_options(FEW_SCENES, epochs=1), seed=seed, data=data)

    def start(name, seed, **options):
        named = [dataclasses.replace(item, recording=with_hash(item)) for item in recordings(1, 2)]
        train(with_seed(seed), named, RunFolder(tmp_path / name), verbose=True, **options)
        return [record.getMessage() for record in caplog.records]

    def with_hash(item):
        return dataclasses.replace(item.recording, sha256=f"hash of {item.name}")

    assert start("first", 1) == []
    assert start("same", 1, init_from=tmp_path / "first") == []
    (said,) = start("other", 3, init_from=tmp_path / "first")
    assert said.startswith(
        "mtpgo: the weights that the run starts from were trained on 1 of its 1 validation "
        "recordings (cars/0"
    )


def test_weights_of_another_architecture_are_refused(whole, tmp_path):
    larger = dataclasses.replace(CONFIG, model={**CONFIG.model, "hidden": 8})
    with pytest.raises(ConfigurationError, match=r"weights of .* do not fit the configured") as e:
        run(tmp_path / "x", larger, init_from=whole[1])
    assert "\n" not in str(e.value)
    turned = dataclasses.replace(CONFIG, scene=SceneConfig(frame="driving_direction"))
    with pytest.raises(ConfigurationError, match=r"on other inputs \(frame centre_heading"):
        run(tmp_path / "x", turned, init_from=whole[1])
    other = dataclasses.replace(CONFIG, network="seq2seq", model={"hidden": 16})
    with pytest.raises(ConfigurationError, match=r"are of 'mtp-go', .* is 'seq2seq'"):
        run(tmp_path / "x", other, init_from=whole[1])
    assert not (tmp_path / "x").exists()


def test_a_checkpoint_of_another_architecture_is_not_resumed(whole, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(whole[1], folder)
    checkpoint = torch.load(folder / "last.pt", weights_only=True)
    checkpoint["model"].pop(next(iter(checkpoint["model"])))
    torch.save(checkpoint, folder / "last.pt")
    with pytest.raises(ConfigurationError, match=r"last.pt does not fit") as caught:
        run(folder, resume=True)
    assert "\n" not in str(caught.value)


def test_patience_ends_a_run_without_a_better_validation(tmp_path, monkeypatch):
    trainer = {"patience_epochs": 2, "validate_every_epochs": 2}
    config = with_options(FEW_SCENES, epochs=16, trainer=trainer)
    # NLL alone from the fifth epoch on; validated are the epochs 2, 4, 6, 8, 10.
    use_validation_errors(monkeypatch, [0.1, 0.1, 0.8, 0.7, 0.7])
    stopped = run(tmp_path / "r", config)
    assert stopped.state.best_epoch == 8
    assert stopped.state.epoch == 10
    validated = ["all_ade" in row for row in stopped.state.rows]
    assert validated == [n % 2 == 1 for n in range(10)]
    assert run(tmp_path / "r", config, resume=True).state.epoch == stopped.state.epoch


def test_patience_counts_no_epoch_of_the_warm_up(tmp_path, monkeypatch):
    config = with_options(FEW_SCENES, epochs=16, trainer={"patience_epochs": 2})
    use_validation_errors(monkeypatch, [0.5] * 4 + [5.0, 6.0, 7.0])
    stopped = run(tmp_path / "r", config)
    assert (stopped.state.best_epoch, stopped.state.epoch) == (5, 7)


def test_additional_processes_that_cut_the_scenes_change_nothing(tmp_path):
    """The fixture ``no_fork`` checks that they are no forks of this process."""
    short = with_options(FEW_SCENES, epochs=1)
    expected = run(tmp_path / "one", short)
    assert_same_run(
        expected, run(tmp_path / "w", with_options(short, trainer={"loader_workers": 1}))
    )


def test_a_step_that_is_not_finite_is_skipped(tmp_path, monkeypatch):
    from mtpgo_training.training import run_loss as place

    real, calls = place.batch_loss, []

    def sometimes(*args, **kwargs):
        calls.append(1)
        return real(*args, **kwargs) * (float("nan") if len(calls) == 3 else 1.0)

    monkeypatch.setattr(place, "batch_loss", sometimes)
    trained = run(
        tmp_path / "r",
        with_options(epochs=1),
    )
    assert trained.state.rows[0]["skipped"] == 1
    assert trained.state.step == len(calls)
    assert all(bool(torch.isfinite(p).all()) for p in trained.model.parameters())


def test_a_run_with_trails_and_sizes_on_the_likelihood_of_trajectories(tmp_path):
    config = dataclasses.replace(
        with_options(FEW_SCENES, epochs=2, likelihood="trajectory", mean_weight=0.5),
        scene=SceneConfig(max_neighbours=3, sizes=True, trails=True),
        model={
            **CONFIG.model,
            "static_features": True,
            "static_inputs": "all",
            "hold_standing": True,
        },
    )
    done = run(tmp_path / "r", config)
    assert [row["objective"] for row in done.state.rows] == ["EWTA(2)", "NLL"]
    for row in done.state.rows:
        assert row["skipped"] == 0
        assert math.isfinite(row["loss"])
    model = load_model(load_checkpoint(tmp_path / "r"))
    assert (model.config.trail_branches, model.config.static_size) == (BRANCHES, 11)
    assert_same_weights(done.average, load_model(load_checkpoint(tmp_path / "r" / "last.pt")))


def test_an_unknown_model_option_is_named(tmp_path):
    config = dataclasses.replace(CONFIG, model={"hiden": 3})
    with pytest.raises(ConfigurationError, match=r"model has the unknown field 'hiden'"):
        run(tmp_path / "x", config=config)
    assert not (tmp_path / "x").exists()


def test_the_last_epochs_may_train_the_covariances_alone(tmp_path):
    config = with_options(FEW_SCENES, epochs=3, calibration_epochs=1, learning_rate=1e-3)
    done = run(tmp_path / "r", config)
    assert done.state.best_epoch == 3
    kill_after_saves(tmp_path / "cut", 2, config)
    main = load_checkpoint(tmp_path / "cut" / "last.pt")["model"]
    changed = {
        name.partition(".")[0]
        for name, value in done.model.state_dict().items()
        if not torch.equal(value, main[name])
    }
    assert changed == {"noise", "initial_covariance"}


def test_parts_that_the_network_does_not_have_are_named(tmp_path):
    config = with_options(FEW_SCENES, train_only=("tails",))
    with pytest.raises(ConfigurationError, match="train_only names 'tails', expected parts"):
        run(tmp_path / "r", config)
