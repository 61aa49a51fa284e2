# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The content of `mtpgo evaluate --json`, from known scores."""

import json

import pytest
from known_scores import add, filled

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.model_file import find_model
from mtpgo_training.evaluation.bags.agreement import Agreement
from mtpgo_training.evaluation.bags.bag_evaluation import BagResult
from mtpgo_training.evaluation.evaluator import Evaluation, Settings
from mtpgo_training.evaluation.scores.score_table import ScoreTable
from mtpgo_training.evaluation.summary import ONE_RECORDING, summarise
from mtpgo_training.reports.tables import interval_table, result_tables


@pytest.fixture(scope="module")
def runner():
    return ModelRunner.load(find_model("default"))


def test_the_content_is_json_and_says_what_was_evaluated(runner):
    result = BagResult(Evaluation(filled(), {"01": "a", "02": "b", "03": "c"}))
    settings = Settings(policy="each", stride_s=0.4, min_future_s=1.0)
    content = summarise(result, {"m": runner}, settings, layouts=["ind", "highd", "ind"])
    assert json.loads(json.dumps(content))["models"] == content["models"]
    assert content["models"] == result.evaluation.scores.averages()
    assert content["layout"] == ["highd", "ind"]
    assert (content["stride_s"], content["min_future_s"], content["policy"]) == (0.4, 1.0, "each")
    assert content["weights"] == {"m": runner.task.weights_sha256}
    assert content["notes"] == content["warnings"] == []
    assert content["seeds"] == {}
    assert (content["tracker"], content["tracker_seed"]) == ("recorded", None)
    simulated = summarise(result, {"m": runner}, Settings(tracker_seed=0))
    assert (simulated["tracker"], simulated["tracker_seed"]) == ("simulated", 0)


def test_instants_of_a_bag_have_no_stride_and_one_recording_no_intervals():
    table = ScoreTable()
    add(table, 1.0)
    agreements = {"bag": {"m": Agreement([0.001, 0.003], 1, "here")}}
    result = BagResult(Evaluation(table, {"01": "a"}), agreements, ["a warning"])
    content = summarise(result, {}, Settings(), from_bags=True)
    assert content["stride_s"] is None
    assert content["notes"] == [ONE_RECORDING]
    assert content["warnings"] == ["a warning"]
    assert content["agreement"]["bag"]["m"] == pytest.approx(
        {
            "largest_mm": 3.0,
            "median_mm": 2.0,
            "predictions": 2,
            "unpaired": 1,
            "where": "here",
        }
    )


def test_overlap_with_training_comes_before_other_warnings(runner):
    seen = next(r for r in runner.task.training["recordings"] if r["split"] == "train")
    result = BagResult(Evaluation(filled(), {"01": seen["sha256"]}), warnings=["a warning"])
    content = summarise(result, {"m": runner}, Settings())
    assert content["seen"] == {"m": {"train": ["01"], "validation": [], "calibration": []}}
    first, last = content["warnings"]
    assert first.startswith("m was trained on 01")
    assert last == "a warning"


def test_models_that_differ_only_in_their_seed_are_one_group(runner):
    table = ScoreTable()
    for model, error in (("a", 1.0), ("b", 3.0)):
        add(table, error, "01", model)
    result, runners = BagResult(Evaluation(table, {"01": ""})), {"a": runner, "b": runner}
    (group,) = summarise(result, runners, Settings(), same_recipe=True)["seeds"].values()
    assert group["models"] == ["a", "b"]
    assert group["all"]["ade"]["mean"] == pytest.approx(2.0)
    assert summarise(result, runners, Settings())["seeds"] == {}


def test_errors_over_another_horizon_are_not_compared(runner):
    table = ScoreTable()
    for model, step_s in (("long", 0.2), ("cv", 0.2), ("short", 0.1)):
        add(table, 1.0, "01", model, step_s=step_s)
    result = BagResult(Evaluation(table, {"01": ""}))
    content = summarise(result, {"long": runner, "short": runner}, Settings())
    assert content["relative"]["long"]["all"]["ade"]["value"] == 1.0
    assert content["relative"]["short"]["all"] == {}
    assert set(content["groups"]) == {"long"}
    assert [text for text in content["warnings"] if "ahead" in text] == [
        "short predicts 0.5 s ahead, the baselines 1 s: their errors cannot be compared, nor its "
        "errors with those of models that predict as far as the baselines"
    ]
    for table_of in (interval_table(content, "all"), result_tables(content)[0]):
        cells = {row.name: str(row.cells[-1]) for row in table_of.rows}
        assert cells["short"] == "-"
