# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The best of several runs, by the validation ADE in their checkpoints."""

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.export.run_selection import select_run
from mtpgo_training.training.run_folder import RunFolder

WEIGHTS = {"model_config": {}, "average": {}, "epoch": 1, "step": 1}
"""What every checkpoint has besides; a selection does not look at it."""


@pytest.fixture
def make_run(tmp_path):
    """Write a run with an ADE, or without a validation, validated on recordings by hash."""

    def make(seed, ade, steps=25, **validated):
        folder = RunFolder(tmp_path / f"seed{seed}")
        splits = [{"name": "01", "sha256": f"{seed}", "split": "train"}]
        splits += [
            {"name": name, "sha256": sha256, "split": "validation"}
            for name, sha256 in validated.items()
        ]
        metrics = {} if ade is None else {"model": {"all": {"ade": ade}}}
        content = {"config": {"seed": seed}, "metrics": metrics, "splits": splits}
        config = {"model_config": {"horizon_steps": steps, "dt_s": 0.2}}
        folder.save({**WEIGHTS, **content, **config}, best=True)
        return folder.path

    return make


def test_the_smallest_ade_is_selected_and_all_are_returned_in_order(make_run):
    paths = [make_run(seed, ade, a="1", b="2") for seed, ade in ((1, 0.5), (2, 0.4), (3, 0.6))]
    best, candidates = select_run(paths)
    assert best.path == paths[1]
    assert [(c.path, c.seed, c.ade_m) for c in candidates] == [
        (paths[0], 1, 0.5),
        (paths[1], 2, 0.4),
        (paths[2], 3, 0.6),
    ]
    assert best.validated_on == {("a", "1"), ("b", "2")}


def test_of_equal_runs_the_first_given_is_selected(make_run):
    paths = [make_run(seed, 0.5, a="1") for seed in (3, 1, 2)]
    assert select_run(paths)[0].seed == 3


def test_a_single_run_need_not_have_been_validated(make_run):
    path = make_run(1, None)
    best, candidates = select_run([path])
    assert (best.path, candidates) == (path, [best])


def test_recordings_of_the_same_name_but_other_content_are_not_compared(make_run):
    paths = [make_run(1, 0.5, a="1"), make_run(2, 0.4, a="2")]
    with pytest.raises(ConfigurationError, match=r"seed2 was validated on a and .*seed1 on a,"):
        select_run(paths)
    paths = [make_run(3, 0.5), make_run(4, 0.4, b="1", a="2")]
    with pytest.raises(ConfigurationError, match=r"seed4 was validated on a, b and .* on nothing"):
        select_run(paths)


def test_errors_over_different_horizons_are_not_compared(make_run):
    paths = [make_run(1, 0.5, a="1"), make_run(2, 0.1, a="1", steps=5)]
    sentence = r"seed2 predicts 5 steps of 0.2 s and .*seed1 25 steps of 0.2 s, expected the same"
    with pytest.raises(ConfigurationError, match=sentence):
        select_run(paths)


def test_the_best_checkpoint_of_a_folder_is_read_or_a_file(make_run, tmp_path):
    path = make_run(1, 0.5, a="1")
    content = {"config": {"seed": 9}, "metrics": {}, "splits": []}
    RunFolder(path).save({**WEIGHTS, **content}, best=False)
    assert select_run([path])[0].seed == 1
    assert select_run([RunFolder(path).last])[0].seed == 9
