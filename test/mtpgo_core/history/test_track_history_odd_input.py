# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Every odd observation in the table of track_history.py has its outcome and its counter."""

import dataclasses

import numpy as np
import pytest
from core_helpers import states_of

from mtpgo_core.history.track_history import TrackHistory, UpdateReport
from mtpgo_core.identity import key_to_int, keys_from_integers
from mtpgo_core.task.task_description import HistoryConfig

INF, NAN = np.inf, np.nan


def fed(seconds=3.0, ids=(1, 2), rate_hz=10, **options):
    """A history of agents that drive along x at 10 m/s, ten metres apart in y."""
    history = TrackHistory(HistoryConfig(), **options)
    for k in range(round(seconds * rate_hz) + 1):
        history.update(drive(k / rate_hz, ids))
    return history


def drive(t, ids=(1, 2), **more):
    position = np.array([[10.0 * t, 10.0 * i] for i in ids]).reshape(-1, 2)
    return states_of(t, ids, position, velocity=np.tile([10.0, 0.0], (len(ids), 1)), **more)


def ids_of(window):
    return [key_to_int(k) for k in window.key]


def same_windows(first, second):
    for field in dataclasses.fields(first):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name))


def test_nothing_observed_gives_an_empty_window():
    history = TrackHistory(HistoryConfig())
    assert history.newest_stamp_ns is None
    window = history.window()
    assert len(window) == 0
    assert window.position.shape == (0, 16, 2)


def test_an_empty_message_moves_the_time_and_nothing_else():
    history = fed()
    assert history.update(drive(3.2, ids=())) == UpdateReport()
    window = history.window()
    assert window.stamp_ns == 3_200_000_000
    assert window.valid[:, -1].all()
    np.testing.assert_allclose(window.position[:, -1, 0], 32.0)  # carried on


def test_an_empty_message_is_in_no_frame():
    history = TrackHistory(HistoryConfig())
    history.update(dataclasses.replace(drive(0.0, ids=()), frame_id=""))
    assert history.update(drive(0.1)).accepted == 2
    for k in range(4):
        empty = dataclasses.replace(drive(0.2 + 0.1 * k, ids=()), frame_id="")
        assert not history.update(empty).frame_changed
    assert history.window().frame_id == "map"


def test_an_agent_unseen_is_carried_on_half_a_second_and_forgotten_after_the_window():
    history = fed()
    for t, present, known in ((3.5, True, True), (3.6, False, True), (6.4, False, True)):
        history.update(drive(t, ids=(1,)))
        window = history.window()
        assert (2 in ids_of(window)) == (t < 6.1)
        if 2 in ids_of(window):
            assert window.valid[ids_of(window).index(2), -1] == present
        assert (len(history) == 2) == known
    assert history.update(drive(6.6, ids=(1,))).forgotten == 1
    assert len(history) == 1


def test_only_the_common_time_is_extrapolated():
    history = fed()
    history.update(drive(3.45, ids=(1,)))
    window = history.window()
    row = window.valid[ids_of(window).index(2)]
    # Grid times 3.45, 3.25, 3.05, 2.85 ...; the agent was last seen at 3.0.
    assert row[-4:].tolist() == [True, False, False, True]


@pytest.mark.parametrize("bad", [[NAN, 0.0], [0.0, INF], [-INF, NAN], [1e9, 0.0], [1e300, 1e300]])
def test_an_unusable_position_is_rejected_for_that_agent_alone(bad):
    history, clean = fed(), fed()
    states = drive(3.1)
    states.position[0] = bad
    report = history.update(states)
    assert (report.non_finite, report.accepted) == (1, 1)
    clean.update(drive(3.1, ids=(2,)))
    same_windows(history.window(), clean.window())


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
def test_velocity_yaw_and_acceleration_that_are_not_finite_are_estimated(bad):
    history = TrackHistory(HistoryConfig(acceleration_source="message"))
    for k in range(31):
        states = drive(
            k / 10, yaw=np.array([bad, bad]), acceleration=np.array([[bad, 1.0], [1e9, 0.0]])
        )
        states.velocity[:, 0] = bad
        assert history.update(states).accepted == 2
    window = history.window()
    np.testing.assert_allclose(window.velocity, np.tile([10.0, 0.0], (2, 16, 1)), atol=1e-9)
    np.testing.assert_allclose(window.acceleration, 0.0, atol=1e-9)
    np.testing.assert_allclose(window.yaw, 0.0, atol=1e-9)


