# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recorded predictions and models, scored at the same instants."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction
from driven_bags import driven_past
from recorded_bags import play

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.predictions import prediction_from_pointcloud2, prediction_to_pointcloud2
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.schema import CalibrationStage, Source
from mtpgo_training.cli import main
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.evaluation.bags.bag_evaluation import evaluate_bags, observed_recordings
from mtpgo_training.evaluation.honesty.honesty_summary import honesty_summary
from mtpgo_training.evaluation.summary import effect_of_calibration


def scores(result, name):
    return result.evaluation.scores.averages()[name]["all"]


def written(path, recording, published, passes_ns=(0,)):
    """Write a bag of a recording's objects and of the predictions published on its instants.

    Args:
        path: of the bag.
        recording: what is observed, once for each pass.
        published: returns the predictions of an instant by its number.
        passes_ns: what is added to the stamps of each pass (ns).
    """
    adapter = INPUTS["pointcloud2"]
    with McapWriter(path) as out:
        out.add_topic("/objects", adapter.message_type)
        out.add_topic("/predictions", "sensor_msgs/msg/PointCloud2")
        for later_ns in passes_ns:
            for number, states in enumerate(recording.states()):
                now = dataclasses.replace(states, stamp_ns=states.stamp_ns + later_ns)
                out.write("/objects", now.stamp_ns, adapter.from_states(now, out.types))
                for one in published(number):
                    one = dataclasses.replace(one, stamp_ns=now.stamp_ns)
                    message = prediction_to_pointcloud2(one, out.types)
                    out.write("/predictions", now.stamp_ns, message)
    return path


def test_recorded_paths_begin_where_the_road_users_were(tmp_path):
    """Recorded predictions do not say it. Here all of them lead back, and meet halfway."""
    recording = make_recording(duration_s=8.0)

    def published(number):
        if number > 10:
            return ()
        one = perfect_prediction(recording, number)
        start = one.initial[:, None, None, :2]
        back = 2.0 * start - one.mean[..., :2]
        back[..., 1] = -5.0  # between the two
        one.mean[..., :2] = back
        return (one,)

    bag = written(tmp_path / "back", recording, published)
    result = evaluate_bags([bag], observed_recordings([bag]), {}, own_clock=False)
    summary = honesty_summary(result.evaluation.honesty)
    own, straight = (summary[name]["all"]["all"] for name in ("back", "cv"))
    assert (own["n"], straight["n"]) == (22, 22)
    assert own["feasibility"]["reverses"] == own["feasibility"]["overlaps"] == 1.0
    assert straight["feasibility"]["reverses"] == straight["feasibility"]["overlaps"] == 0.0


def test_recordings_of_bags_have_the_site_that_is_given(tmp_path):
    recording = make_recording(duration_s=8.0)
    bag = written(
        tmp_path / "bag", recording, lambda number: (perfect_prediction(recording, number),)
    )
    for sites, expected in (({}, recording.location), ({"a/made": "a/1"}, "a/1")):
        result = evaluate_bags([bag], {"a/made": recording}, {}, sites=sites)
        found = honesty_summary(result.evaluation.honesty)["bag"]["all"]["by_site_and_motion"]
        assert {name.rsplit(", ", 1)[0] for name in found} == {expected}


