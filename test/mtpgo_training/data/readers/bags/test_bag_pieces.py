# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A bag is read by the node's rules: what is dropped, what begins a recording, what is counted."""

import dataclasses
from collections import Counter

import numpy as np
import pytest
from odd_bags import EPOCH_NS, S_NS, OddBag, bytes_of, states_at, write_stream

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.conversions import make_header, make_pose, make_vector
from msg_adapters.inputs.ego_odometry import EgoOptions
from msg_adapters.types import TypestoreTypes
from mtpgo_core.errors import RecordingError
from mtpgo_core.history.odd_input import ODD_INPUT
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_texts
from mtpgo_core.schema import AgentClass
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.bags.bag_options import BagOptions
from mtpgo_training.data.readers.reading_options import ReadingOptions

LOG = ReadingOptions(bags=BagOptions(stamps="log"))

COMPARED = (
    "late",
    "duplicates",
    "duplicate_keys",
    "non_finite",
    "too_fast",
    "clock_reset",
    "frame_changed",
    "wrong_frame",
    "restarted",
    "alternating",
)


def steady(seconds, rate=10.0, start=0.0, **changes):
    return [(start + i / rate, states_at(start + i / rate, **changes))
            for i in range(round(seconds * rate))]  # fmt: skip


def total(recordings):
    counts = Counter()
    for recording in recordings:
        counts.update(recording.counts)
    return counts


def read(path, messages, options=None):
    path = write_stream(path / "bag.mcap", messages)
    return load_recordings(path, "bag", None, options or ReadingOptions())


def test_a_late_message_is_dropped_and_cuts_nothing(tmp_path, caplog):
    messages = steady(60.0)
    for place in range(40, 600, 41):
        messages.insert(place, (messages[place][0], states_at(messages[place - 1][0] - 0.04)))
    (recording,) = read(tmp_path, messages)
    assert (len(recording), recording.frame_rate) == (3 * 600, 10.0)
    assert recording.duration_s == pytest.approx(59.9)
    assert recording.counts == {"late": 3 * 14}
    assert "42 objects older than what is known" in caplog.text


def test_swapped_messages_lose_the_later_one_only(tmp_path):
    messages = steady(10.0)
    (first_s, first), (second_s, second) = messages[50:52]
    messages[50:52] = [(first_s, second), (second_s, first)]
    (recording,) = read(tmp_path, messages)
    assert recording.counts == {"late": 3}
    assert recording.frame_rate == 10.0
    assert set(recording.frames) == set(range(100)) - {50}


def test_a_late_message_of_other_road_users_is_used(tmp_path):
    # Two sensors with road users of their own; the second one is always 40 ms behind.
    messages = []
    for log_s, states in steady(10.0):
        messages.append((log_s, states))
        messages.append((log_s, states_at(log_s - 0.04, ids=(7, 8))))
    (recording,) = read(tmp_path, messages)
    assert recording.counts == {}
    assert len(recording) == 5 * 100
    assert (np.diff(recording.frame) >= 0).all()


def test_a_jump_of_the_clock_begins_a_recording(tmp_path):
    messages = steady(10.0) + [(10.0 + log_s, states) for log_s, states in steady(10.0)]
    first, second = read(tmp_path, messages)
    assert (len(first), len(second)) == (300, 300)
    assert total([first, second]) == {"clock_reset": 1}


def test_a_single_message_in_another_frame_is_dropped_and_three_are_a_change(tmp_path):
    messages = steady(10.0)
    messages[30] = (3.0, states_at(3.0, frame="odom"))
    (one,) = read(tmp_path, messages)
    assert (len(one), one.counts) == (297, {"frame_changed": 1, "wrong_frame": 3})
    changed = steady(10.0) + steady(10.0, start=10.0, frame="odom")
    first, second = read(tmp_path, changed)
    assert (len(first), len(second)) == (300, 300 - 2 * 3)
    assert total([first, second]) == {"frame_changed": 3, "wrong_frame": 6}


def test_a_single_stamp_from_the_future_is_dropped(tmp_path):
    messages = steady(10.0)
    messages[40] = (4.0, states_at(5000.0))
    (recording,) = read(tmp_path, messages)
    assert (len(recording), recording.counts) == (297, {"future_stamp": 1})


