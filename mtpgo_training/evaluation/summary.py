# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The results of an evaluation as plain data: the content of ``mtpgo evaluate --json``."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from mtpgo_core.live_calibration.live_options import ONLINE, SHIPPED
from mtpgo_core.options import listed
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_training.evaluation.bags.bag_evaluation import PROTOCOL, BagResult
from mtpgo_training.evaluation.evaluator import Evaluation, Settings
from mtpgo_training.evaluation.honesty.honesty_summary import honesty_summary
from mtpgo_training.evaluation.honesty.simple_comparison import compare_with_simple
from mtpgo_training.evaluation.scores.bootstrap import over_groups, seed_groups
from mtpgo_training.evaluation.scores.score_summary import (
    REFERENCE,
    breakdowns,
    other_horizons,
)
from mtpgo_training.evaluation.scores.score_table import ScoreTable
from mtpgo_training.evaluation.training_overlap import overlap_by_model, overlap_warnings
from mtpgo_training.scenes.kinematic_baselines import BASELINES
from mtpgo_training.scenes.tracker.tracker_config import RECORDED, SIMULATED

Json = dict[str, Any]

ONE_RECORDING = (
    "no intervals over recordings can be given for a single recording: its road users share its "
    "traffic"
)


def summarise(
    result: BagResult,
    runners: Mapping[str, ModelRunner],
    settings: Settings,
    *,
    layouts: Collection[str] = (),
    from_bags: bool = False,
    same_recipe: bool = False,
) -> Json:
    """Return the content of ``--json``, from which the tables and the report are made.

    Args:
        result: of the evaluation.
        runners: the models by name.
        settings: what was scored.
        layouts: of the recordings.
        from_bags: the instants are those of recorded predictions.
        same_recipe: the models differ only in their seed.
    """
    evaluation = result.evaluation
    averages = evaluation.scores.averages()
    trainings = {name: runner.task.training for name, runner in runners.items()}
    overlaps = overlap_by_model(trainings, evaluation.recordings)
    agents = evaluation.scores.agents()
    comparable = ~agents["model"].isin(list(other_horizons(evaluation.scores)))
    groups = seed_groups(list(runners), same_recipe and len(runners) > 1)
    return {
        "models": averages,
        **breakdowns(evaluation.scores),
        "honesty": honesty_summary(evaluation.honesty),
        "groups": compare_with_simple(agents[comparable]),
        "seeds": over_groups(averages, groups),
        "agreement": {
            bag: {model: found.to_dict() for model, found in found_by.items()}
            for bag, found_by in result.agreements.items()
        },
        "live": result.live,
        "published": result.published,
        "calibration_effect": effect_of_calibration(evaluation),
        "recordings": evaluation.recordings,
        "failed": {failure.name: failure.reason for failure in result.failures},
        "seen": overlaps,
        "warnings": [
            *overlap_warnings(overlaps),
            *_horizon_warnings(evaluation.scores),
            *_lane_warnings(evaluation.laneless),
            *result.warnings,
        ],
        "notes": [ONE_RECORDING] if len(evaluation.recordings) < 2 else [],
        "layout": sorted(set(layouts)),
        "stride_s": None if from_bags else settings.stride_s,
        "min_future_s": settings.min_future_s,
        "policy": settings.policy,
        "one_sample": settings.one_sample,
        "trails": None if from_bags else settings.trails,
        "lanes": None if from_bags else settings.lanes,
        "calibration": None if from_bags else settings.calibration,
        "prefer": None if from_bags else settings.prefer,
        "correct_paths": None if from_bags else settings.correct_paths,
        "tracker": RECORDED if settings.tracker_seed is None else SIMULATED,
        "tracker_seed": settings.tracker_seed,
        "unknown_classes": settings.unknown_classes,
        "kde_samples": settings.kde_samples,
        "path_smoothing_s": None if from_bags else settings.path_smoothing_s,
        "baselines": list(BASELINES),
        "tasks": {name: dataclasses.asdict(r.task.scene) for name, r in runners.items()},
        "weights": {name: r.task.weights_sha256 for name, r in runners.items()},
    }


def _horizon_warnings(scores: ScoreTable) -> list[str]:
    """Return a sentence for each model whose errors are not of the horizon of the baselines'."""
    own_s = scores.horizons().get(REFERENCE)
    return [
        f"{model} predicts {time_s:g} s ahead, the baselines {own_s:g} s: their errors cannot be "
        "compared, nor its errors with those of models that predict as far as the baselines"
        for model, time_s in other_horizons(scores).items()
    ]


def _lane_warnings(laneless: Mapping[str, Sequence[str]]) -> list[str]:
    """Return a sentence for each model that could have followed lanes."""
    return [
        f"{model} follows lanes, and none are known of {listed(sorted(set(names)))}: it is scored "
        "without them there (--lane-file gives them)"
        for model, names in laneless.items()
    ]


def effect_of_calibration(evaluation: Evaluation) -> Json:
    """Return the averages of each model with both calibrations, empty without the online one.

    Both are of the same predictions: of several bags, some may be published without the online
    calibration, whose predictions are in neither.

    Args:
        evaluation: of recordings, or of models at the instants of bags.
    """
    shipped = evaluation.shipped.averages()
    return {
        f"{model}, {calibration}": found[PROTOCOL]
        for model, online in evaluation.online.averages().items()
        for calibration, found in ((SHIPPED, shipped[model]), (ONLINE, online))
    }
