# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings that cannot be used (one sentence with the place, status 2) and odd ones."""

import numpy as np
import pytest
import yaml
from fleet import write_bag
from traffic import braking_cars

from msg_adapters.bags.mcap_writer import McapWriter
from mtpgo_core.schema import AgentClass
from mtpgo_training import cli
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.scenes.prepared_recording import prepare
from mtpgo_training.scenes.scene_dataset import SceneDataset
from mtpgo_training.training.training_config import DataConfig


def files(folder):
    write_ind(braking_cars("01", seconds=4.0, tracks=3), folder / "data", compress=False)
    return folder / "data"


def tracks_of(folder):
    return files(folder) / "01_tracks.csv"


def edited(folder, edit):
    """A recording whose tracks file has gone through ``edit`` (a list of lines)."""
    path = tracks_of(folder)
    path.write_text("\n".join(edit(path.read_text().splitlines())) + "\n")


def duplicated(folder):
    edited(folder, lambda lines: [*lines[:10], lines[6], *lines[10:]])


def no_rows(folder):
    edited(folder, lambda lines: lines[:1])


def truncated(folder):
    path = tracks_of(folder)
    path.write_text(path.read_text()[:-25])


def a_directory(folder):
    path = tracks_of(folder)
    path.unlink()
    path.mkdir()


def no_rate(folder):
    path = files(folder) / "01_recordingMeta.csv"
    path.write_text(path.read_text().replace(",10,", ",0,"))


def empty(folder):
    (folder / "data").mkdir()


def a_broken_bag(folder):
    (folder / "data").mkdir()
    path = write_bag(folder / "data" / "bag.mcap", braking_cars(seconds=2.0))
    content = bytearray(path.read_bytes())
    content[400:-400:7] = b"\x00" * len(content[400:-400:7])
    path.write_bytes(bytes(content))


def no_bag(folder):
    (folder / "data").mkdir()
    (folder / "data" / "bag.mcap").write_text("no bag")


def a_bag_without_objects(folder):
    (folder / "data").mkdir()
    with McapWriter(folder / "data" / "bag.mcap") as bag:
        bag.add_topic("/objects", "vision_msgs/msg/Detection3DArray")
        bag.write("/objects", 10**18, bag.types.make("vision_msgs/msg/Detection3DArray"))


DEFECTS = {
    duplicated: ("ind", "01_tracks.csv, line 11: track 100 has a second row for frame 9"),
    no_rows: ("ind", "01_tracks.csv has no rows below its header"),
    truncated: ("ind", "01_tracks.csv ends within line "),
    a_directory: ("ind", "01_tracks.csv cannot be read"),
    no_rate: ("ind", "01_recordingMeta.csv, line 2, column 'frameRate': 0, expected frames per"),
    empty: ("ind", "data has no recordings, expected files such as 01_tracks.csv"),
    no_bag: ("bag", "bag.mcap cannot be read as a bag"),
    a_broken_bag: ("bag", "bag.mcap cannot be read as a bag"),
    a_bag_without_objects: ("bag", "bag.mcap has no tracked object on its topic /objects"),
}


@pytest.mark.parametrize("defect", DEFECTS, ids=lambda defect: defect.__name__)
@pytest.mark.parametrize("command", ["train", "train without cache", "evaluate"])
def test_a_defect_is_one_sentence_with_its_place(tmp_path, capsys, command, defect):
    layout, sentence = DEFECTS[defect]
    defect(tmp_path)
    data = ["--data", str(tmp_path / "data"), "--layout", layout]
    if command == "evaluate":
        arguments = ["evaluate", "--model", "default", *data]
    else:
        (tmp_path / "config.yaml").write_text("num_threads: 1\n")
        cache = ["--no-cache"] if "without" in command else ["--cache", str(tmp_path / "cache")]
        arguments = ["train", str(tmp_path / "config.yaml"), *data, *cache,
                     "--out", str(tmp_path / "run")]  # fmt: skip
    assert cli.main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert sentence in captured.err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ({"preset": "highd"}, "data.preset is 'highd', expected one of 'highd_paper'"),
        ({"split": "tracks"}, "data.split is 'tracks', expected one of 'recording', 'time'"),
        ({"source_weight": {"data/02": 1.0}}, "data.source_weight names 'data/02', expected one"),
        ({"split": "time"}, "no block of 60 s (data.block_s) is left for data.train out of 1"),
        (
            {"lane_change_share": 0.5, "split": "time", "block_s": 15.0},
            "no agent changes its lane in",
        ),
    ],
)
def test_a_bad_section_data_is_one_sentence(tmp_path, capsys, data, sentence):
    (tmp_path / "config.yaml").write_text(yaml.safe_dump({"num_threads": 1, "data": data}))
    write_ind(braking_cars("01", seconds=30.0, tracks=3), tmp_path / "data", compress=False)
    status = cli.main(["train", str(tmp_path / "config.yaml"), "--data", str(tmp_path / "data"),
                       "--layout", "ind", "--no-cache",
                       "--out", str(tmp_path / "run")])  # fmt: skip
    error = capsys.readouterr().err
    assert status == 2
    assert sentence in error
    assert error.count("\n") == 1


def test_a_cache_that_cannot_be_made_is_one_sentence(tmp_path, capsys):
    (tmp_path / "config.yaml").write_text("num_threads: 1\n")
    status = cli.main(["train", str(tmp_path / "config.yaml"), "--data", str(files(tmp_path)),
                       "--layout", "ind", "--out", str(tmp_path / "run"),
                       "--cache", str(tmp_path / "config.yaml")])  # fmt: skip
    error = capsys.readouterr().err
    assert status == 2
    assert "--cache is " in error
    assert error.count("\n") == 1


def test_unknown_classes_are_road_users_without_a_class(tmp_path):
    meta = files(tmp_path) / "01_tracksMeta.csv"
    meta.write_text(meta.read_text().replace(",car", ",tram"))
    (recording,) = load_recordings(tmp_path / "data", "ind")
    assert (recording.agent_class == AgentClass.UNKNOWN).all()
    scenes = scenes_of(recording)
    assert len(scenes) > 5
    assert all((scenes[i].static == 0.0).all() for i in range(len(scenes)))


def scenes_of(*recordings):
    from mtpgo_core.task.task_description import HistoryConfig, SceneConfig

    data = DataConfig(restart_probability=0.2)
    sources = [prepare(r, HistoryConfig(), SceneConfig(), data, training=True) for r in recordings]
    return SceneDataset(sources, HistoryConfig(), SceneConfig(), data, 10, seed=1)


def test_one_agent_gaps_and_several_rates_are_masks():
    alone = braking_cars("alone", tracks=1, rate=25.0)
    gaps = braking_cars("gaps", tracks=3, rate=10.0)
    gaps = gaps.select_rows((gaps.frame % 40 < 20) & (gaps.frame != 45))
    slow = braking_cars("slow", tracks=2, rate=5.0)
    odd = braking_cars("odd", tracks=2, rate=12.5)
    scenes = scenes_of(alone, gaps, slow, odd)
    assert {item.source for item in scenes.items} == {0, 1, 2, 3}
    for item, sample in zip(scenes.items, (scenes[i] for i in range(len(scenes))), strict=True):
        assert np.isfinite(sample.x.numpy()).all()
        assert np.isfinite(sample.target.numpy()).all()
        assert sample.num_nodes == 1 or item.source > 0