def leaping(log_offset_s):
    """Ten seconds, and after two more by the recorder's clock those of another minute."""
    later = [(log_s - 58.0, states) for log_s, states in steady(10.0, start=70.0)]
    return [(log_offset_s + log_s, states) for log_s, states in steady(10.0) + later]


def test_a_stream_that_leaps_behind_the_recorders_clock_loses_nothing(tmp_path):
    first, second = read(tmp_path, leaping(1e6))
    assert (len(first), len(second)) == (300, 300)
    assert total([first, second]) == {}


def test_a_stream_that_leaps_ahead_of_the_recorders_clock_is_accepted_as_by_the_node(tmp_path):
    first, second = read(tmp_path, leaping(0.0))
    assert (len(first), len(second)) == (300, 300 - 2 * 3)
    assert total([first, second]) == {"future_stamp": 3}


def test_a_stamp_from_the_future_before_a_leap_and_at_the_end_is_dropped(tmp_path):
    messages = leaping(1e6)
    odd = [(1e6 + log_s, states_at(5000.0)) for log_s in (11.9, 22.0)]
    first, second = read(tmp_path, messages + odd)
    assert (len(first), len(second)) == (300, 300)
    assert total([first, second]) == {"future_stamp": 2}


def test_log_times_of_another_clock_or_rate_change_nothing(tmp_path):
    drifting = [(-1e6 + 0.9 * log_s, states) for log_s, states in steady(60.0)]
    (recording,) = read(tmp_path, drifting)
    assert (len(recording), recording.counts) == (1800, {})


def unstamped(states):
    return dataclasses.replace(states, stamp_ns=0)


@pytest.mark.parametrize("kind", ["pointcloud2", "autoware", "vision", "derived", "ika"])
def test_messages_without_a_stamp_need_log_times(tmp_path, kind):
    messages = [(log_s, unstamped(states)) for log_s, states in steady(2.0)]
    path = write_stream(tmp_path / "bag.mcap", messages, kind)
    expected = r"none of its 20 messages has a stamp, .*--stamps log takes"
    with pytest.raises(RecordingError, match=expected):
        load_recordings(path, "bag")
    (recording,) = load_recordings(path, "bag", None, LOG)
    assert (len(recording), recording.frame_rate) == (60, 10.0)
    assert recording.start_time_ns == EPOCH_NS


def test_single_messages_without_a_stamp_are_counted_or_filled_in(tmp_path):
    messages = steady(10.0)
    for place in (20, 21, 70):
        messages[place] = (messages[place][0], unstamped(messages[place][1]))
    (recording,) = read(tmp_path, messages)
    assert (len(recording), recording.counts) == (291, {"unstamped": 3})
    (filled,) = read(tmp_path, messages, LOG)
    assert (len(filled), filled.counts) == (300, {})


def test_messages_that_cannot_be_read_are_counted(tmp_path):
    with OddBag(tmp_path / "bag.mcap") as bag:
        channel = bag.objects(kind="markers")
        for log_s, states in steady(2.0):
            bag.add(channel, bytes_of(states, "markers"), log_s)
            if log_s == 1.0:
                other = states_at(log_s, ids=(8, 9), frame="odom")
                bag.add(channel, two_frames(states, other), log_s)
    (recording,) = load_recordings(tmp_path / "bag.mcap", "bag")
    assert (len(recording), recording.counts) == (60, {"malformed": 1})


def two_frames(one, other):
    """One array with the markers of two, which no adapter reads."""
    store, name = bag_typestore(), "visualization_msgs/msg/MarkerArray"
    first, second = (store.deserialize_cdr(bytes_of(s, "markers"), name) for s in (one, other))
    first.markers += second.markers
    return bytes(store.serialize_cdr(first, name))


def test_two_channels_of_one_topic_are_read_as_one(tmp_path):
    for number, pick in enumerate((lambda i: i < 50, lambda i: i % 2)):
        with OddBag(tmp_path / f"{number}.mcap") as bag:
            one, two = bag.objects(), bag.objects(metadata={"offered_qos_profiles": "- depth: 3"})
            for i, (log_s, states) in enumerate(steady(10.0)):
                bag.add(one if pick(i) else two, bytes_of(states), log_s)
    for recording in load_recordings(tmp_path, "bag"):
        assert (len(recording), recording.counts) == (300, {})


