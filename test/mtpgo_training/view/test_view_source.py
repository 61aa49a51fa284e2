# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags and recordings with and without predictions."""

import dataclasses

import numpy as np
import pytest
import torch
from demo_traffic import make_recording
from driven_bags import driven_past
from viewed_bags import write_bag

from models.mtp_go import MTPGO
from models.mtp_go_config import ModelConfig
from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.maps.lane_file_options import LaneFileOptions
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.data.data_sources import DataSource
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.export.exporter import export_model
from mtpgo_training.view.view_source import ViewOptions, load_scene


@pytest.fixture(scope="module")
def bag(recording, tmp_path_factory):
    return write_bag(tmp_path_factory.mktemp("bag") / "drive.mcap", recording)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    torch.manual_seed(0)
    path = tmp_path_factory.mktemp("model") / "made.pt"
    network = MTPGO(ModelConfig(modes=2, hidden=8))
    export_model(network, TaskDescription(name="made"), path)
    return path


def load(directory, layout="bag", **options):
    return load_scene(DataSource(directory, layout), ViewOptions(**options))


def test_recorded_predictions_are_shown_with_their_model(bag):
    scene = load(bag)
    assert (scene.name, scene.model, scene.frame_id) == ("drive", "perfect", "map")
    assert len(scene.predictions) == 51
    assert scene.predictions[0].ade_m.max() < 0.01


@pytest.mark.parametrize(
    ("filtered", "times_s", "error_m"),
    [
        ({"step": [4, 9, 14, 19, 24]}, [1.0, 2.0, 3.0, 4.0, 5.0], 0.0),
        ({"step": [5, 6, 9, 24]}, [1.2, 1.4, 2.0, 5.0], 0.0),
        ({"mode": [1]}, np.arange(1, 26) * 0.2, 1.0),  # the one beside the truth
    ],
)
def test_a_filtered_cloud_is_shown_as_far_as_it_goes(
    recording, tmp_path, filtered, times_s, error_m
):
    scene = load(write_bag(tmp_path / "drive.mcap", recording, **filtered))
    assert len(scene.predictions) == 51
    for one in scene.predictions:
        np.testing.assert_allclose(one.prediction.time_s, times_s, atol=1e-6)
        np.testing.assert_allclose(one.ade_m, error_m, atol=0.01)
    np.testing.assert_allclose(scene.predictions[0].final_m, error_m, atol=0.01)


@pytest.mark.parametrize("fixed_frame", ["map", "odom"])
def test_objects_are_drawn_in_the_frame_of_the_predictions(tmp_path, caplog, fixed_frame):
    scene = load(driven_past(tmp_path / "drive", make_recording(duration_s=8.0), fixed_frame))
    assert scene.frame_id == fixed_frame
    for one in scene.predictions[:10]:
        np.testing.assert_allclose(one.ade_m, 0.0, atol=0.01)
    assert "frame" not in caplog.text


def test_predictions_in_another_frame_than_the_objects_are_told(recording, tmp_path, caplog):
    def bag(frame_id):
        path = tmp_path / f"{frame_id}.mcap"
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("mtpgo_training.data.recording.FRAME_ID", frame_id)
            return write_bag(path, recording)

    load(bag("map"))
    assert "frame" not in caplog.text
    load(bag("odom"))
    assert "predictions are in the frame 'map' and the objects in 'odom'" in caplog.text


def test_other_recordings_are_told_with_the_way_to_see_them(tmp_path, caplog, model):
    for name in ("01", "02"):
        write_ind(make_recording(name, 2.0), tmp_path)
    load(tmp_path, "ind", model=str(model))
    assert "is shown, and not 02; --recordings chooses" in caplog.text
    load(tmp_path, "ind", model=str(model), another=lambda name: f"see {name} so")
    assert "is shown, and not 02; see 02 so" in caplog.text


def test_a_part_is_shown(bag, caplog):
    scene = load(bag, start_s=2.0, longest_s=3.0)
    assert scene.recording.duration_s == pytest.approx(3.0)
    assert len(scene.predictions) == 16
    assert "2 to 5 s of the 12.0 s of drive are shown" in caplog.text


