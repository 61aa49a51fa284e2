# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recorded predictions, read from bags and matched to recordings."""

import dataclasses

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction
from recorded_bags import play

from msg_adapters.bags.mcap_writer import McapWriter
from mtpgo_core.errors import RecordingError
from mtpgo_training.data.recording_bag import write_recording
from mtpgo_training.evaluation.bags.bag_evaluation import observed_recordings
from mtpgo_training.evaluation.bags.bag_predictions import match, read_predictions, without_holes


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


def test_agents_with_missing_points_are_reported_and_left_out():
    made = make_recording()
    whole, holes, halves, late = (perfect_prediction(made, 0) for _ in range(4))
    holes.mean[1, 0, 3] = np.nan
    halves.weight[:] = 0.5, 0.25  # a mode was filtered away
    late.time_s[0] = np.nan
    found, number = without_holes([whole, holes, halves, late])
    assert [len(one) for one in found] == [2, 1, 0, 0]
    assert number == 5
    assert found[1].key.tolist() == whole.key[:1].tolist()