@pytest.mark.parametrize("speed", [101.0, 1e6, 1e200])
def test_an_absurd_given_speed_is_rejected(speed):
    history = fed()
    states = drive(3.1)
    states.velocity[1] = (0.0, speed)
    report = history.update(states)
    assert (report.too_fast, report.accepted) == (1, 1)
    assert np.isfinite(history.window().velocity[:, -1]).all()


@pytest.mark.parametrize("jump_m", [20.0, 300.0, 1e6])
def test_a_reused_identity_starts_a_new_track(jump_m):
    history = fed()
    states = drive(3.1)
    states.position[0, 1] += jump_m
    report = history.update(states)
    assert (report.restarted, report.accepted, report.new_tracks) == (1, 2, 0)
    window = history.window()
    assert window.valid.sum(axis=1).tolist() == [1, 16]
    assert window.velocity[0, -1].tolist() == [10.0, 0.0]  # the message's, nothing of the past
    np.testing.assert_array_equal(window.acceleration[0, -1], 0.0)


@pytest.mark.parametrize(("jump_m", "restarted"), [(7.0, 0), (8.0, 1), (25.0, 1)])
def test_a_jump_that_no_car_makes_is_found_below_the_highest_speed(jump_m, restarted):
    history = fed()
    states = drive(3.4)  # in 0.4 s: 5 m and 2.4 m by the hardest manoeuvre; 45 m by the speed
    states.position[0, 1] += jump_m
    assert history.update(states).restarted == restarted


@pytest.mark.parametrize(("jump_m", "restarted"), [(14.5, 0), (15.5, 1)])
def test_of_a_track_seen_once_only_the_highest_speed_is_known(jump_m, restarted):
    history = TrackHistory(HistoryConfig())
    history.update(states_of(0.0, [1], [[0.0, 0.0]]))
    assert history.update(states_of(0.1, [1], [[jump_m, 0.0]])).restarted == restarted


def test_jitter_noise_and_hard_braking_do_not_restart_a_track():
    draw = np.random.default_rng(0)
    history = TrackHistory(HistoryConfig())
    x = speed = t = 0.0
    for k in range(600):
        dt = draw.uniform(0.001, 0.02)
        speed = min(40.0, speed + 4.0 * dt) if k < 400 else max(0.0, speed - 9.0 * dt)
        t, x = t + dt, x + speed * dt
        noisy = np.array([[x, 0.0]]) + draw.normal(scale=0.3, size=2)
        report = history.update(states_of(t, [1], noisy, velocity=[[0.0, 0.0]]))
        assert (report.restarted, report.accepted) == (0, 1)


def test_a_duplicate_stamp_is_dropped_but_other_agents_of_that_stamp_are_taken():
    history = fed()
    before = history.window()
    assert history.update(drive(3.0)) == UpdateReport(duplicates=2)
    same_windows(history.window(), before)
    report = history.update(drive(3.0, ids=(2, 3)))  # a second sensor at the same instant
    assert (report.duplicates, report.accepted, report.new_tracks) == (1, 1, 1)


def test_the_same_agent_twice_in_a_message_counts_once():
    history = TrackHistory(HistoryConfig())
    states = states_of(0.0, [5, 6, 5, 5], [[NAN, 0], [1, 1], [2, 2], [3, 3]])
    report = history.update(states)
    assert (report.accepted, report.duplicate_keys, report.non_finite) == (2, 1, 1)
    window = history.window()
    assert ids_of(window) == [5, 6]
    assert window.position[0, -1].tolist() == [2.0, 2.0]  # the first usable one


