# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""nuScenes' tables, made up: two scenes, the recording vehicle, objects that never move."""

import json
import math
import shutil

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.fleets import nuscenes_recordings

SIXTY = [math.cos(math.pi / 6), 0, 0, math.sin(math.pi / 6)]
START_US = 1_532_402_927_000_000


@pytest.fixture
def folder(tmp_path):
    """A folder v1.0-mini with two scenes of three samples."""
    names = ("vehicle.car", "human.pedestrian.adult", "movable_object.barrier")
    times = {
        (s, k): START_US + s * 30_000_000 + k * 500_000 + 1000 * (k == 1)
        for s in (0, 1)
        for k in range(3)
    }
    tables = {
        "log": [{"token": "l", "location": "singapore-onenorth"}],
        "scene": [{"token": f"s{s}", "name": f"scene-000{s}", "log_token": "l"} for s in (0, 1)],
        "sample": [
            {"token": f"a{s}{k}", "scene_token": f"s{s}", "timestamp": time}
            for (s, k), time in times.items()
        ],
        "category": [{"token": f"c{i}", "name": name} for i, name in enumerate(names)],
        "instance": [
            {"token": f"i{s}{i}", "category_token": f"c{i}"} for s in (0, 1) for i in range(3)
        ],
        "sample_annotation": [
            {
                "sample_token": f"a{s}{k}",
                "instance_token": f"i{s}{i}",
                "translation": [100 + i + 2 * k, 50.0, 1.0],
                "size": [1.9, 4.6, 1.7],
                "rotation": SIXTY,
            }
            for (s, k) in times
            for i in range(3)
        ],
        "ego_pose": [
            {"timestamp": time + late, "translation": [k, 0, 0], "rotation": [1, 0, 0, 0]}
            for (s, k), time in times.items()
            for late in (0, 20_000)
        ],
    }
    (tmp_path / "v1.0-mini").mkdir()
    for name, rows in tables.items():
        (tmp_path / "v1.0-mini" / f"{name}.json").write_text(json.dumps(rows, indent=0))
    return tmp_path


def test_scenes(folder):
    first, second = load_recordings(folder, "nuscenes")
    assert [r.name for r in (first, second)] == ["v1.0-mini-scene-0000", "v1.0-mini-scene-0001"]
    assert (first.location, first.start_time_ns) == ("singapore-onenorth", START_US * 1000)
    # Samples half a second apart, one of them 1 ms late.
    assert first.stamp_ns(first.frames[1]) == (START_US + 501_000) * 1000
    assert len(first) == 9
    classes = sorted(first.agent_class.tolist())
    assert classes == [AgentClass.CAR, AgentClass.CAR, AgentClass.PEDESTRIAN]
    ego = int(np.flatnonzero(first.track_id == first.ego_id)[0])
    np.testing.assert_allclose(first.position[first.track == ego], [[0, 0], [1, 0], [2, 0]])
    other = first.track != ego
    np.testing.assert_allclose(first.yaw[other], np.radians(60))
    walker = int(np.flatnonzero(first.agent_class == AgentClass.PEDESTRIAN)[0])
    np.testing.assert_allclose(first.position[first.track == walker, 0], [101, 103, 105])
    np.testing.assert_allclose(first.size[walker], [4.6, 1.9])
    assert np.isnan(first.velocity).all()


def test_scenes_by_name_and_tables_larger_than_a_portion(folder, monkeypatch):
    monkeypatch.setattr(nuscenes_recordings, "_AT_ONCE", 50)
    for names in (["scene-0001"], ["v1.0-mini-scene-0001"]):
        (recording,) = load_recordings(folder, "nuscenes", names)
        assert recording.name == "v1.0-mini-scene-0001"
    (part,) = load_recordings(folder, "nuscenes", ["v1.0-mini-scene-0001@0-0.6s"])
    assert len(part) == 6
    assert len(load_recordings(folder / "v1.0-mini", "nuscenes", ["v1.0-mini"])) == 2
    with pytest.raises(RecordingError, match="has no scene 'scene-0009', it has scene-0000, sc"):
        load_recordings(folder, "nuscenes", ["scene-0009"])


