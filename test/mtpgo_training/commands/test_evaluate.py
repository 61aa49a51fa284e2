# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command `mtpgo evaluate` from files to tables, JSON and report."""

import json
import re
import shutil

import numpy as np
import pytest
from tiny_run import CONFIG, new_run
from traffic import braking_cars

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.resources import find_resource
from mtpgo_core.task.model_file import find_model
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.cli import main
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.evaluation.evaluator import evaluate
from mtpgo_training.evaluation.scores.agent_scores import KEYS
from mtpgo_training.evaluation.scores.score_table import HEADLINE_TIMES_S
from mtpgo_training.export.exporter import export_model

HIGHWAY = find_resource("recordings", "highway")
STRIDE = ["--stride", "1.0", "--quiet"]


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Two folders of recordings, the second with one of another kind of traffic."""
    root = tmp_path_factory.mktemp("data")
    for folder, name, seed in (("a", "01", 0), ("a", "02", 1), ("b", "01", 2)):
        write_ind(braking_cars(name, tracks=6, seconds=8.0, seed=seed), root / folder)
    return root


@pytest.fixture(scope="module")
def results(data, tmp_path_factory):
    """The folder with the JSON file and the report of one run."""
    out = tmp_path_factory.mktemp("out")
    arguments = ["evaluate", "--model", "default", "--data", str(data / "a"), "--layout", "ind"]
    arguments += ["--data", str(data / "b"), "--layout", "ind", *STRIDE]
    arguments += ["--json", str(out / "scores.json"), "--report", str(out / "report")]
    assert main(arguments) == 0
    return out


@pytest.fixture(scope="module")
def content(results):
    return json.loads((results / "scores.json").read_text())


def test_the_json_has_the_documented_content(content):
    assert list(content["models"]) == ["default", "cv", "ca", "ctrv"]
    for protocols in content["models"].values():
        assert set(protocols) == {"all", "centre"}
        for scores in protocols.values():
            assert set(scores) == {*KEYS, *HEADLINE_TIMES_S, "n", "n_final"}
            assert isinstance(scores["n"], int)
            assert scores["n"] > 0
    assert content["models"]["ca"]["all"]["anll"] is None
    assert set(content["recordings"]) == {"a/01", "a/02", "b/01"}
    for key in ("intervals", "relative", "by_class", "by_manoeuvre", "by_horizon", "reliability"):
        assert set(content[key]) == {"default", "cv", "ca", "ctrv"}
    low, high = content["intervals"]["default"]["all"]["ade"]
    assert low <= content["models"]["default"]["all"]["ade"] <= high
    assert "lane_keep" in content["by_manoeuvre"]["default"]["all"]
    assert len(content["by_horizon"]["default"]["centre"]["nees"]) == 25
    assert content["warnings"] == content["notes"] == []
    honesty = content["honesty"]["default"]["all"]
    assert honesty["all"]["n"] == content["models"]["default"]["all"]["n"]
    headline = content["models"]["default"]["all"]["coverage_90_moving_5s"]
    assert honesty["by_motion"]["moving"]["ellipse_90"][2] == pytest.approx(headline)
    assert honesty["all"]["consistency"]["cycle_s"] == pytest.approx(1.0)
    # Both folders have the same locationId.
    sites = {name.rsplit(", ", 1)[0] for name in honesty["by_site_and_motion"]}
    assert sites == {"a/test", "b/test"}
    assert set(content["groups"]) == {"default"}
    effect = content["calibration_effect"]
    assert effect["default, shipped"] == content["models"]["default"]["all"]
    assert effect["default, online"]["n"] == effect["default, shipped"]["n"]
    assert effect["default, online"]["anll"] != effect["default, shipped"]["anll"]


@pytest.mark.parametrize(("stride", "taken"), [("1.55", "1.6 s (01 and 1 more)"), ("1.6", "")])
def test_a_stride_that_is_no_whole_number_of_frames_is_told(data, capsys, stride, taken):
    words = ["evaluate", "--model", "default", "--data", str(data / "a"), "--layout", "ind"]
    words.append("--no-centre")
    assert main([*words, "--stride", stride, "--quiet"]) == 0
    error = capsys.readouterr().err
    told = f"mtpgo: warning: --stride is {stride} s, which is no whole number of frames"
    assert (told in error) == bool(taken)
    assert f"instants are scored every {taken}" in error or not taken


def test_the_library_gives_the_same_averages(content, data):
    runner = ModelRunner.load(find_model("default"))
    recordings = [r for f in ("a", "b") for r in load_recordings(data / f, "ind")]
    scores = evaluate({"default": runner}, recordings, stride_s=1.0)
    for protocol in ("all", "centre"):
        for key in KEYS:
            found, expected = scores["default"][protocol][key], content["models"]["default"]
            if key.endswith("_kde"):  # not asked for
                assert found is expected[protocol][key] is None
            else:
                assert found == pytest.approx(expected[protocol][key], rel=1e-5)


def test_the_page_is_complete_and_needs_nothing_from_outside(results):
    report = results / "report"
    text = (report / "index.html").read_text()
    assert not re.search(r'(src|href)="(?!data:)', text)
    assert "url(" not in text
    assert "@import" not in text
    for heading in ("all agents", "centre of its graph", "By manoeuvre", "By recording"):
        assert heading in text
    folded = re.findall(r"<details><summary>(.*)</summary>", text)
    assert len(folded) == 6
    assert "Weights of the modes by class and motion" in folded
    pictures = {path.name for path in report.glob("*.png")}
    assert {"horizon.png", "reliability.png", "nees.png", "manoeuvres.png"} <= pictures
    assert {"coverage.png", "spread.png", "weights.png"} <= pictures
    assert "worst_default.png" in pictures
    assert text.count("data:image/png;base64,") == len(pictures)
    for path in report.glob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG")
    assert "b/01" in text


def test_the_table_of_a_card_is_made_from_the_json(results, content, capsys):
    path = str(results / "scores.json")
    assert main(["evaluate", "--results", path, path]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("| data | protocol | model | ADE m |")
    assert lines[1].startswith("| --- | ")
    assert len(lines) == 2 + 2 * 8
    scores = content["models"]["default"]["all"]
    low, high = content["intervals"]["default"]["all"]["ade"]
    cell = f"| scores | all | default | {scores['ade']:.2f} ({low:.2f} to {high:.2f}) |"
    assert lines[2].startswith(cell)
    assert lines[2].endswith(f"| {scores['n']} |")


def run(data, *more):
    return main(["evaluate", "--data", str(data), "--layout", "ind", *STRIDE, *map(str, more)])


def test_seeds_of_one_recipe_are_grouped(data, tmp_path, capsys):
    files = [tmp_path / f"recipe-seed{i}.pt" for i in (1, 2)]
    for path in files:
        shutil.copy(find_model("default"), path)
    out = tmp_path / "scores.json"
    assert run(data / "a", "--model", *files, "--no-centre", "--json", out) == 0
    content = json.loads(out.read_text())
    assert list(content["models"])[:2] == ["recipe-seed1", "recipe-seed2"]
    ade = content["models"]["recipe-seed1"]["all"]["ade"]
    seeds = content["seeds"]["recipe"]
    assert seeds["all"]["ade"] == pytest.approx({"mean": ade, "low": ade, "high": ade})
    assert "recipe, 2 seeds, all: ade" in capsys.readouterr().out


def test_several_processes_give_the_same(data, content, tmp_path):
    out = tmp_path / "scores.json"
    folders = [x for f in ("a", "b") for x in ("--data", str(data / f), "--layout", "ind")]
    arguments = ["--model", "default", *folders, *STRIDE, "--jobs", "2", "--json", str(out)]
    assert main(["evaluate", *arguments]) == 0
    assert json.loads(out.read_text()) == content


def test_a_simulated_tracker_observes_the_recordings(data, content, tmp_path, capsys):
    out = tmp_path / "scores.json"
    tracker = ["--tracker", "simulated", "--tracker-seed", "3", "--no-centre"]
    assert run(data / "b", "--model", "default", *tracker, "--json", out) == 0
    assert "observed by a simulated tracker, seed 3" in capsys.readouterr().out
    alone = json.loads(out.read_text())
    assert (alone["tracker"], alone["tracker_seed"]) == ("simulated", 3)
    assert (content["tracker"], content["tracker_seed"]) == ("recorded", None)
    own, full = alone["by_recording"], content["by_recording"]
    assert own["cv"]["all"]["01"]["ade"] != full["cv"]["all"]["b/01"]["ade"]


def test_classes_are_hidden_from_the_models(data, content, tmp_path, capsys):
    out, report = tmp_path / "scores.json", tmp_path / "report"
    hidden = ["--unknown-classes", "--no-centre", "--json", out, "--report", report]
    assert run(data / "b", "--model", "default", *hidden) == 0
    sentence = "every road user observed as one of an unknown class"
    assert sentence in capsys.readouterr().out
    assert "observed as one of an unknown class" in (report / "index.html").read_text()
    alone = json.loads(out.read_text())
    assert (alone["unknown_classes"], content["unknown_classes"]) == (True, False)
    assert set(alone["by_class"]["default"]["all"]) == {"car"}
    own, full = alone["by_recording"], content["by_recording"]
    assert own["cv"]["all"]["01"] == full["cv"]["all"]["b/01"]
    assert own["default"]["all"]["01"]["ade"] != full["default"]["all"]["b/01"]["ade"]


def test_the_calibration_goes_on_over_each_recording_or_is_taken_off(
    data, content, tmp_path, capsys
):
    found = {"shipped": content["by_recording"]["default"]["all"]["b/01"]}
    reliability = {}
    for calibration in ("off", "online"):
        out = tmp_path / f"{calibration}.json"
        given = ["--model", "default", "--no-centre", "--calibration", calibration]
        assert run(data / "b", *given, "--json", out) == 0
        assert f"calibration {calibration}, prefer model" in capsys.readouterr().out
        result = json.loads(out.read_text())
        assert (result["calibration"], result["prefer"]) == (calibration, "model")
        found[calibration] = result["by_recording"]["default"]["all"]["01"]
        reliability[calibration] = result["reliability"]["default"]["all"]["observed"]
        assert result["calibration_effect"] == {}
    assert (content["calibration"], content["prefer"]) == ("shipped", "model")
    shipped = found["shipped"]["ade"]
    assert found["off"]["ade"] == pytest.approx(shipped)
    assert found["online"]["ade"] != shipped  # paths are corrected, too
    assert found["online"]["ade"] == pytest.approx(shipped, rel=0.01)
    assert len({scores["anll"] for scores in found.values()}) == 3
    assert reliability["off"] != reliability["online"]


def test_the_online_calibration_leaves_paths_alone_if_asked(data, content, tmp_path, capsys):
    out = tmp_path / "scores.json"
    given = ["--model", "default", "--no-centre", "--no-correct-paths", "--json", out]
    assert run(data / "b", *given, "--calibration", "online") == 0
    assert "corrects covariances alone" in capsys.readouterr().out
    result = json.loads(out.read_text())
    shipped = content["by_recording"]["default"]["all"]["b/01"]
    found = result["by_recording"]["default"]["all"]["01"]
    assert result["correct_paths"] is False
    assert found["ade"] == pytest.approx(shipped["ade"])
    assert found["anll"] != shipped["anll"]
    assert run(data / "b", *given, "--calibration", "shipped") == 2
    assert "--calibration shipped, by which no path is corrected" in capsys.readouterr().err


def test_smoothed_paths_jump_less(data, tmp_path, capsys):
    """Of a noisy tracker; where tracks are clean there is little to smooth."""
    jump = {}
    for smoothing_s in (0.0, 0.4):
        out = tmp_path / "scores.json"
        given = ["--model", "default", "--stride", "0.2", "--path-smoothing", smoothing_s]
        given += ["--tracker", "simulated"]
        assert run(data / "b", "--no-centre", *given, "--json", out) == 0
        said = "paths smoothed with a memory of 0.4 s" in capsys.readouterr().out
        assert said == (smoothing_s > 0.0)
        result = json.loads(out.read_text())
        assert result["path_smoothing_s"] == smoothing_s
        jump[smoothing_s] = result["honesty"]["default"]["all"]["all"]["consistency"]["jump"]
    assert jump[0.4] < 0.95 * jump[0.0]


def test_one_sample_forgets_the_past(data, content, tmp_path):
    out = tmp_path / "scores.json"
    assert run(data / "b", "--model", "default", "--no-centre", "--one-sample", "--json", out) == 0
    alone = json.loads(out.read_text())
    assert alone["one_sample"]
    models, before = (c["by_recording"] for c in (alone, content))
    own, full = (m["default"]["all"][n] for m, n in ((models, "01"), (before, "b/01")))
    assert own["n"] == full["n"]
    assert own["ade"] > full["ade"]
    # The velocity is in the message, the acceleration would need a past.
    rows = models["ca"]["all"]["01"], models["cv"]["all"]["01"]
    assert rows[0]["ade"] == pytest.approx(rows[1]["ade"])


def test_without_trails_a_model_that_sees_them_predicts_otherwise(tmp_path):
    """Vehicles of the motorway follow one another."""
    out, scores = tmp_path / "scores.json", {}
    command = ["evaluate", "--data", str(HIGHWAY), "--layout", "highd", "--model", "default"]
    command += ["--stride", "4", "--no-centre", "--quiet", "--json", str(out)]
    for hidden in (False, True):
        assert main([*command, *(["--without-trails"] if hidden else [])]) == 0
        content = json.loads(out.read_text())
        assert content["trails"] is not hidden
        scores[hidden] = content["by_since_start"]
    with_trails, without = (scores[hidden]["default"]["all"] for hidden in (False, True))
    late = "moving, 20-60 s"
    assert with_trails[late]["n"] == without[late]["n"] > 20
    assert with_trails[late]["ade"] != without[late]["ade"]
    assert scores[True]["cv"] == scores[False]["cv"]


@pytest.mark.parametrize("hidden", [False, True])
def test_recordings_without_lanes_are_scored_by_a_model_that_follows_lanes(hidden, data, capsys):
    """As the node runs it there: ``mtpgo demo --model road`` scores such a bag."""
    options = ["--without-lanes"] if hidden else []
    assert run(data / "b", "--model", "road", *options) == 0
    printed = capsys.readouterr()
    warned = "road follows lanes, and none are known of" in printed.err
    assert warned is not hidden
    assert ("models with scene.lane_ways see none" in printed.out) is hidden


def test_without_lanes_a_model_that_follows_them_predicts_otherwise(tmp_path):
    out, scores = tmp_path / "scores.json", []
    command = ["evaluate", "--data", str(HIGHWAY), "--layout", "highd", "--model", "road"]
    command += ["--stride", "4", "--no-centre", "--quiet", "--json", str(out)]
    for hidden in (False, True):
        assert main([*command, *(["--without-lanes"] if hidden else [])]) == 0
        content = json.loads(out.read_text())
        assert content["lanes"] is not hidden
        scores.append(content["models"]["road"]["all"]["ade"])
    assert scores[0] != scores[1]


def test_without_lanes_is_refused_where_no_model_follows_any(data, capsys):
    assert run(data / "b", "--model", "default", "--without-lanes") == 2
    assert "given with default, which do not follow lanes" in capsys.readouterr().err


def test_without_trails_is_refused_where_no_model_sees_any(data, tmp_path, capsys):
    task = TaskDescription(name="blind", modes=2, horizon_steps=5, scene=CONFIG.scene)
    export_model(new_run().model, task, tmp_path / "blind.pt")
    assert run(data / "b", "--model", tmp_path / "blind.pt", "--without-trails") == 2
    assert "given with blind, which do not see trails" in capsys.readouterr().err


def test_a_model_with_the_name_of_a_baseline_is_refused(data, tmp_path, capsys):
    files = [tmp_path / "cv.pt", tmp_path / "x.pt"]
    for path in files:
        shutil.copy(find_model("default"), path)
    assert run(data / "b", "--model", *files) == 2
    assert "a model is called cv" in capsys.readouterr().err


def test_one_recording_has_no_interval_and_says_so(data, capsys):
    assert run(data / "b", "--model", "default", "--no-centre") == 0
    text = capsys.readouterr().out
    assert "Note: no intervals over recordings can be given" in text
    assert "95 % interval" not in text
    assert re.search(r"NEES \(mixture\), 2 is right +1 s +3 s +5 s\ndefault +[0-9.]+ \(", text)
    assert re.search(r"ADE m +lane keep \(\d+\)", text)


def test_the_warning_is_in_all_outputs(data, tmp_path, capsys, monkeypatch):
    known = ModelRunner.load(find_model("default"))
    sha256 = load_recordings(data / "b", "ind")[0].sha256
    known.task.training["recordings"].append({"sha256": sha256, "split": "train"})
    monkeypatch.setattr(ModelRunner, "load", classmethod(lambda cls, path: known))
    out, report = tmp_path / "scores.json", tmp_path / "report"
    assert run(data / "b", "--model", "default", "--json", out, "--report", report) == 0
    sentence = "default was trained on 01: its results include what it has memorised"
    assert f"mtpgo: warning: {sentence}" in capsys.readouterr().err
    assert json.loads(out.read_text())["warnings"] == [sentence]
    assert sentence in (report / "index.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "neither --model nor --predictions is given"),
        (["--model", "default"], "--model is given without --data"),
        (["--model", "default", "--layout", "ind"], "--layout is given without --data"),
        (["--model", "default", "--data", "DATA"], "layout of .* is not given, expected --layout"),
        (["--model", "nobody", "--data", "DATA", "--layout", "ind"], "'nobody' is neither a file"),
        (["--model", "default", "--data", "DATA", "--layout", "x"], "layout 'x' is unknown"),
        (["--model", "default", "--data", "NONE", "--layout", "ind"], "does not exist"),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--recordings", "77"],
            "'77'",
        ),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--data", "DATA"],
            "the recording a/01 is given twice, expected directories whose last parts differ",
        ),
        (
            ["--model", "default", "default", "--data", "DATA", "--layout", "ind"],
            "each model once",
        ),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--report", "FILE"],
            "--report .* is a file, expected a folder",
        ),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--report", "FILE/x"],
            "cannot be written",
        ),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--json", "FILE/x"],
            "cannot be written",
        ),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--stride", "0"],
            "--stride is 0.0",
        ),
        (
            ["--model", "default", "--data", "SHORT", "--layout", "ind"],
            "nothing could be scored",
        ),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--kde-samples", "1"],
            "--kde-samples is 1, expected 0, or 10 to 100000 samples",
        ),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--min-future", "-1"],
            "--min-future is -1.0",
        ),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--policy", "ego"],
            "a recording has no ego",
        ),
        (["--predictions", "NONE"], "does not exist, expected a bag"),
        (["--predictions", "FILE"], "FILE"),
        (["--predictions", "NONE", "--one-sample"], "--one-sample is given with --predictions"),
        (["--predictions", "NONE", "--tracker", "simulated"], "--tracker simulated is given with"),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--tracker-seed", "1"],
            "--tracker-seed is given without --tracker simulated",
        ),
        (["--predictions", "NONE", "--calibration", "off"], "--calibration is given with --pred"),
        (["--predictions", "NONE", "--prefer", "best"], "--prefer is given with --predictions"),
        (
            ["--model=default", "--data", "DATA", "--one-sample", "--calibration=online"],
            "--one-sample is given with --calibration online or --prefer best",
        ),
        (
            ["--model=default", "--data", "DATA", "--one-sample", "--path-smoothing=0.4"],
            "--one-sample is given with --path-smoothing, which needs a past",
        ),
        (
            ["--model=default", "--data", "DATA", "--path-smoothing=0.4", "--stride=2"],
            "--path-smoothing is given with --stride 2, expected at most 1 s",
        ),
        (
            ["--model=default", "--data", "DATA", "--path-smoothing", "-1"],
            "--path-smoothing is -1, expected 0 to 5 s",
        ),
        (
            ["--predictions", "NONE", "--path-smoothing", "0.4"],
            "--path-smoothing is given with --predictions, which are scored as the node published",
        ),
        (
            ["--predictions", "NONE", "--unknown-classes"],
            "--unknown-classes is given with --predictions, whose classes were those that",
        ),
        (
            ["--results", "FILE", "--unknown-classes"],
            "--unknown-classes is given with --results, which are of earlier evaluations",
        ),
        (["--predictions", "NONE", "--policy", "each"], "--policy is given with --predictions"),
        (["--model", "default", "--data", "DATA", "--layout", "ind", "--topic", "/x"], "--topic"),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--jobs", "0"],
            "--jobs is 0",
        ),
        (
            ["--predictions", "NONE", "--stride", "1"],
            "--stride is given with --predictions, all of which are scored as the node published",
        ),
        (["--predictions", "NONE", "--no-centre"], "--no-centre is given with --predictions"),
        (
            ["--model", "default", "--data", "DATA", "--layout", "ind", "--seeds"],
            r"--seeds is given with 1 model\(s\), expected several of one recipe",
        ),
        (
            ["--results", "FILE", "--stride", "1"],
            "--stride is given with --results, which are of earlier evaluations",
        ),
        (["--results", "FILE", "--kde-samples", "200"], "--kde-samples is given with --results"),
        (["--results", "FILE"], "holds no results, expected a file of"),
        (["--results", "NONE"], "cannot be read"),
        (["--results", "OTHER"], "holds no results"),
        (["--results", "OTHER", "--model", "default"], "--results is given with --model"),
    ],
)
def test_bad_input_is_one_sentence(arguments, sentence, data, tmp_path, capsys):
    places = {"DATA": data / "a", "NONE": tmp_path / "none", "FILE": tmp_path / "FILE"}
    places |= {"OTHER": tmp_path / "other.json", "SHORT": tmp_path / "short"}
    places["FILE"].write_text("text")
    places["OTHER"].write_text("{}")
    if "SHORT" in arguments:
        write_ind(braking_cars("01", tracks=3).between(0.0, 0.0), places["SHORT"])
    given = [
        re.sub("DATA|NONE|FILE|OTHER|SHORT", lambda m: str(places[m[0]]), a) for a in arguments
    ]
    own = {"--results", "--predictions", "--stride"} & set(given)
    quiet = [] if own else STRIDE[:2]
    assert main(["evaluate", *quiet, *given]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.splitlines()
    assert len(lines) == 1
    assert re.search(sentence, lines[0])


def test_a_recording_without_a_future_leaves_the_rest(data, tmp_path):
    write_ind(braking_cars("09", tracks=3).between(0.0, 0.2), tmp_path)
    for path in (data / "a").glob("01_*"):
        shutil.copy(path, tmp_path / path.name)
    out = tmp_path / "out.json"
    assert run(tmp_path, "--model", "default", "--no-centre", "--json", out) == 0
    rows = json.loads(out.read_text())["by_recording"]["default"]["all"]
    assert rows["01"]["n"] > 0
    assert np.isfinite(rows["01"]["ade"])


def test_a_recording_that_fails_is_named_and_the_others_are_kept(data, tmp_path, capsys):
    folder, out = tmp_path / "data", tmp_path / "scores.json"
    shutil.copytree(data / "a", folder)
    (folder / "02_tracksMeta.csv").write_text("nothing")
    arguments = ["--model", "default", "--no-centre", "--json", out, "--resume", tmp_path / "done"]
    assert run(folder, *arguments) == 1
    error = capsys.readouterr().err
    assert "1 of 2 could not be read or scored:\n  02: " in error
    content = json.loads(out.read_text())
    assert list(content["recordings"]) == ["01"]
    assert list(content["failed"]) == ["02"]
    assert run(folder, *arguments) == 1
    assert json.loads(out.read_text()) == content
