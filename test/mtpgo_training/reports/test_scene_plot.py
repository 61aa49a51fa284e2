# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction
from PIL import Image

from mtpgo_training.evaluation.moments import choose_moments
from mtpgo_training.reports.local_view import surroundings
from mtpgo_training.reports.scene_plot import draw_picture


@pytest.fixture
def recording():
    return make_recording()


def played(recording):
    return recording, [perfect_prediction(recording, frame) for frame in range(0, 121, 2)]


def test_the_moment_is_the_one_where_a_car_turns(recording):
    (moment,) = choose_moments([played(recording)], 1)
    assert moment.prediction.key[moment.agent, 0] == 8
    time_s = (moment.prediction.stamp_ns - recording.start_time_ns) * 1e-9
    # The end of the turn is far from the straight path, and 5 s of it are still observed.
    assert 3.0 <= time_s <= 7.0


def test_sites_alternate_and_no_road_user_is_shown_twice():
    one, two = make_recording("a", location="x"), make_recording("b", location="y")
    moments = choose_moments([played(one), played(two)], 4)
    assert [m.recording.name for m in moments] == ["a", "b"]
    assert choose_moments([], 3) == []


def test_surroundings_are_in_the_frame_of_the_focal_road_user(recording):
    prediction = perfect_prediction(recording, 60)
    (moment,) = choose_moments([(recording, [prediction])], 1)
    around = surroundings(moment, past_s=3.0)
    # At 6 s car 8 has turned by 0.6 rad; it is at the origin, heading along +x at 10 m/s.
    assert around.angle == pytest.approx(0.6)
    np.testing.assert_allclose(around.position[1], 0.0, atol=1e-9)
    np.testing.assert_allclose(around.velocity[1], [10.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(around.yaw, [-0.6, 0.0], atol=1e-9)
    assert [len(path) for path in around.past] == [31, 31]
    assert [len(path) for path in around.future] == [51, 51]
    np.testing.assert_allclose(
        around.turn(prediction.mean[1, 0, -1, :2]), around.future[1][-1], atol=1e-9
    )
    # Turned by a right angle, the long axis of an ellipse along x is along -y.
    turned = surroundings(moment, past_s=3.0).turn_covariance(np.diag([4.0, 1.0]))
    assert np.trace(turned) == pytest.approx(5.0)
    expected = 4.0 * np.cos(0.6) ** 2 + np.sin(0.6) ** 2
    assert turned[0, 0] == pytest.approx(expected)


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
