# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Evaluation of models with the predictor of the node."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
from known_scores import filled
from traffic import braking_cars

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.model_file import find_model
from mtpgo_training.evaluation.evaluator import (
    Evaluation,
    Settings,
    _windows,
    evaluate,
    evaluate_all,
    load_models,
)
from mtpgo_training.evaluation.scores.score_table import ScoreTable
from mtpgo_training.scenes.tracker.simulated_tracker import draw_tracker
from mtpgo_training.scenes.windows import frames_every


@pytest.fixture(scope="module")
def runner():
    return ModelRunner.load(find_model("default"))


def test_evaluate_scores_the_online_path_and_the_baselines(runner):
    recording = braking_cars(seconds=5.0, tracks=6)
    table = evaluate({"tiny": runner}, [recording], stride_s=1.0)
    assert set(table) == {"tiny", "cv", "ca", "ctrv"}
    counts = {name: scores["all"]["n"] for name, scores in table.items()}
    assert len(set(counts.values())) == 1
    # Agents present at the scored instants, minus those without a future.
    expected = np.isin(recording.frame, frames_every(recording, 1.0)).sum()
    assert 0 < counts["tiny"] <= expected
    assert table["tiny"]["centre"]["n"] > 0
    assert np.isfinite(table["cv"]["all"]["anll"])
    report = json.loads(json.dumps(table))
    assert report["ca"]["all"]["anll"] is None


def test_models_evaluated_together_have_the_scores_of_each_alone(runner):
    recordings = [("01", braking_cars(tracks=6, seconds=8.0))]
    settings = Settings(stride_s=1.0)
    both = evaluate_all({"one": runner, "two": runner}, recordings, settings).scores.averages()
    assert both["one"] == both["two"]
    assert both["cv"]["all"]["n"] == both["one"]["all"]["n"]


def test_a_tracker_observes_and_the_recording_is_the_truth(runner):
    recordings = [("01", braking_cars(tracks=8, seconds=9.0))]

    def scores(seed):
        settings = Settings(stride_s=1.0, centre=False, tracker_seed=seed)
        averages = evaluate_all({"m": runner}, recordings, settings).scores.averages()
        return {name: value["all"] for name, value in averages.items()}

    recorded, one, same, other = (scores(seed) for seed in (None, 1, 1, 2))
    assert one == same
    assert len({s["cv"]["ade"] for s in (recorded, one, other)}) == 3
    tracker = draw_tracker(recordings[0][1], 1)
    seen = tracker.observe(recordings[0][1])
    assert one["m"]["n"] <= len(seen)
    # Scored against its own noisy reports, a prediction has another error.
    settings = Settings(stride_s=1.0, centre=False)
    of_itself = evaluate_all({"m": runner}, [("01", seen)], settings).scores.averages()
    assert of_itself["cv"]["all"]["ade"] != one["cv"]["ade"]


def test_smoothed_paths_of_the_centre_are_combined_from_instant_to_instant(runner):
    """As those of the same graphs that are scored at every instant."""
    noisy = draw_tracker(braking_cars(tracks=4, seconds=6.0), 1)
    recordings = [("01", noisy.observe(braking_cars(tracks=4, seconds=6.0)))]

    def scores(protocol, **values):
        settings = Settings(**values)
        agents = evaluate_all({"m": runner}, recordings, settings).scores.agents()
        agents = agents[(agents["model"] == "m") & (agents["protocol"] == protocol)]
        return agents.set_index(["stamp_ns", "track"])["ade"]

    for stride_s in (0.2, 0.4):
        centre = scores("centre", stride_s=stride_s, path_smoothing_s=0.5)
        each = scores("all", stride_s=stride_s, path_smoothing_s=0.5, policy="each", centre=False)
        assert len(centre) > 4
        np.testing.assert_allclose(centre, each.loc[centre.index], rtol=1e-6)


