# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions written to a bag as the node does, and evaluated from it."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
from traffic import braking_cars

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.predictions import prediction_to_pointcloud2
from msg_adapters.registry import input_adapter
from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.model_runner import ModelRunner, find_model
from mtpgo_core.prediction.scene_predictor import ScenePredictor
from mtpgo_training.cli import main
from mtpgo_training.data.recording_bag import OBJECTS_TOPIC, write_recording
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.evaluation.bags.bag_evaluation import evaluate_bags, observed_recordings
from mtpgo_training.evaluation.bags.bag_predictions import match, read_predictions
from mtpgo_training.evaluation.bags.clock_alignment import find_parts

CLOUD = "sensor_msgs/msg/PointCloud2"
TOPIC = "/predictor/predictions"


@pytest.fixture(scope="module")
def runner():
    return ModelRunner.load(find_model("default"))


@pytest.fixture(scope="module")
def recording():
    return braking_cars(tracks=8, seconds=8.0)


def play(recording, runner, path, *, shift_ns=0, every=2, observations=True):
    """Run the node's steps in one process; every message is serialised as CDR and read back."""
    adapter, store = input_adapter("pointcloud2"), bag_typestore()
    predictor, history = ScenePredictor(runner), TrackHistory(runner.task.history)
    with McapWriter(path) as bag:
        if observations:
            bag.add_topic(OBJECTS_TOPIC, adapter.message_type)
        bag.add_topic(TOPIC, CLOUD)
        for i, states in enumerate(recording.states()):
            stamp_ns = states.stamp_ns + shift_ns
            message = adapter.from_states(
                dataclasses.replace(states, stamp_ns=stamp_ns), bag.types
            )
            wire = store.serialize_cdr(message, adapter.message_type)
            received = store.deserialize_cdr(wire, adapter.message_type)
            history.update(adapter.to_states(received))
            if observations:
                bag.write(OBJECTS_TOPIC, stamp_ns, received)
            if i % every == 0:
                prediction = predictor.predict(history.window(stamp_ns))
                bag.write(TOPIC, stamp_ns, prediction_to_pointcloud2(prediction, bag.types))
    return path


@pytest.fixture(scope="module")
def bag(recording, runner, tmp_path_factory):
    return play(recording, runner, tmp_path_factory.mktemp("bag") / "online")


def scores(result, name):
    return result.evaluation.scores.averages()[name]["all"]


@pytest.mark.parametrize("from_bag", [True, False])
def test_online_and_offline_agree_to_a_millimetre(bag, recording, runner, from_bag):
    truth = observed_recordings([bag]) if from_bag else {"01": recording}
    result = evaluate_bags([bag], truth, {"default": runner}, own_clock=not from_bag)
    online, offline = scores(result, "online"), scores(result, "default")
    assert online["n"] == offline["n"] > 200
    for key in ("ade", "fde", "apde", "min_ade", "min_fde"):
        assert online[key] == pytest.approx(offline[key], abs=1e-3)
    assert online["anll"] == pytest.approx(offline["anll"], abs=0.02)
    agreement = result.agreements["online"]["default"]
    assert agreement.unpaired == 0
    assert len(agreement.differences_m) >= online["n"]
    assert agreement.largest_m < 1e-3
    assert "road user" in agreement.text("online", "default")
    # The baselines are scored once.
    assert result.evaluation.scores.averages()["cv"]["all"]["n"] == online["n"]


def test_an_offset_of_centimetres_is_detected(bag, recording, runner):
    moved = dataclasses.replace(recording, position=recording.position + np.array([0.03, 0.0]))
    agreement = evaluate_bags([bag], {"01": moved}, {"default": runner}).agreements["online"]
    assert agreement["default"].largest_m == pytest.approx(0.03, abs=2e-3)


def test_a_bags_observations_determine_its_clock_offset(recording, runner, tmp_path):
    shift_ns = 3_040_000_000
    late = recording.between(2.0, None)  # the bag begins in the middle, on another clock
    bag = play(late, runner, tmp_path / "late", shift_ns=shift_ns, every=5)
    other = dataclasses.replace(
        braking_cars("02", tracks=8, seconds=8.0, seed=4), start_time_ns=recording.start_time_ns
    )
    (part,) = find_parts(list(observed_recordings([bag]).values()), {"02": other, "01": recording})
    assert (part.name, part.shift_ns) == ("01", shift_ns)
    result = evaluate_bags([bag], {"02": other, "01": recording}, {})
    assert list(result.evaluation.recordings) == ["01"]
    assert not result.warnings
    own = evaluate_bags([bag], observed_recordings([bag]), {}, own_clock=False)
    assert scores(result, "late")["ade"] == pytest.approx(scores(own, "late")["ade"], abs=1e-6)