def test_a_late_message_is_dropped_where_the_track_is_newer():
    history = fed()
    before = history.window()
    assert history.update(drive(2.55)) == UpdateReport(late=2)
    same_windows(history.window(), before)
    history.update(drive(3.2, ids=(1,)))
    report = history.update(drive(3.1))  # agent 2 was last seen at 3.0
    assert (report.late, report.accepted) == (1, 1)
    assert history.newest_stamp_ns == 3_200_000_000


def test_out_of_order_messages_give_what_the_ones_in_order_give():
    history, clean = TrackHistory(HistoryConfig()), TrackHistory(HistoryConfig())
    late = 0
    for k in range(40):
        t = (k - 2) / 10 if k % 10 == 9 else k / 10
        late += history.update(drive(t)).late
        if k % 10 != 9:
            clean.update(drive(t))
    assert late == 8
    same_windows(history.window(), clean.window())


def test_a_jump_back_beyond_the_window_forgets_the_past_at_once():
    history = fed(seconds=10.0)
    report = history.update(drive(1.0))
    assert report.clock_reset
    assert report.accepted == 2
    assert history.newest_stamp_ns == 1_000_000_000
    assert history.window().valid.sum() == 2


def test_a_smaller_jump_back_is_believed_at_the_third_message():
    history = fed(seconds=2.0)
    reports = [history.update(drive(0.1 * k)) for k in range(4)]
    assert [r.clock_reset for r in reports] == [False, False, True, False]
    assert [r.late for r in reports] == [2, 2, 0, 0]
    assert history.newest_stamp_ns == 300_000_000


def test_a_row_of_messages_that_are_a_little_late_does_not_reset_the_clock():
    history = fed()
    reports = [history.update(drive(2.55 + 0.01 * k)) for k in range(6)]
    assert [r.late for r in reports] == [2] * 6
    assert not any(r.clock_reset for r in reports)


def test_one_slow_sensor_among_fast_ones_does_not_reset_the_clock():
    history = fed()
    for k in range(1, 20):
        assert not history.update(drive(3.0 + 0.1 * k)).clock_reset
        assert not history.update(drive(2.3 + 0.1 * k, ids=(7,))).clock_reset
    assert len(history) == 3


def test_a_looped_recording_is_served_like_the_first_time():
    once, looped = fed(seconds=5.0), fed(seconds=5.0)
    for k in range(51):
        looped.update(drive(k / 10))
    same_windows(looped.window(), once.window())


def test_one_message_in_another_frame_is_rejected_and_survived():
    history = fed()
    before = history.window()
    odd = dataclasses.replace(drive(3.1), frame_id="base_link")
    assert history.update(odd) == UpdateReport(frame_changed=True, wrong_frame=2)
    same_windows(history.window(), before)
    assert history.update(drive(3.2)).accepted == 2
    assert history.window().frame_id == "map"


def test_a_stream_that_has_changed_its_frame_starts_anew_at_the_third_message():
    history = fed()
    reports = [
        history.update(dataclasses.replace(drive(3.0 + 0.1 * k), frame_id="odom"))
        for k in range(1, 5)
    ]
    assert [r.accepted for r in reports] == [0, 0, 2, 2]
    assert [r.frame_changed for r in reports] == [True, True, True, False]
    window = history.window()
    assert window.frame_id == "odom"
    assert window.valid.sum() == 2  # 3.3 lies between the grid times 3.4 and 3.2
    assert (window.position[:, -1, 0] == 34.0).all()


def test_a_stream_that_names_a_new_frame_each_time_is_not_believed():
    history = fed()
    for k, frame in enumerate(["odom", "base_link"] * 4):
        odd = dataclasses.replace(drive(3.1 + 0.1 * k), frame_id=frame)
        assert history.update(odd).wrong_frame == 2
    assert history.update(drive(4.0)).accepted == 2


def test_two_publishers_in_two_frames_leave_the_first_one_served():
    history = fed()
    for k in range(1, 10):
        assert history.update(drive(3.0 + 0.1 * k)).accepted == 2
        odd = dataclasses.replace(drive(3.05 + 0.1 * k), frame_id="odom")
        assert history.update(odd).wrong_frame == 2
    assert history.frame_id == "map"