def test_models_see_unknown_classes_and_scores_are_by_the_true_ones(runner):
    cars = braking_cars(tracks=6, seconds=8.0)
    unknown = dataclasses.replace(cars, agent_class=np.zeros_like(cars.agent_class))

    def scores(recording, **given):
        settings = Settings(stride_s=1.0, centre=False, **given)
        return evaluate_all({"m": runner}, [("01", recording)], settings).scores

    known, hidden = scores(cars), scores(cars, unknown_classes=True)
    assert set(hidden.agents()["agent_class"]) == {"car"}
    found = {name: table.averages() for name, table in (("known", known), ("hidden", hidden))}
    assert found["hidden"]["cv"] == found["known"]["cv"]
    assert found["hidden"]["m"]["all"]["ade"] != found["known"]["m"]["all"]["ade"]
    assert found["hidden"]["m"] == scores(unknown).averages()["m"]


def test_instants_have_the_stride_and_every_fifth_is_scored_for_the_centre(runner):
    recording = braking_cars(tracks=2, seconds=6.0)
    ticks = []
    found = list(
        _windows(
            recording,
            recording,
            runner.task.history,
            Settings(stride_s=0.4),
            lambda: ticks.append(None),
        )
    )
    stamps_s = [(window.stamp_ns - recording.start_time_ns) * 1e-9 for window, _ in found]
    np.testing.assert_allclose(stamps_s, 0.4 * np.arange(15), atol=1e-9)
    centre = [k for k, (_, protocols) in enumerate(found) if "centre" in protocols]
    assert centre == [0, 5, 10]
    assert all("all" in protocols for _, protocols in found)
    assert len(ticks) == 1 + 56  # frames up to the last instant, 5.6 s at 10 Hz


def test_between_rare_instants_all_of_the_recording_is_seen(runner):
    recording = braking_cars(tracks=2, seconds=14.0)
    settings = Settings(stride_s=7.0)
    found = list(_windows(recording, recording, runner.task.history, settings, lambda: None))
    stamps_s = [(window.stamp_ns - recording.start_time_ns) * 1e-9 for window, _ in found]
    np.testing.assert_allclose(stamps_s, [0.0, 3.0, 6.0, 7.0, 9.0, 12.0], atol=1e-9)
    assert [k for k, (_, protocols) in enumerate(found) if protocols] == [0, 3]


def test_models_with_another_history_see_windows_of_their_own(runner):
    history = dataclasses.replace(runner.task.history, max_gap_s=0.1)
    other = ModelRunner(
        runner._module, dataclasses.replace(runner.task, history=history), runner.path
    )
    recordings = [("01", braking_cars(tracks=3, seconds=6.0))]
    steps = []
    together = evaluate_all(
        {"a": runner, "b": other},
        recordings,
        Settings(stride_s=1.0, centre=False),
        progress=lambda name, frames: steps.append((name, frames)) or (lambda: None),
    ).scores.averages()
    assert steps == [("01", 2 * 60)]
    alone = evaluate({"b": other}, [recordings[0][1]], stride_s=1.0, centre=False)
    assert together["b"] == alone["b"]


def test_results_on_other_recordings_are_merged():
    one, two = Evaluation(filled(), {"01": "a"}), Evaluation(ScoreTable(), {"02": "b"})
    two.merge(one)
    assert two.recordings == {"02": "b", "01": "a"}
    assert two.scores.averages() == one.scores.averages()
    assert two.online.averages() == {}
    two.merge(Evaluation(online=filled()))
    assert two.online.averages() == one.scores.averages()


def test_models_are_called_as_in_their_files_or_as_the_files_where_names_repeat(tmp_path):
    path = shutil.copy(find_model("default"), tmp_path / "mine.pt")
    assert list(load_models(["default", str(path)])) == ["default", "mine"]
    (tmp_path / "other").mkdir()
    again = shutil.copy(path, tmp_path / "other" / "mine.pt")
    assert list(load_models([str(path), str(again)])) == [str(path), str(again)]
