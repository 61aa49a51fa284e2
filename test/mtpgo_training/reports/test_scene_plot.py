# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import dataclasses

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction
from matplotlib.figure import Figure
from PIL import Image

from mtpgo_training.evaluation.moments import choose_moments
from mtpgo_training.reports.local_view import surroundings
from mtpgo_training.reports.scene_plot import _draw_scale, _legend, draw_picture


@pytest.fixture
def recording():
    return make_recording()


def played(recording):
    return recording, [perfect_prediction(recording, frame) for frame in range(0, 121, 2)]


def test_the_legend_names_the_ground_and_what_others_did(recording):
    def labels(*scenes):
        return {entry.get_label() for entry in _legend(scenes)}

    (moment,) = choose_moments([played(recording)], 1)
    bare = surroundings(moment, 3.0)
    mapped = dataclasses.replace(bare, lanes=[np.zeros((2, 2))])
    paths = "paths of all, over the recording"
    assert {"what others did", paths} <= labels(bare)
    assert "lanes" not in labels(bare)
    assert "lanes" in labels(mapped)
    assert paths not in labels(mapped)
    assert {"lanes", paths} <= labels(bare, mapped)


def test_the_scale_has_a_ground_above_the_vehicles():
    axes = Figure().add_subplot()
    _draw_scale(axes, np.zeros(2), np.array([100.0, 40.0]))
    (ground,), (bar,), (text,) = axes.patches, axes.lines, axes.texts
    assert 20 < ground.get_zorder() < bar.get_zorder() == text.get_zorder()
    (left, low), (right, high) = ground.get_bbox().get_points()
    assert left < bar.get_xdata()[0] < bar.get_xdata()[1] < right
    assert low < bar.get_ydata()[0] < text.get_position()[1] < high


def test_the_picture_is_written_whole(recording, tmp_path):
    moments = choose_moments([played(recording)], 3)
    path = tmp_path / "prediction.png"
    draw_picture(moments, path)
    with Image.open(path) as image:
        assert image.format == "PNG"
        assert image.width == 1650
        colours = image.convert("RGB").getcolors(maxcolors=1 << 24)
    shown = {colour for _, colour in colours}
    # The focal road user's body, the true future and constant velocity are on it.
    assert {(0xE0, 0x7B, 0x16), (0x1A, 0x1A, 0x1A), (0xC0, 0x39, 0x2B)} <= shown
    assert list(tmp_path.iterdir()) == [path]