def test_a_thousand_objects_are_all_kept():
    ids = np.arange(1000)
    history = fed(seconds=1.0, ids=ids)
    window = history.window()
    assert ids_of(window) == ids.tolist()
    np.testing.assert_allclose(window.position[:, -1, 1], 10.0 * ids)
    assert window.valid[:, -6:].all()


def test_beyond_the_bound_the_longest_unseen_go_and_then_the_farthest():
    history = TrackHistory(HistoryConfig(), max_tracks=10)
    for i in range(10):
        history.update(drive(0.01 * i, ids=(i,)))
    report = history.update(drive(0.2, ids=(0, 20, 21, 22)))
    assert (report.accepted, report.new_tracks, report.dropped) == (4, 3, 3)
    assert ids_of(history.window()) == [0, 4, 5, 6, 7, 8, 9, 20, 21, 22]
    report = history.update(drive(0.3, ids=range(30, 45)))
    # The nearest to the middle are kept, whatever their order; the ten before are evicted.
    assert (report.accepted, report.left_out, report.dropped) == (10, 5, 10)
    assert ids_of(history.window()) == list(range(32, 42))


def test_too_many_objects_are_kept_by_distance_to_the_ego():
    history = TrackHistory(HistoryConfig(), max_tracks=10)
    ego = keys_from_integers([3])[0]
    order = np.random.default_rng(0).permutation(100)
    report = history.update(drive(0.0, ids=order), ego)
    assert (report.accepted, report.left_out) == (10, 90)
    assert ids_of(history.window()) == list(range(10))


def test_one_position_far_away_does_not_move_the_middle():
    history = TrackHistory(HistoryConfig(), max_tracks=3)
    states = states_of(0.0, range(6), [[0.0, 10.0 * i] for i in (0, 1, 2, 3, 4)] + [[9e7, 9e7]])
    history.update(states)
    assert ids_of(history.window()) == [1, 2, 3]


def test_slots_are_used_again_without_a_trace_of_their_last_owner():
    history = TrackHistory(HistoryConfig(), max_tracks=5)
    for k in range(300):
        ids = [k % 7, 1000 + k]
        report = history.update(states_of(0.1 * k, ids, [[k % 7, 5.0], [50.0, 1.0 * k]]))
        assert report.accepted == 2
        window = history.window()
        newest = ids_of(window).index(1000 + k)
        assert window.valid[newest].sum() == 1
    assert len(history) <= 5


def test_one_agent_never_changes_another_ones_history():
    draw = np.random.default_rng(1)
    alone, crowd = TrackHistory(HistoryConfig()), TrackHistory(HistoryConfig())
    for k in range(120):
        t = 0.05 * k
        position = np.array([[3.0 * t, np.sin(t)]])
        alone.update(states_of(t, [500], position))
        others = draw.choice(400, 60, replace=False)
        wild = draw.choice([0.0, 1e3, NAN, INF, 1e12], (60, 2)) + draw.normal(size=(60, 2))
        ids = np.concatenate([others, [500], others[:5]])
        everything = np.concatenate([wild, position, wild[:5]])
        crowd.update(states_of(t, ids, everything))
    mine = crowd.window()
    row = ids_of(mine).index(500)
    same_windows(alone.window(), mine.select(np.array([row])))


def test_observations_too_old_to_be_carried_on_to_the_newest_stamp_are_counted():
    """Of a second publisher whose clock is behind by more than half a second."""
    history = fed()
    behind = []
    for k in range(1, 5):
        assert history.update(drive(3.0 + 0.1 * k)).behind == 0
        behind.append(history.update(drive(2.4 + 0.1 * k, ids=(7, 8))))
    assert [(r.accepted, r.behind, r.late) for r in behind] == [(2, 2, 0)] * 4
    window = history.window()
    assert ids_of(window.select(window.valid[:, -1])) == [1, 2]
    assert history.update(drive(2.95, ids=(9,))).behind == 0