def test_messages_of_another_type_on_the_topic_are_named(tmp_path, caplog):
    with OddBag(tmp_path / "bag.mcap") as bag:
        many, few = bag.objects(), bag.objects(kind="autoware")
        for i, (log_s, states) in enumerate(steady(10.0)):
            kind = "autoware" if i % 10 == 0 else "pointcloud2"
            bag.add(few if i % 10 == 0 else many, bytes_of(states, kind), log_s)
    options = ReadingOptions(bags=BagOptions(topic="/objects"))
    (recording,) = load_recordings(tmp_path / "bag.mcap", "bag", None, options)
    assert len(recording) == 270
    assert "10 of autoware_perception_msgs/msg/TrackedObjects" in caplog.text


def test_a_moving_frame_gets_the_nodes_warning(tmp_path, caplog):
    (recording,) = read(tmp_path, steady(2.0, frame="base_link"))
    assert len(recording) == 60
    assert "objects come in frame 'base_link', which usually moves with the vehicle" in caplog.text
    caplog.clear()
    read(tmp_path, steady(2.0))
    assert not caplog.records


def odd_stream(seed):
    """A stream with everything that a tracker may do wrong."""
    draw = np.random.default_rng(seed)
    messages, time_s, frame = [], 0.0, "map"
    for number in range(200):
        time_s += draw.choice([0.1, 0.1, 0.1, 0.0, 0.3])
        stamp_s = time_s
        if draw.random() < 0.08:
            stamp_s -= draw.choice([0.04, 0.2, 0.6, 1.5])
        if draw.random() < 0.01:
            time_s = stamp_s = max(0.0, time_s - 20.0)
        name = "odom" if draw.random() < 0.03 else frame
        if draw.random() < 0.005:
            frame = name = "odom" if frame == "map" else "map"
        ids = draw.choice(9, size=draw.integers(0, 7), replace=draw.random() < 0.1) + 1
        states = states_at(stamp_s, ids=[int(i) for i in ids], frame=name)
        for row in range(len(states)):
            if draw.random() < 0.02:
                states.position[row] = np.nan
            elif draw.random() < 0.02:
                states.velocity[row] = (150.0, 0.0)
            elif draw.random() < 0.3:  # another road user of this identity
                states.position[row, 1] += 3.0 if number % 100 < 80 else 40.0
        messages.append((0.1 * number, states))
    return messages


@pytest.mark.parametrize("seed", range(6))
def test_the_counters_are_those_of_the_nodes_history(tmp_path, seed):
    messages = odd_stream(seed)
    history, online = TrackHistory(HistoryConfig()), Counter()
    for _, states in messages:
        report = history.update(states)
        online.update({name: int(getattr(report, name)) for name in COMPARED})
    offline = total(read(tmp_path, messages))
    assert all(online[name] for name in ("late", "duplicates", "non_finite", "too_fast"))
    found = {name: offline[name] for name in COMPARED}
    assert found == {name: online[name] for name in COMPARED}


def odometry_at(time_s, x, stamped=True):
    """Odometry of a vehicle at (x, 7) m that drives along x at 10 m/s, as CDR."""
    types = TypestoreTypes(bag_typestore())
    twist = types.make("geometry_msgs/msg/Twist", linear=make_vector(types, 10.0, 0.0))
    message = types.make(
        "nav_msgs/msg/Odometry",
        header=make_header(types, EPOCH_NS + round(time_s * 1e9) if stamped else 0, "map"),
        child_frame_id="base_link",
        pose=types.make(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=make_pose(types, np.array([x, 7.0]), 0.0, 0.0),
        ),
        twist=types.make("geometry_msgs/msg/TwistWithCovariance", twist=twist),
    )
    return bytes(bag_typestore().serialize_cdr(message, "nav_msgs/msg/Odometry"))


