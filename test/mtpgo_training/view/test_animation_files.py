# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Animations, read back."""

import dataclasses
import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.view import animation_files
from mtpgo_training.view.animation_files import ffmpeg_path, write_animation
from mtpgo_training.view.scene_frames import LANE, ScenePainter
from mtpgo_training.view.view_scene import view_scene


@pytest.fixture(scope="module")
def short(recording, scene):
    predictions = [one.prediction for one in scene.predictions]
    return view_scene(recording, predictions, name="short", end_s=0.4)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(animation_files, "WIDTH", {"gif": 240, "mp4": 240})


@pytest.mark.parametrize("name", ["a.gif", "a.webp"])
def test_an_animation_moves(short, tmp_path, name):
    write_animation(short, tmp_path / name, "gif")
    with Image.open(tmp_path / name) as image:
        assert (image.n_frames, image.width) == (5, 240)
        first = np.asarray(image.convert("RGB"))
        image.seek(4)
        assert (np.asarray(image.convert("RGB")) != first).any(axis=-1).mean() > 0.001
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 10


def test_lanes_are_drawn(short):
    lane = np.array([[-100.0, -12.0], [100.0, -12.0]])
    recording = dataclasses.replace(short.recording, lanes=(lane,))
    with_lanes = ScenePainter(dataclasses.replace(short, recording=recording), 240)
    colour = np.array([int(LANE[place : place + 2], 16) for place in (1, 3, 5)])

    def like_lanes(painter):
        return (np.abs(next(painter.pictures()).astype(int) - colour).max(axis=-1) < 12).sum()

    assert like_lanes(with_lanes) > 5 * like_lanes(ScenePainter(short, 240)) > 0


def test_a_road_user_far_away_does_not_empty_the_picture(short):
    def drawn(recording):
        (first, *_) = ScenePainter(dataclasses.replace(short, recording=recording), 240).pictures()
        return first

    ghost = short.recording.position.copy()
    ghost[short.recording.track == 1] += 1e5
    without = short.recording.position.copy()
    without[short.recording.track == 1] = np.nan
    seen, alone = (
        drawn(dataclasses.replace(short.recording, position=p)) for p in (ghost, without)
    )
    ground = alone[0, 0]
    assert (alone != ground).any(axis=-1).sum() > 100
    assert (seen != ground).any(axis=-1).sum() > 100


def test_a_film_has_the_frames(short, tmp_path):
    try:
        program = ffmpeg_path()
    except ConfigurationError:
        pytest.skip("no ffmpeg is installed")
    write_animation(short, tmp_path / "a.mp4", "mp4")
    read = subprocess.run(
        [program, "-i", str(tmp_path / "a.mp4"), "-f", "null", "-"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "frame=5" in read.stderr.replace(" ", "")


def test_a_machine_without_ffmpeg_is_told_the_extra(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(ConfigurationError, match=r"extra 'view': pip install 'mtpgo_ros\[view\]'"):
        ffmpeg_path()


def test_what_ffmpeg_says_is_the_error(short, tmp_path, monkeypatch):
    monkeypatch.setattr(animation_files, "ffmpeg_path", lambda: "false")
    with pytest.raises(ConfigurationError, match="ffmpeg failed: no reason is given"):
        write_animation(short, tmp_path / "a.mp4", "mp4")
    assert not list(tmp_path.iterdir())