def test_a_model_predicts_what_has_no_predictions(recording, tmp_path, model):
    bag = write_bag(tmp_path / "bare.mcap", recording, predictions=False)
    scene = load(bag, model=str(model), end_s=2.0)
    assert scene.model == "made"
    assert len(scene.predictions) == 11
    assert [len(one.prediction) for one in scene.predictions] == [2] * 11


def test_the_shipped_model_predicts_where_none_is_named(recording, tmp_path, model, monkeypatch):
    monkeypatch.setattr("mtpgo_training.view.view_source.DEFAULT_MODEL", str(model))
    write_ind(recording, tmp_path)
    scene = load(tmp_path, "ind", end_s=1.0)
    assert (scene.name, scene.model) == ("made", "made")
    assert len(scene.predictions) == 6


def test_the_lanes_of_a_directory_and_of_a_bag_are_shown(recording, tmp_path, model):
    line = np.array([[0.0, -12.0], [120.0, -12.0]])
    observed = dataclasses.replace(recording, lanes=(line,))
    (tmp_path / "data").mkdir()
    write_ind(observed, tmp_path / "data")
    bag = write_bag(tmp_path / "drive.mcap", observed)
    for directory, layout in ((tmp_path / "data", "ind"), (bag, "bag")):
        (shown,) = load(directory, layout, model=str(model), end_s=1.0).recording.lanes
        np.testing.assert_allclose(shown, line, atol=0.01)


def test_the_lanes_of_a_file_take_their_place(recording, tmp_path):
    observed = dataclasses.replace(recording, lanes=(np.array([[0.0, -12.0], [120.0, -12.0]]),))
    bag = write_bag(tmp_path / "drive.mcap", observed)
    path = tmp_path / "a.json"
    path.write_text('{"type": "LineString", "coordinates": [[1000, 5], [1900, 5]]}')
    options = ReadingOptions(lane_file=path, lane_options=LaneFileOptions(offset="1000, 0"))
    (shown,) = load_scene(DataSource(bag, "bag", None, options), ViewOptions()).recording.lanes
    assert shown.tolist() == [[0.0, 5.0], [900.0, 5.0]]


def test_the_frame_is_that_of_the_objects(recording, tmp_path, monkeypatch):
    monkeypatch.setattr("mtpgo_training.data.recording.FRAME_ID", "odom")
    bag = write_bag(tmp_path / "odom.mcap", recording)
    monkeypatch.undo()
    assert load(bag).frame_id == "odom"


def test_a_bag_of_several_recordings_shows_the_first(recording, tmp_path, caplog):
    later = dataclasses.replace(
        recording, start_time_ns=recording.start_time_ns + 60_000_000_000, name="later"
    )
    write_bag(tmp_path / "a.mcap", recording)
    write_bag(tmp_path / "b.mcap", later)
    assert load(tmp_path).name == "a"
    assert "a of" in caplog.text
    assert "b" in caplog.text
    chosen = load_scene(DataSource(tmp_path, "bag", ("b",)), ViewOptions())
    assert chosen.name == "b"
    assert len(chosen.predictions) == 51


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start_s": 20.0}, "no road user from 20 s on, it lasts 12.0 s"),
        ({"predictions_topic": "/other"}, "expected a sensor_msgs/msg/PointCloud2 on the topic"),
    ],
)
def test_what_is_not_there_is_an_error(bag, options, message):
    with pytest.raises(RecordingError, match=message):
        load(bag, **options)


def test_a_bag_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(RecordingError, match="does not exist, expected a bag or a directory"):
        load(tmp_path / "none.mcap")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start_s": -1.0}, "--start is -1.0, expected at least 0 s"),
        ({"start_s": 3.0, "end_s": 2.0}, "--end is 2.0, expected more than the start, 3 s"),
        ({"start_s": np.nan}, "--start is nan"),
        ({"model": "default", "predictions_topic": "/p"}, "--model is given with --predictions"),
    ],
)
def test_options_that_cannot_be_are_errors(options, message):
    with pytest.raises(ConfigurationError, match=message):
        ViewOptions(**options)
