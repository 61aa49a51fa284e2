# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A fleet's own bags are training data: from the bags to scores, through the command line."""

import dataclasses
import json

import numpy as np
import pytest
import yaml
from backports import zstd
from fleet import write_bag
from odd_bags import EPOCH_NS, S_NS, states_at, write_stream
from traffic import braking_cars

from msg_adapters.bags import stored_bag
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import RecordingError
from mtpgo_core.frames import Pose2
from mtpgo_training import cli
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.writers.ind_writer import write_ind

SMALL = {
    "num_threads": 1,
    "data": {"stride_s": 0.4, "restart_probability": 0.2, "validation": ["bags/quiet"]},
    "scene": {"max_neighbours": 3},
    "model": {
        "hidden": 8,
        "modes": 2,
        "horizon_steps": 10,
        "layer": "graphconv",
        "integrator": "euler",
        "ode_hidden": 4,
    },
    "optimisation": {"epochs": 4, "batch_scenes": 16},
}


def driving(time_s):
    """Pose of the vehicle that observed the objects."""
    return Pose2(x=480.0 + 3.0 * time_s, y=-190.0, yaw=0.3 + 0.05 * time_s)


def cars(seed, rate, **changes):
    return braking_cars(seed=seed, rate=rate, seconds=6.0, **{"tracks": 6, **changes})


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Bags of several kinds, rates and defects, and a recording in files."""
    folder = tmp_path_factory.mktemp("fleet")
    bags = folder / "bags"
    write_bag(bags / "jitter.mcap", cars(1, 25.0), jitter_s=0.02)
    write_bag(bags / "gaps", cars(2, 10.0), kind="autoware", topic="/perception/tracked",
              missing=[(2.0, 2.7), (4.0, 4.3)])  # fmt: skip
    write_bag(bags / "one.mcap", cars(3, 20.0, tracks=1), kind="derived")
    write_bag(bags / "moving", cars(4, 25.0), frame="base_link", pose=driving)
    write_bag(bags / "quiet.mcap", cars(5, 25.0), kind="vision")
    write_ind(cars(6, 12.5), folder / "files")
    return folder


def call(*arguments):
    return cli.main([str(a) for a in arguments])


@pytest.fixture(scope="module")
def trained(fleet, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    (folder / "config.yaml").write_text(yaml.safe_dump(SMALL))
    status = call("train", folder / "config.yaml", "--data", fleet / "bags", "--layout", "bag",
                  "--data", fleet / "files", "--layout", "ind", "--out", folder / "run",
                  "--cache", folder / "cache", "--quiet")  # fmt: skip
    assert status == 0
    return folder


def test_each_bag_is_a_recording_of_the_training(trained):
    splits = json.loads((trained / "run" / "run.json").read_text())["splits"]
    assert {entry["name"]: (entry["layout"], entry["split"]) for entry in splits} == {
        "gaps": ("bag", "train"),
        "jitter": ("bag", "train"),
        "moving": ("bag", "train"),
        "one": ("bag", "train"),
        "01": ("ind", "train"),
        "quiet": ("bag", "validation"),
    }
    assert all(len(entry["sha256"]) == 64 for entry in splits)
    assert any((trained / "cache").iterdir())


def test_the_trained_model_is_scored_on_bags(trained, fleet, tmp_path):
    model, scores = tmp_path / "model.pt", tmp_path / "scores.json"
    assert call("export", trained / "run", "-o", model) == 0
    status = call("evaluate", "--model", model, "--data", fleet / "bags", "--layout", "bag",
                  "--recordings", "jitter", "moving", "--no-centre", "--stride", "1.0",
                  "--json", scores, "--quiet")  # fmt: skip
    assert status == 0
    models = json.loads(scores.read_text())["models"]
    assert models["cv"]["all"]["n"] == models["model"]["all"]["n"] > 20
    assert np.isfinite(models["model"]["all"]["ade"])


def test_objects_in_the_vehicles_frame_are_transformed(fleet):
    (moving,) = load_recordings(fleet / "bags", "bag", ["moving"])
    truth = cars(4, 25.0)
    np.testing.assert_allclose(moving.position, truth.position, atol=2e-3)
    np.testing.assert_allclose(moving.velocity, truth.velocity, atol=1e-3)
    np.testing.assert_allclose(moving.yaw, truth.yaw, atol=1e-3)


@pytest.mark.parametrize("kind", INPUTS)
def test_every_kind_can_be_trained_on(tmp_path, kind):
    write_bag(tmp_path / "bag.mcap", cars(1, 10.0), kind=kind)
    (recording,) = load_recordings(tmp_path, "bag")
    assert len(recording) == len(cars(1, 10.0))
    assert recording.frame_rate == 10.0


def test_the_predictors_own_output_is_not_taken_for_objects(tmp_path):
    kind = INPUTS["pointcloud2"]
    one = next(braking_cars(tracks=1, seed=1).states())

    def output(bag, stamp_ns):
        if "/a/predictions" not in bag._connections:
            bag.add_topic("/a/predictions", kind.message_type)
        cloud = kind.from_states(one, bag.types)
        for name, field in zip(("mode", "step"), cloud.fields[-2:], strict=True):
            field.name = name  # predictions have such fields and tracked objects do not
        bag.write("/a/predictions", stamp_ns, cloud)

    path = write_bag(tmp_path / "bag.mcap", cars(1, 10.0), topic="/tracks", extra=output)
    (recording,) = load_recordings(path, "bag")
    assert len(recording) == len(cars(1, 10.0))


def test_objects_before_and_after_the_odometry_are_left_out(tmp_path):
    path = write_bag(
        tmp_path / "bag.mcap", cars(1, 10.0), frame="base_link", pose=driving, until_s=3.0
    )
    (recording,) = load_recordings(path, "bag")
    assert 2.9 < recording.duration_s < 3.3


def test_missing_odometry_is_reported_with_the_reason(tmp_path, capsys):
    path = write_bag(
        tmp_path / "bag.mcap", cars(1, 10.0), frame="base_link", pose=driving, shift_s=60.0
    )
    status = call("convert", "bag", path, "-o", tmp_path / "out.mcap")
    error = capsys.readouterr().err
    assert status == 2
    assert "has no tracked object on its topic /objects: the nearest pose to" in error
    assert error.count("\n") == 1


def test_bags_of_any_name_and_links_to_bags_are_recordings(tmp_path):
    write_bag(tmp_path / "a.mcap", cars(1, 10.0))
    whole = load_recordings(tmp_path / "a.mcap", "bag")[0]
    stored = (tmp_path / "a.mcap").rename(tmp_path / "5f70")
    (chosen,) = load_recordings(stored, "bag")
    assert (chosen.name, chosen.sha256) == ("5f70", whole.sha256)
    links = tmp_path / "links"
    links.mkdir()
    for name in ("monday", "tuesday"):
        (links / f"{name}.mcap").symlink_to(stored)
    assert [r.name for r in load_recordings(links, "bag")] == ["monday", "tuesday"]
    np.testing.assert_array_equal(chosen.position, whole.position)


def test_a_bag_that_lies_beside_its_compressed_copy_is_one_recording(tmp_path):
    write_bag(tmp_path / "a.mcap", cars(1, 10.0))
    packed = zstd.compress((tmp_path / "a.mcap").read_bytes())
    (tmp_path / "a.mcap.zst").write_bytes(packed)
    (tmp_path / "b.mcap.zst").write_bytes(packed)
    assert [r.name for r in load_recordings(tmp_path, "bag")] == ["a", "b"]


@pytest.mark.parametrize("files", [[], ["drive_0.mcap"]])
def test_a_folder_of_metadata_alone_is_one_sentence(tmp_path, files, capsys):
    (tmp_path / "drive").mkdir()
    about = {"rosbag2_bagfile_information": {"version": 9, "relative_file_paths": files}}
    (tmp_path / "drive" / "metadata.yaml").write_text(yaml.safe_dump(about))
    reason = "No such file or directory" if files else "names no file in its metadata.yaml"
    folder, output = tmp_path / "drive", tmp_path / "out.mcap"
    for command in (
        ["data", folder, "--layout", "bag", "--no-cache"],
        ["convert", "bag", folder, "-o", output],
    ):
        assert call(*command) == 2
        (sentence,) = capsys.readouterr().err.splitlines()
        assert str(folder) in sentence
        assert reason in sentence
    assert not output.exists()


def test_two_sensors_with_stamps_near_each_other_have_no_rate_of_their_own(tmp_path):
    lidar = [(n / 10, states_at(n / 10)) for n in range(20)]
    # Never the same distance from the other's: 0.1207 ms at the least.
    radar = [(t, states_at(t, ids=(8, 9))) for t in (0.0001207 + n * 0.0970003 for n in range(20))]
    messages = sorted([*lidar, *radar], key=lambda message: message[0])
    write_stream(tmp_path / "two.mcap", messages)
    (recording,) = load_recordings(tmp_path, "bag")
    assert recording.frame_rate == 1000.0


def test_links_to_bags_that_are_gone_are_named(tmp_path, caplog):
    (tmp_path / "bags").mkdir()
    link = tmp_path / "bags" / "b.mcap"
    link.symlink_to(tmp_path / "gone.mcap")
    sentence = f"{link} is a link to {tmp_path / 'gone.mcap'}, which does not exist"
    with pytest.raises(RecordingError) as refused:
        load_recordings(tmp_path / "bags", "bag")
    assert str(refused.value) == sentence
    write_stream(tmp_path / "bags" / "a.mcap", [(0.1 * k, states_at(0.1 * k)) for k in range(9)])
    (recording,) = load_recordings(tmp_path / "bags", "bag")
    assert (recording.name, len(recording)) == ("a", 27)
    assert sentence in caplog.text


def test_a_bag_of_empty_messages_is_called_so(tmp_path):
    path = write_stream(
        tmp_path / "a.mcap", [(0.1 * k, states_at(0.1 * k, ids=())) for k in range(9)]
    )
    with pytest.raises(
        RecordingError, match=r"no tracked object .*: its 9 message\(s\) are all empty"
    ):
        load_recordings(path, "bag")


def test_what_is_lost_of_a_bag_is_said_again_from_the_cache(tmp_path, caplog, monkeypatch):
    path = tmp_path / "a.mcap"
    write_stream(path, [(0.1 * k, states_at(0.1 * k)) for k in range(300)])
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    cache = RecordingCache(tmp_path / "cache")
    said = []
    for _ in range(3):
        monkeypatch.setattr(stored_bag, "_told", set())  # as in another process
        caplog.clear()
        load_recordings(path, "bag", cache=cache)
        said.append([record.getMessage() for record in caplog.records])
    assert all(len(sentences) == 1 for sentences in said), said
    assert all(f"{path} is cut off, as when power is lost" in one[0] for one in said)


def test_bags_in_folders_beside_others_are_named(tmp_path, caplog):
    stream = [(0.1 * k, states_at(0.1 * k)) for k in range(9)]
    write_stream(tmp_path / "a.mcap", stream)
    (tmp_path / "notes").mkdir()
    load_recordings(tmp_path, "bag")
    assert not caplog.records
    for day in ("monday", "tuesday"):
        (tmp_path / day).mkdir()
        write_stream(tmp_path / day / "b.mcap", stream)
    (recording,) = load_recordings(tmp_path, "bag")
    assert recording.name == "a"
    assert "the bags in monday, tuesday are passed over, expected one folder" in caplog.text


@pytest.mark.parametrize("factor", [1e3, 1e6])
def test_parts_of_seconds_in_another_unit_are_refused(tmp_path, factor):
    stream = []
    for time_s in (i / 10 for i in range(40)):
        stamp_ns = EPOCH_NS + int(time_s) * S_NS + round(time_s % 1 * S_NS / factor)
        stream.append((time_s, dataclasses.replace(states_at(time_s), stamp_ns=stamp_ns)))
    with pytest.raises(RecordingError, match=r"microseconds or .* in the field of nanoseconds"):
        load_recordings(write_stream(tmp_path / "a.mcap", stream), "bag")