@pytest.fixture
def drive(tmp_path):
    """4 s of objects at 10 Hz, the ego among them; its odometry, but none from 1 to 2 s."""
    with OddBag(tmp_path / "drive.mcap") as bag:
        objects, ego = bag.objects(), bag.channel("/odom", "nav_msgs/msg/Odometry")
        bag.add(ego, odometry_at(0.0, 0.0, stamped=False), 0.0)
        for i in range(80):
            time_s = i / 20 + 0.01
            if not 1.0 < time_s < 2.0:
                bag.add(ego, odometry_at(time_s, 10.0 * time_s), time_s)
            if i % 2 == 0:
                states = states_at(time_s + 0.02, ids=(1, 2, 9))
                position = states.position.copy()
                position[2] = [10.0 * time_s + 0.8, 7.3]  # as the tracker sees it
                message = bytes_of(dataclasses.replace(states, position=position))
                bag.add(objects, message, time_s + 0.03)
    return bag.path


def test_the_ego_joins_a_recording_by_its_odometry_as_in_the_node(drive):
    bags = BagOptions(ego_topic="odom", ego=EgoOptions(class_name="truck", length_m=6.0))
    (recording,) = load_recordings(drive, "bag", None, ReadingOptions(bags=bags))
    key = keys_from_texts(["ego"])[0]
    (track,) = np.flatnonzero((recording.track_key == key).all(axis=1))
    rows = recording.track == track
    assert recording.ego_id == recording.track_id[track]
    assert recording.agent_class[track] == AgentClass.TRUCK
    assert recording.size[track].tolist() == [6.0, 1.8]
    elapsed_s = recording.frame[rows] / recording.frame_rate + 0.03
    np.testing.assert_allclose(recording.position[rows, 0], 10.0 * elapsed_s, atol=1e-3)
    np.testing.assert_allclose(recording.velocity[rows], [[10.0, 0.0]] * rows.sum())
    # From 1.23 to 1.93 s the odometry is more than 0.2 s old.
    missing = recording.counts["ego_missing"]
    assert missing == 8
    assert rows.sum() == 40 - missing
    assert recording.counts["ego_refused"] == 1
    # The tracker's own ego is there only while nothing is known of it for half a second.
    double = recording.track == list(recording.track_key[:, 0]).index(9)
    times_s = recording.frame[double] / recording.frame_rate + 0.03
    assert times_s.min() > 1.6
    assert times_s.max() < 2.0


def test_without_the_option_the_odometry_makes_no_road_user(drive):
    (recording,) = load_recordings(drive, "bag", None, ReadingOptions())
    assert sorted(recording.track_id.tolist()) == [1, 2, 9]
    assert not any(name.startswith("ego") for name in recording.counts)


def test_a_topic_without_odometry_is_refused_with_those_that_have_it(drive):
    options = ReadingOptions(bags=BagOptions(ego_topic="/localization"))
    with pytest.raises(RecordingError, match=r"/localization of the ego, expected .*: /odom"):
        load_recordings(drive, "bag", None, options)


def test_single_messages_that_cannot_be_decoded_are_counted(tmp_path):
    with OddBag(tmp_path / "bag.mcap") as bag:
        channel = bag.objects(kind="autoware")
        for number, (log_s, states) in enumerate(steady(5.0)):
            data = bytes_of(states, "autoware")
            bag.add(channel, data[:60] if number in (7, 30) else data, log_s)
        lanes = bag.channel("/lane_markings", "visualization_msgs/msg/MarkerArray")
        bag.add(lanes, b"\0\1\0\0\1\0\0\0", 0.0)
    (recording,) = load_recordings(tmp_path / "bag.mcap", "bag")
    assert (len(recording), recording.counts) == (3 * 48, {"malformed": 2})
    with OddBag(tmp_path / "bag.mcap") as bag:
        channel = bag.objects(kind="autoware")
        for log_s, states in steady(1.0):
            bag.add(channel, bytes_of(states, "autoware")[:60], log_s)
    sentence = (
        r"no tracked object .* decoded as autoware_.* \(10 messages that could not be read\)"
    )
    with pytest.raises(RecordingError, match=sentence):
        load_recordings(tmp_path / "bag.mcap", "bag")


def test_a_broken_message_beside_the_objects_is_named(tmp_path, caplog):
    with OddBag(tmp_path / "bag.mcap") as bag:
        channel = bag.objects()
        for log_s, states in steady(1.0):
            bag.add(channel, bytes_of(states), log_s)
        lanes = bag.channel("/lane_markings", "visualization_msgs/msg/MarkerArray")
        bag.add(lanes, b"\0\1\0\0\1\0\0\0", 0.0)
    (recording,) = load_recordings(tmp_path / "bag.mcap", "bag")
    assert (len(recording), recording.lanes) == (30, ())
    assert "topic /lane_markings: a message is left out: it cannot be decoded" in caplog.text


