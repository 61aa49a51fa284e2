# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Checkpoints that were edited or come from elsewhere: what is wrong, in one sentence."""

import copy

import pytest
import torch
from site_data import base_checkpoint

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.export.exporter import export_runs
from mtpgo_training.training.checkpoints.checkpoint_content import check_content
from mtpgo_training.training.run_folder import load_checkpoint, write_checkpoint

SCORES = {"model": {"all": {"ade": 0.5, "n": 3, "anll_kde": None}}}
ENTRY = {"name": "01", "sha256": "ab", "split": "train"}


def checked(**changes):
    check_content({**base_checkpoint(metrics=SCORES), **changes}, ConfigurationError)


@pytest.mark.parametrize("name", ["config", "average", "splits", "metrics", "epoch"])
def test_what_is_missing_is_named(name):
    content = base_checkpoint()
    del content[name]
    with pytest.raises(ConfigurationError, match=f"has no '{name}'"):
        check_content(content, ConfigurationError)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"model_config": "x"}, "has 'x' as 'model_config', expected a mapping"),
        ({"network": [1]}, r"has \[1\] as 'network', expected text"),
        ({"epoch": "x"}, "has 'x' as 'epoch', expected a whole number"),
        ({"step": True}, "has True as 'step', expected a whole number"),
        ({"average": [1, 2]}, r"has \[1, 2\] as 'average', expected a mapping"),
        ({"average": {"w": 3}}, "has 3 as 'average'.w, expected a tensor"),
        ({"model": {"w": torch.tensor([torch.inf])}}, "values in 'model'.w that are not finite"),
        ({"splits": {"a": 1}}, "as 'splits', expected a list"),
        ({"splits": [ENTRY, "a"]}, r"has 'a' as 'splits\[1\]', expected a mapping"),
        ({"splits": [{}]}, r"has None as 'splits\[0\].name', expected text"),
        ({"metrics": {"model": [1]}}, "as 'metrics.model', expected a mapping"),
        (
            {"metrics": {"model": {"all": {"ade": "x"}}}},
            "as 'metrics.model.all.ade', expected a",
        ),
        ({"calibration": 3}, "has 3 as 'calibration', expected a mapping"),
        ({"optimiser": "x" * 99}, "has 'x{39}... as 'optimiser', expected a mapping"),
    ],
)
def test_what_is_of_another_kind_is_named(changes, reason):
    with pytest.raises(ConfigurationError, match=reason):
        checked(**changes)


def test_a_checkpoint_as_it_is_written_passes():
    checked()
    checked(splits=[ENTRY], covariance_scale=1, adapted_from={}, state={})


def test_weights_that_are_no_numbers_are_refused_by_the_name_of_the_checkpoint(tmp_path):
    content = copy.deepcopy(base_checkpoint())
    next(v for v in content["average"].values() if v.is_floating_point()).fill_(torch.nan)
    write_checkpoint(tmp_path / "best.pt", content)
    sentence = r"best\.pt is no usable checkpoint: it has values in 'average'"
    with pytest.raises(ConfigurationError, match=sentence):
        load_checkpoint(tmp_path)
    with pytest.raises(ConfigurationError, match=sentence):
        export_runs([tmp_path], tmp_path / "m.pt")
