# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a track may change is bounded."""

import numpy as np
import pytest

from mtpgo_core.live_calibration.track_limits import TrackLimits

MEMORY_S = 60.0


def granted(limits, track, change, limit=1.0):
    tracks, row = np.unique(track, return_inverse=True)
    place = np.zeros(len(track), dtype=np.intp)
    return limits.limited(
        tracks, row, place, np.array(change, dtype=float), np.full(len(track), limit)
    )


def test_changes_beyond_the_limit_are_cut_off():
    limits = TrackLimits(1)
    np.testing.assert_allclose(granted(limits, [5, 3], [0.8, 0.2]), [0.8, 0.2])
    np.testing.assert_allclose(granted(limits, [3, 5], [0.2, 0.8]), [0.2, 0.2])
    np.testing.assert_allclose(granted(limits, [5], [0.8]), [0.0])
    np.testing.assert_allclose(granted(limits, [5], [-2.5]), [-2.0])


def test_several_changes_of_a_track_share_the_limit():
    limits = TrackLimits(1)
    np.testing.assert_allclose(granted(limits, [1, 1], [1.0, 3.0]), [0.25, 0.75])


def test_changes_are_forgotten_and_so_are_tracks():
    limits = TrackLimits(1)
    granted(limits, [1], [1.0])
    limits.pass_time(60.0, MEMORY_S)
    assert granted(limits, [1], [1.0])[0] == pytest.approx(1.0 - np.exp(-1.0))
    limits.pass_time(301.0, MEMORY_S)
    assert len(limits) == 0


def test_more_tracks_than_there_is_room_for_and_rows_that_are_used_again():
    limits = TrackLimits(1)
    tracks = np.arange(3000)
    np.testing.assert_allclose(granted(limits, tracks, np.full(3000, 0.8)), 0.8)
    np.testing.assert_allclose(granted(limits, tracks[::-1], np.full(3000, 0.8)), 0.2)
    limits.pass_time(301.0, MEMORY_S)
    assert len(limits) == 0
    np.testing.assert_allclose(granted(limits, tracks + 3000, np.full(3000, 1.5)), 1.0)
    assert len(limits) == 3000
