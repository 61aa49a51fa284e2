# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import pytest
from demo_traffic import make_recording, perfect_prediction
from PIL import Image

from mtpgo_training.evaluation.moments import choose_moments
from mtpgo_training.reports.scene_plot import draw_picture


@pytest.fixture
def recording():
    return make_recording()


def played(recording):
    return recording, [perfect_prediction(recording, frame) for frame in range(0, 121, 2)]


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
