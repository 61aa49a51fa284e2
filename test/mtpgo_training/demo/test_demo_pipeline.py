# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Steps of the demo before and after the node runs."""

import dataclasses

import pytest
from demo_traffic import make_recording, perfect_prediction

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.data.data_sources import DataSource
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.demo import demo_pipeline
from mtpgo_training.demo import demo_report as report
from mtpgo_training.demo.demo_pipeline import score_recordings
from mtpgo_training.demo.playback_plan import make_plan
from mtpgo_training.demo.recorded_messages import ReceivedPrediction, RecordedMessages


def test_results_of_an_earlier_run_are_deleted_and_other_files_kept(tmp_path):
    output = tmp_path / "new" / "demo_output"
    bags, predictions, logs = demo_pipeline._make_folders(output)
    for folder in (bags, logs):
        (folder / "old").write_text("")
    predictions.mkdir()
    for name in ("summary.json", "prediction.png", "notes.txt"):
        (output / name).write_text("")
    assert demo_pipeline._make_folders(output) == (bags, predictions, logs)
    assert {path.name for path in output.iterdir()} == {"bags", "logs", "notes.txt"}
    assert not any(bags.iterdir())
    assert [path.read_bytes() for path in logs.iterdir()] == [b""], "the mark of a demo"
    assert not predictions.exists()  # the recorder creates it


@pytest.mark.parametrize("name", ["bags", "logs", "report", "summary.json", "prediction.png"])
def test_files_of_others_are_not_replaced(tmp_path, name):
    """A folder of one's own may well be called bags or logs."""
    (tmp_path / name).mkdir()
    with pytest.raises(ConfigurationError, match=f"has '{name}', which is of no earlier demo"):
        demo_pipeline._require_replaceable(tmp_path, [])
    assert (tmp_path / name).exists()


def test_results_are_replaced_unless_they_are_what_is_played(tmp_path):
    (tmp_path / "notes.txt").write_text("")
    demo_pipeline._require_replaceable(tmp_path, [])
    bags, *_ = demo_pipeline._make_folders(tmp_path)
    demo_pipeline._require_replaceable(tmp_path, [DataSource(tmp_path, "bag")])
    for place in (bags, bags / "a.mcap"):
        with pytest.raises(ConfigurationError, match="among the results of an earlier demo"):
            demo_pipeline._require_replaceable(tmp_path, [DataSource(place, "bag")])


def test_an_output_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigurationError, match="file/out cannot be written: Not a directory"):
        demo_pipeline._make_folders(tmp_path / "file" / "out")


def test_the_page_is_told_to_show_one_recording_with_the_way_to_another(
    tmp_path, caplog, monkeypatch
):
    folder = tmp_path / "my predictions"
    for name in ("a", "b"):
        write_ind(make_recording(name, 2.0), folder)
    monkeypatch.setattr(demo_pipeline, "DataSource", lambda bag, _: DataSource(bag, "ind"))
    assert demo_pipeline._write_page(folder, tmp_path / "demo.html") is not None
    (told,) = [said for said in caplog.messages if "is shown" in said]
    command = f"mtpgo view '{folder}' --recordings b --html FILE"
    assert told.endswith(f"and not b; to see another: {command}")


def test_recordings_of_the_same_name_are_told_apart_by_their_folders(tmp_path):
    for folder, duration_s in (("a", 1.0), ("b", 1.2)):
        write_ind(make_recording("01", duration_s), tmp_path / folder)
    sources = [DataSource(tmp_path / folder, "ind") for folder in ("a", "b")]
    assert [recording.name for recording in demo_pipeline._read(sources)] == ["a/01", "b/01"]


def test_a_recording_is_scored_only_by_the_predictions_of_its_time():
    plan = make_plan([make_recording("a"), make_recording("b")], {}, play_all=False)
    recorded = RecordedMessages()
    for recording, frames in zip(plan.recordings, ((10, 20), (30,)), strict=True):
        for frame in frames:
            prediction = perfect_prediction(recording, frame)
            received = ReceivedPrediction(prediction, prediction.stamp_ns + 1)
            recorded.predictions.append(received)
    total, parts = score_recordings(plan, recorded, TaskDescription(), 5.0)
    assert [len(part.predictions) for part in parts] == [2, 1]
    assert total.predictions == recorded.predictions

    def agents(result):
        return result.scores[report.MODEL][report.PROTOCOL]["n"]

    assert [agents(part) for part in parts] == [4, 2]
    assert agents(total) == 6


def test_a_prediction_of_no_observation_is_an_error():
    plan = make_plan([make_recording("a")], {}, play_all=False)
    prediction = perfect_prediction(plan.recordings[0], 10)
    late = dataclasses.replace(prediction, stamp_ns=prediction.stamp_ns + 10**12)
    recorded = RecordedMessages()
    recorded.predictions.append(ReceivedPrediction(late, late.stamp_ns))
    with pytest.raises(RecordingError, match=f"is stamped {late.stamp_ns} ns, which no"):
        score_recordings(plan, recorded, TaskDescription(), 5.0)
