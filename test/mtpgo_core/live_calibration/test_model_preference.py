# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Constant velocity takes over where it has been better for long enough, and gives back."""

import numpy as np

from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.model_preference import ModelPreference

OPTIONS = LiveOptions(prefer="best", prefer_time_s=20.0, prefer_agents=3)
MOVING = 1


def pass_time(preference, seconds, model_m, cv_m, agents=3):
    """Report errors of vehicles once a second; return when the preference changed (s)."""
    changed = []
    for second in range(seconds):
        before = preference.constant_velocity[MOVING]
        error_m = np.tile([model_m, cv_m], (agents, 1))
        preference.update(1.0, np.arange(agents), np.full(agents, MOVING), error_m)
        if preference.constant_velocity[MOVING] != before:
            changed.append(second)
    return changed


def test_takes_over_after_the_time_and_gives_back_after_the_time():
    preference = ModelPreference(OPTIONS)
    assert pass_time(preference, 60, 2.0, 1.0) == [19]
    assert preference.constant_velocity.sum() == 1  # no other group
    back = pass_time(preference, 120, 1.0, 2.0)
    assert len(back) == 1
    assert back[0] >= 19
    assert not preference.constant_velocity.any()


def test_a_short_while_or_a_small_difference_changes_nothing():
    preference = ModelPreference(OPTIONS)
    for _ in range(5):
        pass_time(preference, 15, 1.2, 1.0)
        pass_time(preference, 30, 1.0, 2.0)
    pass_time(preference, 200, 1.0, 0.99)
    assert not preference.constant_velocity.any()


def test_less_than_a_tracker_knows_changes_nothing():
    preference = ModelPreference(OPTIONS)
    assert pass_time(preference, 200, 1e-6, 1e-7) == pass_time(preference, 200, 0.011, 0.002) == []
    assert len(pass_time(preference, 200, 0.03, 0.015)) == 1
    assert pass_time(preference, 200, 0.01, 0.015) == []
    assert len(pass_time(preference, 200, 0.015, 0.03)) == 1


def test_too_few_road_users_change_nothing():
    preference = ModelPreference(OPTIONS)
    pass_time(preference, 200, 2.0, 1.0, agents=2)
    assert not preference.constant_velocity.any()
    assert preference.agents[MOVING] == 2


def test_road_users_are_counted_for_the_time_of_the_preference():
    preference = ModelPreference(OPTIONS)
    pass_time(preference, 1, 2.0, 1.0, agents=2)
    pass_time(preference, 20, 2.0, 1.0, agents=1)
    assert preference.agents[MOVING] == 2  # the other was seen 20 s ago
    pass_time(preference, 1, 2.0, 1.0, agents=1)
    assert preference.agents[MOVING] == 1


def test_rows_without_the_model_do_not_count():
    preference = ModelPreference(OPTIONS)
    pass_time(preference, 100, np.nan, 1.0)
    assert np.isnan(preference.error_m).all()