def test_a_detector_without_a_tracker_is_told_why_it_has_no_road_user(tmp_path):
    store = bag_typestore()
    types = TypestoreTypes(store)
    kind = "vision_msgs/msg/Detection3DArray"
    message = types.make(kind, detections=[types.make("vision_msgs/msg/Detection3D")])
    message.header.stamp.sec = 1_700_000_000
    with OddBag(tmp_path / "bag.mcap") as bag:
        bag.add(bag.objects(kind="vision"), bytes(store.serialize_cdr(message, kind)), 0.0)
    with pytest.raises(RecordingError, match="/objects: detection without an id"):
        load_recordings(tmp_path / "bag.mcap", "bag")


@pytest.mark.parametrize(
    ("text", "ego"),
    [
        ("2", 2),
        (" 2 ", 2),
        ("\N{SUPERSCRIPT TWO}", None),
        ("9" * 6000, None),
        ("-1", None),
        ("hero", None),
        ("", None),
        ("00000000-0000-0000-0000-000000000003", 3),
    ],
)
def test_the_ego_is_found_by_any_text(tmp_path, text, ego):
    kind = "std_msgs/msg/String"
    message = TypestoreTypes(bag_typestore()).make(kind, data=text)
    with OddBag(tmp_path / "bag.mcap") as bag:
        bag.add(
            bag.channel("/ego_id", kind), bytes(bag_typestore().serialize_cdr(message, kind)), 0.0
        )
        channel = bag.objects()
        for log_s, states in steady(1.0):
            bag.add(channel, bytes_of(states), log_s)
    (recording,) = load_recordings(tmp_path / "bag.mcap", "bag")
    assert recording.ego_id == ego


def test_messages_without_any_time_are_told_apart(tmp_path):
    messages = [(-EPOCH_NS / S_NS, unstamped(states)) for _, states in steady(1.0)]
    with pytest.raises(RecordingError, match=r"has a stamp or a time at which it was recorded$"):
        read(tmp_path, messages, LOG)


def text_of(data):
    make, kind = TypestoreTypes(bag_typestore()).make, "std_msgs/msg/String"
    return bytes(bag_typestore().serialize_cdr(make(kind, data=data), kind))


@pytest.mark.parametrize(("robot", "ego"), [("/r1", 1), ("/r2", 3)])
def test_the_ego_of_another_robot_is_not_taken(tmp_path, robot, ego):
    with OddBag(tmp_path / "a.mcap") as bag:
        channels = {name: bag.objects(f"{name}/tracks/objects") for name in ("/r1", "/r2")}
        for name, number in (("/r1", 1), ("/r2", 3)):
            channel = bag.channel(f"{name}/ego_id", "std_msgs/msg/String")
            bag.add(channel, text_of(str(number)), 0.0)
        for step in range(5):
            for channel in channels.values():
                bag.add(channel, bytes_of(states_at(step / 10)), step / 10)
    options = ReadingOptions(bags=BagOptions(topic=f"{robot}/tracks/objects"))
    (recording,) = load_recordings(tmp_path, "bag", None, options)
    assert recording.ego_id == ego


def test_which_of_two_egos_is_read_is_said_where_both_are_as_near(tmp_path, caplog):
    with OddBag(tmp_path / "a.mcap") as bag:
        objects = bag.objects()
        for name, number in (("/r2", 3), ("/r1", 1)):
            channel = bag.channel(f"{name}/ego_id", "std_msgs/msg/String")
            bag.add(channel, text_of(str(number)), 0.0)
        bag.add(objects, bytes_of(states_at(0.0)), 0.0)
    (recording,) = load_recordings(tmp_path, "bag")
    assert recording.ego_id == 1
    assert "/r1/ego_id is read with the objects, and not /r2/ego_id" in caplog.text


def test_stamps_in_another_unit_are_refused(tmp_path):
    # Milliseconds taken for seconds: 100 s from one message to the next.
    messages = [(i / 10, states_at(100.0 * i)) for i in range(30)]
    with pytest.raises(
        RecordingError, match="its stamps advance 1e\\+03 times as fast as the time"
    ):
        read(tmp_path, messages)
    # A simulation that runs twenty times as fast as time is none of these.
    (recording,) = read(tmp_path, [(i / 200, states_at(i / 10)) for i in range(300)])
    assert (recording.frame_rate, len(recording)) == (10.0, 900)