def test_predictions_alone_are_matched_by_stamp_identity_and_place(recording, runner, tmp_path):
    bag = play(recording, runner, tmp_path / "alone", every=5, observations=False)
    far = dataclasses.replace(recording, position=recording.position + 500.0)
    predictions = read_predictions(bag)
    assert len(predictions) == 16
    matched = match(bag, predictions, {"far": far, "01": recording})
    assert list(matched.by_recording) == ["01"]
    assert matched.unmatched == 0
    with pytest.raises(RecordingError, match="the truth for recorded predictions"):
        observed_recordings([bag])


def test_predictions_of_no_recording_are_refused(bag, recording):
    later = dataclasses.replace(recording, start_time_ns=recording.start_time_ns + 10**12)
    predictions = read_predictions(bag)
    with pytest.raises(RecordingError, match=r"are of no road user of the recordings 01, "):
        match(bag, predictions, {"01": later})
    others = dataclasses.replace(recording, track_id=recording.track_id + 5000)
    with pytest.raises(RecordingError, match="expected the recordings that were played"):
        match(bag, predictions, {"01": others})


def test_a_played_recording_that_is_not_given_is_a_warning(bag, recording):
    early = recording.between(None, 4.0)
    result = evaluate_bags([bag], {"01": early}, {})
    assert any("are of no road user" in warning for warning in result.warnings)
    moved = dataclasses.replace(recording, position=recording.position + 1.0)
    result = evaluate_bags([bag], {"01": moved}, {})
    assert any("is in none of the recordings" in warning for warning in result.warnings)


def test_bags_without_predictions_are_refused(recording, tmp_path):
    path = tmp_path / "objects.mcap"
    with McapWriter(path) as bag:
        for _ in write_recording(bag, recording):
            pass
    with pytest.raises(RecordingError, match=r"has no predictions, it has /objects .*PointCloud2"):
        read_predictions(path)
    with pytest.raises(RecordingError, match="on the topic /elsewhere"):
        read_predictions(path, "/elsewhere")
    with pytest.raises(RecordingError, match="so it holds no predictions"):
        read_predictions(path, "/objects")
    with pytest.raises(RecordingError, match="does not exist"):
        read_predictions(tmp_path / "nowhere")
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(RecordingError, match="cannot be read as a bag"):
        read_predictions(path)


def test_two_bags_need_two_names(bag, recording):
    with pytest.raises(ConfigurationError, match="two sets of predictions are called online"):
        evaluate_bags([bag, bag], {"01": recording}, {})


def test_float32_messages_hold_a_millimetre_up_to_16_km(recording, runner, tmp_path):
    """Farther away the reported resolution is that of the messages."""
    for offset, name in ((15_000.0, "near"), (600_000.0, "utm")):
        moved = dataclasses.replace(
            recording, position=recording.position + np.array([offset, 0.0])
        )
        bag = play(moved.between(0.0, 3.0), runner, tmp_path / name, every=10)
        found = evaluate_bags([bag], {"01": moved}, {"default": runner}).agreements[name]
        agreement = found["default"]
        assert agreement.largest_m <= agreement.resolution_m + 1e-4
        assert agreement.largest_m > 0.1 * agreement.resolution_m
        assert (agreement.largest_m < 1e-3) == (name == "near")
    assert np.spacing(np.float32(16_000.0)) < 1e-3


def test_the_command_compares_several_bags_with_a_model(bag, recording, tmp_path, capsys):
    again = tmp_path / "again"
    shutil.copytree(bag, again)
    out, report = tmp_path / "scores.json", tmp_path / "report"
    arguments = ["evaluate", "--predictions", str(bag), str(again), "--model", "default"]
    write_ind(recording, tmp_path / "files")
    arguments += ["--data", str(tmp_path / "files"), "--layout", "ind"]
    assert main([*arguments, "--json", str(out), "--report", str(report)]) == 0
    content = json.loads(out.read_text())
    models = content["models"]
    assert list(models) == ["online", "default", "again", "cv", "ca", "ctrv"]
    assert models["online"] == models["again"]
    assert (
        models["cv"]["all"]["n"] == models["default"]["all"]["n"] == models["online"]["all"]["n"]
    )
    for found in content["agreement"].values():
        # Files round to a tenth of a millimetre, from which accelerations are estimated.
        assert found["default"]["largest_mm"] < 5.0
    assert "online and default, agent by agent" in capsys.readouterr().out
    assert "Recorded and offline predictions" in (report / "index.html").read_text()
    assert (report / "best_online.png").is_file()
