# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From an observation to the window of a due prediction, without ROS and without a model."""

import dataclasses

import pytest
from ros_helpers import START_NS, traffic

from mtpgo_core.history.odd_input import ODD_INPUT
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.prediction.output_assembly import with_time_origin
from mtpgo_core.prediction.scene_predictor import ScenePredictor
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.node.history_input import HistoryInput
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.runtime.receipt_clock import Receipt
from mtpgo_ros.runtime.sender_clock import SenderClock


@pytest.fixture
def make():
    def make(**values):
        parameters = dataclasses.replace(PredictorParameters(), **values)
        events = EventLog()
        predictor = ScenePredictor(None)
        return (
            HistoryInput(TrackHistory(predictor.task.history), predictor, events, parameters),
            events,
            predictor,
        )

    return make


def at(time_s):
    return START_NS + round(time_s * 1e9)


def test_due_observations_give_a_window_at_their_time(make):
    history, events, _ = make()
    windows = [history.update(traffic(k / 10), at(k / 10)) for k in range(5)]
    assert [window is not None for window in windows] == [True, False, True, False, True]
    assert windows[4].stamp_ns == at(0.4)
    assert windows[4].valid[:, -3:].all()
    assert not windows[4].valid[:, :-3].any()
    assert not events.counts()


def test_before_the_first_object_the_frame_is_that_of_the_message(make):
    history, _, _ = make()
    frames = [
        history.update(traffic(0.2 * k, agents, frame_id=frame), at(0.2 * k)).frame_id
        for k, (agents, frame) in enumerate([(0, "odom"), (0, ""), (2, "map"), (0, "")])
    ]
    assert frames == ["odom", "", "map", "map"]
    history.reset()
    assert history.update(traffic(0.9, 0, frame_id="odom"), at(0.9)).frame_id == "odom"


def test_delay_compensation_gives_the_window_at_the_present_time(make):
    history, events, predictor = make(delay_compensation=True)
    window = history.update(traffic(0.0), at(0.3))
    assert window.stamp_ns - at(0.0) == 300_000_000
    assert window.position[:, -1, 0] == pytest.approx([3.0, 15.0, 27.0, 39.0])
    prediction = with_time_origin(predictor.predict(window), at(0.0))
    assert prediction.stamp_ns == at(0.0)
    assert prediction.time_s[:2] == pytest.approx([0.5, 0.7])
    assert prediction.mean[0, 0, :2, 0] == pytest.approx([5.0, 7.0])
    assert prediction.initial[:, 0] == pytest.approx([0.0, 12.0, 24.0, 36.0])  # at the stamp
    # A clock behind the stamp gives no negative delay, one far ahead gives none at all.
    assert history.update(traffic(1.0), at(0.9)).stamp_ns == at(1.0)
    assert history.update(traffic(2.0), at(2.6)).stamp_ns == at(2.0)
    assert events.counts() == {"delay_not_compensated": 1}


def test_stamps_from_the_future_are_reported_with_how_far_ahead_they_are(make):
    history, events, _ = make()
    for k, ahead_s in enumerate((20.0, 20.0, 20.0, 21.5)):  # accepted from the third on
        history.update(traffic(k + ahead_s), at(k))
        (said,) = [text for text in events.recent(ODD_INPUT) if "ahead of the clock" in text]
        assert said == f"messages ahead of the clock (by {ahead_s:.1f} s; {k + 1} in all)"


@pytest.mark.parametrize(("scale", "doubts"), [(1.0, []), (3.6, ["velocities"])])
def test_a_compensated_delay_hides_nothing_from_the_checks_and_makes_up_nothing(
    make, scale, doubts
):
    history, _, _ = make(delay_compensation=True)
    for k in range(200):
        states = traffic(k / 10)
        states.velocity[:] *= scale
        history.update(states, at(k / 10 + 0.45))
    assert list(history.checks.doubts) == doubts