@pytest.mark.parametrize(
    ("table", "edit", "sentence"),
    [
        ("sample", lambda t: t[:-20], "sample.json cannot be read as JSON: "),
        ("log", lambda t: t[:12], "log.json cannot be read as JSON: Unterminated string, the fi"),
        ("sample", lambda t: "{}", "sample.json is no JSON list, expected a table of nuScenes"),
        ("sample", lambda t: t.replace("timestamp", "time", 1), "record 1 has no field"),
        (
            "log",
            lambda t: t.replace('"l"', "[1]"),
            "log.json, record 1: token is [1], exp",
        ),
        ("log", lambda t: "[1]", "log.json has 1, expected records with fields"),
        (
            "sample_annotation",
            lambda t: t.replace("50.0", "NaN", 1),
            "record 1: translation is [100, nan, 1.0], expected finite numbers (3)",
        ),
        ("sample_annotation", lambda t: t.replace("4.6", "1" * 400, 1), "record 1: size is [1.9"),
        ("ego_pose", lambda t: t.replace("[1", '["1"', 1), "expected finite numbers"),
        ("log", lambda t: t.replace('"l"', r'"\ud800"'), r"token is '\ud800', expected text"),
    ],
)
def test_a_defect_is_one_sentence_with_its_place(folder, table, edit, sentence):
    path = folder / "v1.0-mini" / f"{table}.json"
    path.write_text(edit(path.read_text().replace("\n", "")))
    with pytest.raises(RecordingError) as caught:
        load_recordings(folder, "nuscenes")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_missing_is_named(folder, tmp_path):
    (folder / "v1.0-mini" / "log.json").unlink()
    with pytest.raises(RecordingError, match=r"log\.json is missing, it belongs to nuScenes"):
        load_recordings(folder, "nuscenes")
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"has no recordings, expected nuScenes"):
        load_recordings(tmp_path / "empty", "nuscenes")


def test_tables_that_an_editor_of_windows_has_saved_are_read(folder):
    for path in (folder / "v1.0-mini").iterdir():
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert len(load_recordings(folder, "nuscenes")) == 2


def edited(folder, table, edit):
    """Edit the records of a table."""
    path = folder / "v1.0-mini" / f"{table}.json"
    rows = json.loads(path.read_text())
    edit(rows)
    path.write_text(json.dumps(rows))


def test_a_scene_that_two_versions_have_is_read_once(folder, caplog):
    shutil.copytree(folder / "v1.0-mini", folder / "v1.0-trainval")
    edited(folder, "scene", lambda rows: rows.pop())
    recordings = load_recordings(folder, "nuscenes")
    assert [r.name for r in recordings] == ["v1.0-trainval-scene-0000", "v1.0-trainval-scene-0001"]
    assert "v1.0-mini: 1 of its 1 scenes are in v1.0-trainval too, and are read" in caplog.text
    (recording,) = load_recordings(folder, "nuscenes", ["scene-0000"])
    assert recording.name == "v1.0-trainval-scene-0000"
    for name in ("v1.0-mini", "v1.0-mini-scene-0000"):
        (recording,) = load_recordings(folder, "nuscenes", [name])
        assert recording.name == "v1.0-mini-scene-0000"


def test_an_orientation_that_is_not_set_is_unknown(folder):
    edited(folder, "sample_annotation", lambda rows: rows[0].update(rotation=[0, 0, 0, 0]))
    recording = load_recordings(folder, "nuscenes")[0]
    car = recording.track == int(np.flatnonzero(recording.track_id != recording.ego_id)[0])
    assert np.isnan(recording.yaw[car]).tolist() == [True, False, False]


def test_tokens_of_records_that_are_missing_are_named(folder):
    edited(folder, "category", lambda rows: rows.pop())
    with pytest.raises(
        RecordingError, match=r"instance\.json, record 3: category_token is 'c2', w"
    ):
        load_recordings(folder, "nuscenes")
    edited(folder, "instance", lambda rows: rows.pop(2))  # the only barrier of the first scene
    edited(folder, "instance", lambda rows: rows.pop())
    with pytest.raises(
        RecordingError, match=r"annotation\.json, record 3: instance_token is 'i02', which in"
    ):
        load_recordings(folder, "nuscenes")


def test_poses_and_scenes_that_are_missing_are_said(folder, caplog):
    edited(folder, "ego_pose", lambda rows: rows.pop(0))
    edited(folder, "sample", lambda rows: [rows.pop() for _ in range(3)])
    (recording,) = load_recordings(folder, "nuscenes")
    assert len(recording) == 8
    assert "1 of 3 samples have no pose of the recording vehicle at their time" in caplog.text
    assert "scene-0001 has no road user and no pose, it is left out" in caplog.text
