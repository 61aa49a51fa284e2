# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The cache: the same numbers, kept once, computed again when damaged or when anything changes."""

import json
import multiprocessing
import os

import numpy as np
import pytest
from cache_process import make_and_count
from drone_files import write_highd, write_ind
from traffic import braking_cars

from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.recording_cache import RecordingCache, default_folder
from mtpgo_training.scenes.prepared_recording import prepare
from mtpgo_training.scenes.scene_dataset import SceneDataset
from mtpgo_training.training.training_config import DataConfig

HISTORY = HistoryConfig()
SCENE = SceneConfig(max_neighbours=4, radius_m=50.0)
DATA = DataConfig(restart_probability=0.3, velocity_smoothing_s=0.3)


def entries(folder):
    return sorted(path for path in folder.iterdir() if path.is_dir())


def dataset(cache, data=DATA, **changes):
    source = prepare(
        braking_cars(**changes), HISTORY, SCENE, data, training=True, seed=4, cache=cache
    )
    return SceneDataset([source], HISTORY, SCENE, data, 10, seed=1)


def assert_same(one, two):
    assert one.items == two.items
    for index in range(0, len(one), 17):
        a, b = one[index], two[index]
        for name in a.keys():  # noqa: SIM118  PyG's Data is no mapping
            if name != "num_nodes":
                np.testing.assert_array_equal(a[name].numpy(), b[name].numpy(), err_msg=name)


@pytest.mark.parametrize("write", [write_highd, write_ind])
def test_a_recording_comes_back_as_it_was_read(tmp_path, write):
    layout = write.__name__.removeprefix("write_")
    write(tmp_path / "files")
    cache = RecordingCache(tmp_path / "cache")
    (plain,) = load_recordings(tmp_path / "files", layout)
    for _ in range(2):
        (kept,) = load_recordings(tmp_path / "files", layout, cache=cache)
        for name, value in vars(plain).items():
            if isinstance(value, np.ndarray):
                assert value.dtype == getattr(kept, name).dtype
                np.testing.assert_array_equal(value, getattr(kept, name))
            elif name == "lanes":
                assert len(value) == len(kept.lanes)
                for line, other in zip(value, kept.lanes, strict=True):
                    np.testing.assert_array_equal(line, other)
            elif not name.startswith("_"):
                assert value == getattr(kept, name), name
    assert len(entries(tmp_path / "cache")) == 1


def test_scenes_are_the_same_with_the_cache_without_and_from_it(tmp_path):
    plain = dataset(None)
    first, second = (dataset(RecordingCache(tmp_path)) for _ in range(2))
    assert_same(plain, first)
    assert_same(plain, second)
    assert len(entries(tmp_path)) == 3  # samples, restarted samples, futures
    assert not second.sources[0].future._position.flags.writeable  # mapped, not copied


def test_everything_that_determines_an_entry_makes_another(tmp_path):
    cache = RecordingCache(tmp_path)
    counts = []
    for recording, history in (
        (braking_cars(), HISTORY),
        (braking_cars(), HISTORY),
        (braking_cars(seed=1), HISTORY),
        (braking_cars(), HistoryConfig(steps=5)),
        (braking_cars().between(0.0, 4.0), HISTORY),  # has the hash of the whole
    ):
        prepare(recording, history, SCENE, DataConfig(restart_probability=0.0), training=False,
                cache=cache)  # fmt: skip
        counts.append(len(entries(tmp_path)))
    assert counts == [2, 2, 4, 5, 7]


@pytest.mark.parametrize(
    "changed", ["frame_rate: 10", "speed_unit: km/h", "heading_unit: deg", "columns: no speed"]
)
def test_files_read_in_another_way_are_other_rows(tmp_path, changed):
    """The files and their positions are the same: only what is said of the columns changes."""
    folder, cache = tmp_path / "own", RecordingCache(tmp_path / "cache")
    folder.mkdir()
    lines = [f"{i},{f},{0.36 * f:.3f},{4 * i},36,1" for f in range(80) for i in range(2)]
    (folder / "a.csv").write_text("\n".join(["id,f,x,y,v,h", *lines]))
    said = {
        "columns": "{track: id, frame: f, x: x, y: y, speed: v, heading: h}",
        "frame_rate": "25",
        "speed_unit": "m/s",
        "heading_unit": "rad",
    }

    def velocity_and_yaw(cache):
        path = tmp_path / "columns.yaml"
        path.write_text("".join(f"{key}: {value}\n" for key, value in said.items()))
        (recording,) = load_recordings(
            folder, "table", None, ReadingOptions(columns=path), cache=cache
        )
        data = DataConfig(restart_probability=0.5, tracker_share=0.5)
        source = prepare(recording, HISTORY, SCENE, data, training=True, seed=4, cache=cache)
        views = [view.windows.instants for view in source.views]
        steps = source.future.at(np.array([0]), recording.stamp_ns(40), 3, 0.2).velocity
        return [np.concatenate([v.velocity.ravel(), v.yaw, v.stamp_ns]) for v in views] + [steps]

    before = velocity_and_yaw(cache)
    key, _, value = changed.partition(": ")
    said[key] = "{track: id, frame: f, x: x, y: y}" if key == "columns" else value
    for kept, plain in zip(velocity_and_yaw(cache), velocity_and_yaw(None), strict=True):
        np.testing.assert_array_equal(kept, plain)
    assert any(
        len(one) != len(other) or not np.array_equal(one, other, equal_nan=True)
        for one, other in zip(before, velocity_and_yaw(cache), strict=True)
    )