def test_an_ego_that_gets_another_identity_is_not_carried_on_under_the_old_one(make):
    history, _, _ = make()
    keys = keys_from_integers([1, 2, 3])

    def known(time_s, ego, *, with_ego=True):
        """Return the road users after a message of which the last one is the ego."""
        states = traffic(time_s, 2)
        states.key[1] = keys[ego]
        window = history.update(states, at(time_s), keys[ego], with_ego=with_ego)
        return window.key[window.valid[:, -1], 0].tolist()

    assert known(0.0, 1) == [1, 2]
    assert known(0.2, 2) == [1, 3]
    # Without odometry the tracker's own objects stay: nothing was added by it.
    assert known(0.4, 1, with_ego=False) == [1, 2]
    assert known(0.6, 2, with_ego=False) == [1, 2, 3]


def test_another_rate_lets_no_observation_of_the_past_start_a_prediction(make):
    """As of a second publisher that is a little behind."""
    history, _, _ = make()
    assert history.update(traffic(0.1), at(0.1)) is not None
    history.configure(dataclasses.replace(PredictorParameters(), rate=20.0))
    other = traffic(0.05)
    other.key[:, 0] += 10
    assert history.update(other, at(0.15)) is None
    assert history.update(traffic(0.15), at(0.15)) is not None


def test_a_node_without_time_uses_stamps_as_they_are(make):
    history, events, _ = make(delay_compensation=True)
    assert history.update(traffic(0.0), 0).stamp_ns == at(0.0)
    assert not events.counts()


def test_a_jump_back_of_the_clock_clears_a_history_that_is_ahead_of_it(make):
    history, events, _ = make()
    for k in range(10):
        history.update(traffic(k / 5), at(k / 5))
    history.clock_jumped_back(at(1.5))  # within the tolerance: the stamps decide
    assert history._history.newest_stamp_ns == at(1.8)
    history.clock_jumped_back(at(0.0))
    assert history._history.newest_stamp_ns is None
    window = history.update(traffic(0.1), at(0.1))
    assert window.valid[:, -1].all()
    assert not window.valid[:, :-1].any()
    assert events.counts() == {"clock_reset": 1}


@pytest.mark.parametrize(
    ("stamp_s", "now_s", "cleared"),
    [
        (4.0, 2.0, True),
        (4.0, 4.0, False),  # the objects paused meanwhile
        (2.0, 2.0, False),  # the stamps are of another clock than that of the sender
    ],
)
def test_a_sender_whose_clock_was_set_clears_the_history_if_the_stamps_jump(
    make, stamp_s, now_s, cleared
):
    history, events, _ = make()
    for k in range(10):  # its clock is an hour behind
        history.update(traffic(k / 5), at(3600.0 + k / 5))
    states = dataclasses.replace(traffic(2.0), stamp_ns=at(stamp_s))
    window = history.update(states, at(3600.0 + now_s), receipt=Receipt(sender_set=True))
    assert history.report.clock_reset == cleared
    assert window.valid[:, :-1].any() != cleared
    assert events.counts() == ({"clock_set": 1} if cleared else {})
    # Without what is known of the sender, a jump looks like a pause.
    jumped = dataclasses.replace(states, stamp_ns=at(stamp_s + 9.0))
    history.update(jumped, at(3600.0 + now_s), receipt=Receipt(monotonic_ns=2_000_000_000))
    assert not history.report.clock_reset


@pytest.mark.parametrize(("later_s", "noticed"), [(0.2, True), (0.8, True), (1.2, False)])
def test_a_message_that_was_stamped_before_the_clock_was_set_and_sent_after_it(
    make, later_s, noticed
):
    """Its stamp goes on as before; that of the next message has jumped."""
    history, events, _ = make()
    for k in range(10):
        history.update(traffic(k / 5), at(3600.0 + k / 5))
    between = Receipt(5_000_000_000, sender_set=True)
    history.update(traffic(2.0), at(3602.0), receipt=between)
    assert not history.report.clock_reset
    after = dataclasses.replace(traffic(2.0 + later_s), stamp_ns=at(4.0 + later_s))
    receipt = Receipt(5_000_000_000 + round(later_s * 1e9))
    history.update(after, at(3602.0 + later_s), receipt=receipt)
    assert history.report.clock_reset == noticed
    assert events.counts() == ({"clock_set": 1} if noticed else {})


