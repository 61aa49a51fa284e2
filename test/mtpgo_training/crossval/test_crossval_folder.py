# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a cross-validation: what it refuses, and its results."""

import dataclasses
import json

import pytest
from crossval_results import content, group
from site_data import write_base
from tiny_run import CONFIG, with_options
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.crossval.crossval_folder import CrossvalFolder, read_results
from mtpgo_training.crossval.site_folds import Fold, FoldSite
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.training.trial.schedule_plan import Budget

RECORDINGS = [NamedRecording(s, braking_cars(tracks=1, seconds=1.0)) for s in ("a", "b")]
A, B = FoldSite("a", ("a/01",)), FoldSite("b/c", ("b/01",))
FOLDS = [Fold("a", (A,)), Fold("b/c", (B,))]


def start(path, config=CONFIG, *, folds=FOLDS, recordings=RECORDINGS, budget=None, stride_s=1.0):
    folder = CrossvalFolder(path)
    folder.start(config, folds, recordings, budget or Budget(minutes=1.0), stride_s, ("recorded",))
    return folder


def trained(folder, fold, *splits):
    """Write what a trained fold leaves: its run has seen these recordings."""
    files = folder.fold(fold.name)
    write_base(files.run, splits=list(splits))
    files.training.write_text("{}")


def test_the_same_again_continues(tmp_path):
    start(tmp_path / "out")
    start(tmp_path / "out", with_options(trainer={"patience_epochs": 3}))


@pytest.mark.parametrize(
    ("other", "sentence"),
    [
        ({"config": dataclasses.replace(CONFIG, seed=5)}, r"in seed \(1 there, 5 here\)"),
        ({"budget": Budget(minutes=2.0)}, "budget is .*2.0.* but .*1.0"),
        ({"stride_s": 2.0}, r"stride_s is 2.0, but 1.0 in"),
        ({"folds": FOLDS[:1]}, "the folds differ"),
        ({"folds": [Fold("a", (A,)), Fold("b/c", (FoldSite("b/c", ()),))]}, "the sites differ"),
        ({"recordings": RECORDINGS[:1]}, "the recordings differ"),
    ],
)
def test_another_configuration_is_refused(tmp_path, other, sentence):
    start(tmp_path)
    with pytest.raises(ConfigurationError, match=sentence):
        start(tmp_path, **other)


def test_a_folder_with_something_else_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ConfigurationError, match="which holds no cross-validation"):
        start(tmp_path)


def test_results_are_those_of_the_folds_that_are_done(tmp_path):
    folder = start(tmp_path / "out")
    assert folder.results()["folds"] == []
    with pytest.raises(ConfigurationError, match=r"no fold of .* is done"):
        read_results(tmp_path / "out")
    fold = folder.fold("b/c")
    assert fold.path.name == "b_c"
    fold.path.mkdir(parents=True)
    fold.scores.write_text(json.dumps(content({"b/c": {"all": group(1.0)}})["folds"][0]))
    assert fold.done
    result = folder.write_results()
    assert [one["fold"] for one in result["folds"]] == ["b/c"]
    assert result["mean_of_sites"]["recorded"]["all"]["ade"] == 1.0
    assert json.loads(folder.result.read_text()) == result == read_results(tmp_path / "out")
    assert "| b/c: all | 100 | 1.000 |" in folder.markdown.read_text()


def test_the_mean_is_over_the_sites_of_a_fold(tmp_path):
    folder = start(tmp_path / "out", folds=[Fold("both", (A, B)), Fold("c", ())])
    fold = folder.fold("both")
    fold.path.mkdir(parents=True)
    sites = {"a": {"moving": group(1.0)}, "b/c": {"moving": group(3.0, n=10_000)}}
    fold.scores.write_text(json.dumps(content(sites, folds={"both": ["a", "b/c"]})["folds"][0]))
    result = folder.results()
    assert result["left_out_together"] == {"both": ["a", "b/c"], "c": []}
    assert result["mean_of_sites"]["recorded"]["moving"]["ade"] == 2.0


def test_a_folder_of_an_earlier_version_is_one_sentence(tmp_path):
    folder = start(tmp_path / "out")
    facts = json.loads((folder.path / "crossval.json").read_text())
    del facts["folds"]
    (folder.path / "crossval.json").write_text(json.dumps(facts))
    for use in (read_results, start):
        with pytest.raises(ConfigurationError, match="of an earlier version, which has no scores"):
            use(folder.path)


def test_another_folder_has_no_results(tmp_path):
    with pytest.raises(ConfigurationError, match="holds no cross-validation"):
        read_results(tmp_path)


def test_the_runs_of_folds_are_those_that_left_out_the_same(tmp_path):
    folder = start(tmp_path / "out")
    with pytest.raises(ConfigurationError, match=r"no trained fold 'a'.*it has a, b/c"):
        folder.runs(FOLDS, RECORDINGS)
    for fold in FOLDS:
        trained(folder, fold)
    assert folder.runs(FOLDS, RECORDINGS) == {f.name: folder.fold(f.name).run for f in FOLDS}
    more = Fold("a", (A, B))
    with pytest.raises(ConfigurationError, match="fold 'a' was trained with b/01, expected one"):
        folder.runs([more], RECORDINGS)
    # One that leaves out a part of what a fold there left out begins with that one.
    assert folder.runs([Fold("b", (B,))], RECORDINGS) == {"b": folder.fold("b/c").run}
    with pytest.raises(ConfigurationError, match=r"no trained fold 'all'.* it has a, b/c"):
        folder.runs([Fold("all", (A, B))], RECORDINGS)


def test_a_run_has_seen_a_recording_under_whatever_name(tmp_path):
    """Also where only the weights that it began with have."""
    folder = start(tmp_path / "out")
    trained(folder, FOLDS[0], {"name": "07@0-60s", "sha256": "x", "split": "train"})

    def runs(source, sha256, name="01"):
        recording = dataclasses.replace(RECORDINGS[0].recording, name=name, sha256=sha256)
        item = NamedRecording(source, recording)
        return folder.runs([Fold("a", (FoldSite("a", (item.name,)),))], [item])

    assert runs("a", "y") == runs("copy", "y") == {"a": folder.fold("a").run}
    assert runs("copy", "x", "01@60-90s")
    for name in ("01", "01@30-90s"):
        with pytest.raises(ConfigurationError, match=f"was trained with copy/{name}, expected"):
            runs("copy", "x", name)


def test_two_folds_do_not_share_a_folder(tmp_path):
    folds = [Fold("b c", (A,)), Fold("b/c", (B,))]
    with pytest.raises(ConfigurationError, match="'b c' and 'b/c' would have the same folder, b_"):
        start(tmp_path / "out", folds=folds)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("file", "text", "sentence"),
    [
        ("scores.json", "", "scores.json is damaged, expected the scores of a fold"),
        ("scores.json", "{}", "it has no 'fold'"),
        ("scores.json", '{"fold": 1, "sites": 2, "training": 3}', "none that can be read"),
        ("../../crossval.json", "null", "crossval.json is damaged"),
        ("../../crossval.json", '{"folds": {}}', "holds no cross-validation that can be read"),
    ],
)
def test_damaged_results_are_named(tmp_path, file, text, sentence):
    folder = start(tmp_path / "out")
    fold = folder.fold("a")
    fold.path.mkdir(parents=True)
    (fold.path / file).write_text(text)
    sentence = sentence.replace("none that", "holds no cross-validation that")
    with pytest.raises(ConfigurationError, match=sentence):
        read_results(tmp_path / "out")