def test_a_changed_file_is_read_again(tmp_path):
    cache = RecordingCache(tmp_path / "cache")
    tracks = write_ind(tmp_path / "files") / "07_tracks.csv"
    (before,) = load_recordings(tmp_path / "files", "ind", cache=cache)
    tracks.write_text(tracks.read_text().replace("30.0,-5.0", "31.0,-5.0"))
    (after,) = load_recordings(tmp_path / "files", "ind", cache=cache)
    assert before.position[2, 0] == 30.0
    assert after.position[2, 0] == 31.0


@pytest.mark.parametrize("damage", ["cut", "bits", "gone", "index", "format"])
def test_a_damaged_entry_is_computed_again_with_a_warning(tmp_path, caplog, damage):
    cache = RecordingCache(tmp_path)
    plain = dataset(None)
    dataset(cache)
    for entry in entries(tmp_path):
        file = sorted(entry.glob("*.npy"))[0]
        if damage == "cut":
            os.truncate(file, file.stat().st_size // 2)
        elif damage == "bits":
            content = bytearray(file.read_bytes())
            content[-3] ^= 0x10
            file.write_bytes(bytes(content))
        elif damage == "gone":
            file.unlink()
        elif damage == "index":
            (entry / "entry.json").write_text("{")
        else:
            file.write_bytes(b"no numbers")
    assert_same(plain, dataset(cache))
    assert len(caplog.messages) == 3
    assert all("is damaged and computed again" in message for message in caplog.messages)
    caplog.clear()
    assert_same(plain, dataset(cache))
    assert not caplog.messages


@pytest.mark.parametrize(
    "damage",
    [
        lambda entry: (entry / "a.npy").write_bytes(b""),  # as after a loss of power
        lambda entry: (entry / "a.npy").write_bytes(b"\x93NUMPY\x01\x00\xff\xff{"),
        lambda entry: (entry / "entry.json").write_text('{"columns": {}}'),
        lambda entry: (entry / "entry.json").write_text('{"columns": 3}'),
        lambda entry: (entry / "entry.json").write_bytes(b"\xff"),
        lambda entry: (entry / "entry.json").write_text("[" * 100_000),
    ],
    ids=["empty", "header", "no columns", "number", "no text", "deep"],
)
def test_damage_of_any_kind_is_a_warning(tmp_path, caplog, damage):
    def make():
        return {"a": np.arange(3.0)}

    cache = RecordingCache(tmp_path)
    cache.entry({"what": "test"}, make, code=())
    (entry,) = entries(tmp_path)
    damage(entry)
    np.testing.assert_array_equal(cache.entry({"what": "test"}, make, code=())["a"], [0, 1, 2])
    assert "is damaged and computed again" in caplog.text
    assert cache.entry({"what": "test"}, make, code=()).keys() == {"a"}
    assert len(caplog.messages) == 1


def test_a_folder_that_cannot_be_written_is_a_warning(tmp_path, caplog):
    (tmp_path / "file").write_text("")
    assert_same(dataset(None), dataset(RecordingCache(tmp_path / "file" / "cache")))
    assert "cannot be used: Not a directory" in caplog.messages[0]


def test_of_several_processes_one_makes_an_entry(tmp_path):
    context = multiprocessing.get_context("spawn")
    made = context.Value("i", 0)
    folder = tmp_path / "cache"
    processes = [context.Process(target=make_and_count, args=(folder, made)) for _ in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    assert [process.exitcode for process in processes] == [0] * 4
    assert made.value == 1
    assert len(entries(folder)) == 1


def test_nothing_is_left_of_an_entry_whose_making_fails(tmp_path):
    def fail():
        raise RuntimeError("no")

    with pytest.raises(RuntimeError):
        RecordingCache(tmp_path / "cache").entry({}, fail, code=())
    assert entries(tmp_path / "cache") == []


def test_an_entry_says_what_it_is(tmp_path):
    write_highd(tmp_path / "files")
    load_recordings(tmp_path / "files", "highd", cache=RecordingCache(tmp_path / "cache"))
    (entry,) = entries(tmp_path / "cache")
    facts = json.loads((entry / "entry.json").read_text())
    assert (facts["what"], facts["layout"], facts["name"]) == ("recordings", "highd", "01")


def test_the_default_folder_follows_xdg(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_folder() == tmp_path / "mtpgo"
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("HOME", "/home/user")
    assert str(default_folder()) == "/home/user/.cache/mtpgo"