@pytest.mark.parametrize("ahead_s", [2.0, 4.0, 60.0])
def test_a_second_sender_with_another_clock_clears_the_history_once(make, ahead_s):
    """Then the two are told apart by their stamps."""
    history, events, _ = make()
    clock = SenderClock()
    for k in range(100):
        sent_s = k / 20 - 100.0 + (ahead_s if k > 40 and k % 2 else 0.0)
        states = dataclasses.replace(traffic(k / 20), stamp_ns=at(sent_s))
        received_ns = 5_000_000_000 + round(k / 20 * 1e9)
        receipt = Receipt(received_ns, clock.was_set_forward(at(sent_s), received_ns))
        history.update(states, at(k / 20), receipt=receipt)
    counts = events.counts()
    assert counts["clock_set"] == 1
    assert counts.get("clock_reset", 0) <= 1


def test_a_new_rate_counts_from_the_next_observation(make):
    history, _, _ = make()
    assert history.update(traffic(0.0), at(0.0)) is not None
    assert history.update(traffic(0.1), at(0.1)) is None
    history.configure(dataclasses.replace(PredictorParameters(), rate=10.0))
    assert history.update(traffic(0.2), at(0.2)) is not None
    assert history.update(traffic(0.3), at(0.3)) is not None


def test_a_stream_that_starts_again_resets_the_predictor(make, monkeypatch):
    history, _, predictor = make()
    resets = []
    monkeypatch.setattr(predictor, "reset", lambda: resets.append(True))
    for k in range(10):
        history.update(traffic(k / 5), at(k / 5))
    assert not resets
    for k in range(3):  # the third message in a row that is late
        history.update(traffic(1.0 + k / 10), at(1.0 + k / 10))
    assert len(resets) == 1
    for k in range(3):  # the third in a row in another frame
        states = dataclasses.replace(traffic(1.4 + k / 10), frame_id="odom")
        history.update(states, at(1.4 + k / 10))
    assert len(resets) == 2


def test_a_new_frame_resets_the_predictor_also_where_its_first_objects_are_unusable(
    make, monkeypatch
):
    history, _, predictor = make()
    resets = []
    monkeypatch.setattr(predictor, "reset", lambda: resets.append(True))
    for k in range(5):
        history.update(traffic(k / 5), at(k / 5))
    for k in range(5, 9):
        states = dataclasses.replace(traffic(k / 5), frame_id="odom")
        if k == 7:  # the third in a row, which starts a new history
            states.position[:] = float("nan")
        history.update(states, at(k / 5))
        assert len(resets) == int(k >= 7)
    assert history._history.frame_id == "odom"
    assert not history.rejection


def test_stamps_with_microseconds_in_the_field_of_nanoseconds_are_left_out(make):
    history, events, _ = make()
    rejected = []
    for step in range(60):
        seconds, tenth = divmod(step, 10)
        # Mended after four seconds.
        stamp_s = seconds + tenth * (1e-4 if seconds < 4 else 0.1)
        stamped = dataclasses.replace(traffic(step / 10), stamp_ns=at(stamp_s))
        history.update(stamped, at(step / 10), receipt=Receipt(round(step * 1e8)))
        rejected.append(bool(history.rejection))
    assert rejected == [False] * 20 + [True] * 21 + [False] * 19
    assert events.counts()["stamp_unit"] == 21


@pytest.mark.parametrize("set_s", [3600.0, -3600.0])
def test_a_clock_that_was_set_says_nothing_about_the_pace_of_the_stamps(make, set_s):
    history, events, _ = make()
    for k in range(20):
        history.update(traffic(k / 10), at(k / 10))
    history.reset()  # as the node does where its machine's clock was set
    for k in range(20, 60):  # the objects have a clock of their own
        history.update(traffic(k / 10), at(set_s + k / 10))
    assert "stamp_pace" not in events.counts()


def test_old_observations_and_implausible_streams_are_reported(make):
    history, _, _ = make()
    for k in range(60):
        history.update(traffic(k / 5), at(k / 5 + 2.0))
    assert list(history.checks.doubts) == ["old"]
    for k in range(60, 120):
        states = traffic(k / 5)
        history.update(dataclasses.replace(states, size=states.size[:, ::-1]), at(k / 5 + 0.1))
    assert list(history.checks.doubts) == ["sizes"]