def test_stamps_that_hardly_advance_are_remarked_on(tmp_path, caplog):
    # Milliseconds taken for nanoseconds: 100 ns from one message to the next.
    (recording,) = read(tmp_path, [(i / 10, states_at(i / 1e7)) for i in range(30)])
    assert len(recording) == 90
    assert "its stamps advance 1e-06 times as fast as the time at which they were" in caplog.text
    assert "a row of a road user every 1e-07 s, so that no movement" in caplog.text


def test_messages_that_all_have_the_same_stamp_are_refused(tmp_path):
    messages = [(i / 10, states_at(0.0)) for i in range(30)]
    with pytest.raises(
        RecordingError, match=r"its 30 messages all have the same stamp, .* 2\.9 s"
    ):
        read(tmp_path, messages)
    # A few may be a message that was sent again, and many a short part played in a loop.
    assert len(read(tmp_path, messages[:2])) == 1
    assert len(read(tmp_path, [(i / 10, states_at(i % 4 / 10)) for i in range(300)])) == 1


def test_stamps_before_1970_are_none_as_in_the_node(tmp_path):
    messages = steady(3.0)
    early = dataclasses.replace(states_at(1.5), stamp_ns=-5 * S_NS)
    messages.insert(15, (1.45, early))
    (recording,) = read(tmp_path, messages)
    assert len(recording) == 90
    assert recording.counts == {"unstamped": 1}
    with pytest.raises(RecordingError, match="none of its 10 messages has a stamp"):
        read(tmp_path, [(i / 10, early) for i in range(10)])
    (recording,) = read(tmp_path, [(i / 10, early) for i in range(10)], LOG)
    assert recording.start_time_ns == EPOCH_NS


@pytest.mark.parametrize("rate", [9.90099, 23.976, 24 / 1.001, 29.97, 30 / 1.001, 3.3333])
def test_a_rate_that_is_not_round_is_found(tmp_path, rate):
    messages = [(i / rate, states_at(round(i / rate * 1e9) * 1e-9)) for i in range(80)]
    stamps = [EPOCH_NS + round(i / rate * 1e9) for i in range(80)]
    messages = [
        (log_s, dataclasses.replace(states, stamp_ns=stamp_ns))
        for (log_s, states), stamp_ns in zip(messages, stamps, strict=True)
    ]
    (recording,) = read(tmp_path, messages)
    assert recording.frame_rate == pytest.approx(rate, rel=1e-8)
    found = [recording.stamp_ns(int(frame)) for frame in recording.frames]
    # Those of films and of three digits are found as they are.
    assert np.abs(np.subtract(found, stamps)).max() <= (rate in (9.90099, 3.3333))


@pytest.mark.parametrize(("apart_m", "counter"), [(2.0, "alternating"), (25.0, "restarted")])
def test_two_publishers_with_the_same_identities_are_counted(tmp_path, caplog, apart_m, counter):
    messages = []
    for log_s, states in steady(10.0, ids=range(20)):
        messages.append((log_s, states))
        messages.append((log_s + 0.05, states_at(log_s + 0.05, ids=range(20), y=apart_m)))
    history, online = TrackHistory(HistoryConfig()), 0
    for _, states in messages:
        online += getattr(history.update(states), counter)
    (recording,) = read(tmp_path, messages)
    assert len(recording) == 20 * 200  # nothing is dropped
    assert recording.counts == {counter: online}
    assert online > 20 * 190
    assert f"{online} " + ODD_INPUT[counter] in caplog.text


def test_road_users_that_share_no_identity_are_not_counted(tmp_path):
    draw = np.random.default_rng(0)
    messages = []
    for log_s, states in steady(20.0):
        states.position[:, 0] += 0.5 * 6.0 * log_s**2  # up to 130 m/s, with a tracker's noise
        states.position[:] += draw.normal(0.0, 0.2, states.position.shape)
        messages.append((log_s, states))
    (recording,) = read(tmp_path, messages)
    assert recording.counts == {}