def test_a_node_may_publish_fewer_modes_where_there_are_many_road_users(tmp_path):
    recording = make_recording(duration_s=8.0)

    def published(number, modes=(2, 3)):
        if number > 11:
            return ()
        one = perfect_prediction(recording, number, modes=modes[number // 4 % 2])
        weight = np.tile([0.6, 0.3, 0.1][: one.mean.shape[1]], (2, 1))
        return (dataclasses.replace(one, weight=weight / weight.sum(axis=1, keepdims=True)),)

    bag = written(tmp_path / "fewer", recording, published)
    result = evaluate_bags([bag], observed_recordings([bag]), {}, own_clock=False)
    assert scores(result, "fewer")["n"] == 24
    own = honesty_summary(result.evaluation.honesty)["fewer"]["all"]["all"]
    assert own["n"] == 24
    # Two thirds of the predictions have two modes. The third one is the truth, as the first.
    assert own["weights"]["chance"] == pytest.approx((2.0 / 2.0 + 1.0 / 3.0) / 3.0)
    assert own["weights"]["heaviest_nearest"] == pytest.approx((2.0 + 0.5) / 3.0)
    # Each is compared with the one 0.2 s before it, whatever their modes.
    assert own["consistency"]["n"] == 20
    assert own["consistency"]["jump"] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("other", [{"horizon": 10}, {"horizon": 12, "dt_s": 0.4}])
def test_predictions_of_different_horizons_are_refused(tmp_path, other):
    recording = make_recording(duration_s=8.0)
    bag = written(
        tmp_path / "two",
        recording,
        lambda number: (perfect_prediction(recording, number, **(other if number > 5 else {})),),
    )
    steps, dt_s = other["horizon"], other.get("dt_s", 0.2)
    sentence = rf"horizons \(25 steps of 0.2 s, {steps} steps of {dt_s} s\), expected those of one"
    with pytest.raises(RecordingError, match=sentence):
        evaluate_bags([bag], observed_recordings([bag]), {}, own_clock=False)


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
    assert max(agreement.differences_m) < 1e-3
    assert "road user" in agreement.text("online", "default")
    assert list(result.published["online"]) == ["shipped"]
    assert effect_of_calibration(result.evaluation) == {}
    # The baselines are scored once.
    assert result.evaluation.scores.averages()["cv"]["all"]["n"] == online["n"]


def test_a_node_that_compensates_its_delay_is_scored_at_the_times_it_predicted(
    recording, runner, tmp_path
):
    """Online and offline agree only if both begin their horizons where the node did."""
    short = recording.between(None, 4.0)
    bag = play(short, runner, tmp_path / "delayed", every=10, delay_ns=70_000_000)
    result = evaluate_bags([bag], observed_recordings([bag]), {"default": runner})
    online, offline = scores(result, "delayed"), scores(result, "default")
    assert online["n"] == offline["n"] > 20
    for key in ("ade", "fde", "min_ade"):
        assert online[key] == pytest.approx(offline[key], abs=1e-3)
    assert max(result.agreements["delayed"]["default"].differences_m) < 1e-3


def as_if_online(bag, path):
    """Write the first 4 s of a bag as if its predictions had the online calibration."""
    with DecodingBagReader(bag) as reader, McapWriter(path) as out:
        for connection in reader.connections:
            out.add_topic(connection.topic, connection.msgtype)
        for connection, received_ns, message in reader.messages(reader.connections):
            if received_ns > reader.start_ns + 4 * 10**9:
                break
            if connection.topic.endswith("predictions"):
                one = prediction_from_pointcloud2(message)
                stage = np.full(len(one), CalibrationStage.ONLINE, dtype=np.uint8)
                one = dataclasses.replace(one, calibration=stage)
                message = prediction_to_pointcloud2(one, out.types)
            out.write(connection.topic, received_ns, message)
    return path


def test_bags_with_the_online_calibration_show_what_it_changes(bag, runner, tmp_path):
    corrected = as_if_online(bag, tmp_path / "corrected")
    result = evaluate_bags([corrected], observed_recordings([corrected]), {"default": runner})
    assert list(result.published["corrected"]) == ["online"]
    averages = result.evaluation.scores.averages()
    effect = effect_of_calibration(result.evaluation)
    assert list(effect) == ["default, shipped", "default, online"]
    shipped, online = effect.values()
    assert shipped == averages["default"]["all"]
    assert online["ade"] == pytest.approx(shipped["ade"], rel=1e-3)  # paths as well, a little
    assert online["anll"] != shipped["anll"]
    assert online["n"] == shipped["n"] > 100


def test_both_calibrations_are_compared_on_the_bags_with_the_online_one(
    bag, recording, runner, tmp_path
):
    corrected = as_if_online(bag, tmp_path / "corrected")
    models = {"default": runner}
    later = dataclasses.replace(recording, start_time_ns=recording.start_time_ns + 10**12)
    shipped = play(later.between(None, 6.0), runner, tmp_path / "shipped", every=10)
    alone, both = (
        evaluate_bags(bags, observed_recordings(bags), models, own_clock=False).evaluation
        for bags in ([corrected], [shipped, corrected])
    )
    assert effect_of_calibration(both) == effect_of_calibration(alone) != {}
    of_both, of_one = (one.scores.averages()["default"]["all"]["n"] for one in (both, alone))
    assert of_both > of_one


def test_a_filtered_cloud_is_left_out_and_alone_refused(tmp_path):
    recording = make_recording(duration_s=6.0)

    def bag(name, whole):
        def published(number):
            if number > 10:
                return ()
            one = perfect_prediction(recording, number)
            if number >= whole:
                one.mean[:, 0, 7] = np.nan  # as the decoder fills what is missing
            return (one,)

        return written(tmp_path / name, recording, published)

    part, none = bag("part", 5), bag("none", 0)
    result = evaluate_bags([part], observed_recordings([part]), {}, own_clock=False)
    assert scores(result, "part")["n"] == 10
    assert scores(result, "part")["ade"] == pytest.approx(0.0, abs=1e-6)
    (warning,) = (one for one in result.warnings if "points are missing of 12" in one)
    assert warning.endswith("they are left out")
    with pytest.raises(RecordingError, match="expected every mode and step"):
        evaluate_bags([none], observed_recordings([none]), {}, own_clock=False)


@pytest.mark.parametrize(("fallback", "said"), [(1, False), (2, True)])
def test_constant_velocity_in_place_of_the_model_is_a_warning(tmp_path, fallback, said):
    recording = make_recording(duration_s=6.0)

    def published(number):
        if number >= 10:
            return ()
        one = perfect_prediction(recording, number)
        source = Source.CONSTANT_VELOCITY if number < fallback else Source.MODEL
        return (dataclasses.replace(one, source=np.full(len(one), source, dtype=np.uint8)),)

    path = written(tmp_path / "busy", recording, published)
    result = evaluate_bags([path], observed_recordings([path]), {}, own_clock=False)
    found = [one for one in result.warnings if "constant velocity in place of the model" in one]
    assert len(found) == said
    for warning in found:
        agents = len(perfect_prediction(recording, 0))
        assert warning.startswith(f"{fallback * agents} of the {10 * agents} predictions")


def test_of_two_predictions_of_a_stamp_the_last_one_is_scored_and_that_is_reported(tmp_path):
    recording = make_recording(duration_s=6.0)

    def published(number):
        if number > 10:
            return ()
        right = perfect_prediction(recording, number)
        wrong = dataclasses.replace(right, mean=right.mean + 3.0)
        return (wrong, right) if number < 3 else (right,)

    path = written(tmp_path / "two", recording, published)
    result = evaluate_bags([path], observed_recordings([path]), {}, own_clock=False)
    assert scores(result, "two")["ade"] == pytest.approx(0.0, abs=1e-6)
    (warning,) = (one for one in result.warnings if "have the stamp of a later one" in one)
    assert warning.startswith(f"3 of the 14 predictions in {path}")


def test_a_recording_that_was_played_twice_is_not_known_before_it_is_played_again(tmp_path):
    """Played at two times: baselines and models see only what was observed in their own pass."""
    recording = make_recording(duration_s=20.0)

    def published(number):
        wanted = number % 4 == 0 and number <= 140
        return (perfect_prediction(recording, number),) if wanted else ()

    def played(name, times):
        passes_ns = range(0, times * 40 * 10**9, 40 * 10**9)
        path = written(tmp_path / name, recording, published, passes_ns)
        return evaluate_bags([path], {"01": recording}, {})

    once, twice = played("once", 1), played("twice", 2)
    assert scores(twice, "twice")["n"] == 2 * scores(once, "once")["n"]
    assert scores(twice, "twice")["ade"] == pytest.approx(0.0, abs=1e-6)
    for baseline in ("cv", "ca", "ctrv"):
        assert scores(twice, baseline) == scores(once, baseline)
    jumps = twice.evaluation.honesty.jumps()
    own = jumps[jumps["model"] == "twice"]["jump"]
    assert len(own) > 100
    assert own.max() == pytest.approx(0.0, abs=1e-6)


def test_a_played_recording_that_is_not_given_is_a_warning(bag, recording):
    early = recording.between(None, 4.0)
    result = evaluate_bags([bag], {"01": early}, {})
    assert any("are of no road user" in warning for warning in result.warnings)
    moved = dataclasses.replace(recording, position=recording.position + 1.0)
    result = evaluate_bags([bag], {"01": moved}, {})
    assert any("is in none of the recordings" in warning for warning in result.warnings)


def test_two_bags_need_two_names(bag, recording):
    with pytest.raises(ConfigurationError, match="two sets of predictions are called online"):
        evaluate_bags([bag, bag], {"01": recording}, {})


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
        # Files round to a tenth of a millimetre, as the recording is.
        assert found["default"]["largest_mm"] < 5.0
    assert "online and default, agent by agent" in capsys.readouterr().out
    assert "Recorded and offline predictions" in (report / "index.html").read_text()
    assert (report / "best_online.png").is_file()


@pytest.mark.parametrize("fixed_frame", ["map", "odom"])
def test_objects_are_read_in_the_frame_of_the_predictions(tmp_path, fixed_frame):
    path = driven_past(tmp_path / "drive", make_recording(duration_s=8.0), fixed_frame)
    result = evaluate_bags([path], observed_recordings([path]), {}, own_clock=False)
    assert scores(result, "drive")["n"] > 50
    assert scores(result, "drive")["ade"] == pytest.approx(0.0, abs=1e-4)
    assert result.warnings == []


def test_frames_without_a_connecting_transform_are_reported(tmp_path):
    recording = make_recording(duration_s=6.0)
    path = driven_past(tmp_path / "drive", recording, "odom", with_transforms=False)
    result = evaluate_bags([path], observed_recordings([path]), {}, own_clock=False)
    (warning,) = result.warnings
    assert warning.startswith(f"the predictions in {path} are in the frame 'odom', the objects in")
