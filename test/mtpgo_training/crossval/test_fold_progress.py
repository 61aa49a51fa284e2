# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a cross-validation says of its folds."""

import json

import pytest
from crossval_results import content, group
from tiny_run import CONFIG
from traffic import braking_cars

from mtpgo_core.errors import MtpgoError
from mtpgo_training.crossval.crossval_folder import CrossvalFolder
from mtpgo_training.crossval.fold import FoldJob
from mtpgo_training.crossval.fold_progress import FoldProgress
from mtpgo_training.crossval.site_folds import Fold, FoldSite
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.training.trial.schedule_plan import Budget

FOLD = Fold(
    "a", (FoldSite("a", ("a/01",)), FoldSite("still", ("s/01",)), FoldSite("short", ("t/01",)))
)
BUDGET = Budget(minutes=1.0)


@pytest.fixture
def folder(tmp_path):
    """A fold that is done: sites with and without what moves, and one without scores."""
    folder = CrossvalFolder(tmp_path / "out")
    recordings = [NamedRecording("a", braking_cars(tracks=1, seconds=1.0))]
    folder.start(CONFIG, [FOLD], recordings, BUDGET, 1.0, ("recorded",))
    fold = folder.fold("a")
    fold.path.mkdir(parents=True)
    sites = {"a": {"moving": group(1.0)}, "still": {"all": group(0.1)}, "short": {}}
    result = content(sites, folds={"a": ["a", "still", "short"]})
    fold.scores.write_text(json.dumps(result["folds"][0]))
    return folder


@pytest.mark.parametrize("quiet", [False, True])
def test_each_step_of_a_fold_is_said_and_its_results_are_written(folder, capsys, quiet):
    job = FoldJob(FOLD, CONFIG, (), None, folder.fold("a").path, BUDGET, 1.0)
    progress = FoldProgress(folder, "recorded", quiet=quiet)
    progress.started(job)
    progress.finished(job)
    progress.failed(job, MtpgoError("the loss is not finite"))
    printed = capsys.readouterr()
    lines = [
        f"a: leaves out a, still, short (3 recordings), see {folder.fold('a').log}",
        "a: 11 of 12 epochs in 6.0 min",
        "  a: moving ADE 1.000 m (CV 2.000)",
        "  still: nothing moves",
        "  short: nothing could be scored",
    ]
    assert printed.out.splitlines() == ([] if quiet else lines)
    assert printed.err == "mtpgo: without a: the loss is not finite\n"
    assert progress.failures == ["a"]
    assert json.loads(folder.result.read_text())["folds"][0]["fold"] == "a"
