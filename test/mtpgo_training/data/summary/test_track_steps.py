# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Steps between the rows of tracks."""

import numpy as np
from traffic import braking_cars

from mtpgo_training.data.summary.track_steps import TrackSteps


def test_steps_join_rows_of_one_track_in_time():
    recording = braking_cars(tracks=3, seconds=3.0)
    recording = recording.select_rows((recording.track != 1) | (recording.frame % 3 == 0))
    steps = TrackSteps.of(recording)
    assert len(steps.dt_s) == len(recording) - 3
    np.testing.assert_array_equal(recording.track[steps.before], recording.track[steps.after])
    np.testing.assert_allclose(steps.dt_s, np.where(steps.track == 1, 0.3, 0.1))
    np.testing.assert_allclose(steps.speed_mps * steps.dt_s, np.linalg.norm(steps.move, axis=1))
    np.testing.assert_allclose(np.linalg.norm(steps.velocity, axis=1), steps.speed_mps, rtol=0.01)
