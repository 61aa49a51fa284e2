# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Poses of moving frames from the transforms in a bag, worked out by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from odd_bags import EPOCH_NS, S_NS, OddBag, bytes_of, definition_of, states_at, write_stream

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.inputs.odometry import ODOMETRY
from msg_adapters.types import TypestoreTypes
from mtpgo_core.errors import FrameError, RecordingError
from mtpgo_core.frames import Pose2
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.bags.bag_poses import BagPoses
from mtpgo_training.data.readers.bags.bag_transforms import TRANSFORMS, TransformTree

UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def turned(yaw):
    return (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))


def transform(parent, child, time_s, position=(0.0, 0.0, 0.0), rotation=UPRIGHT):
    stamp = EPOCH_NS + round(time_s * S_NS)
    x, y, z = position
    qx, qy, qz, qw = rotation
    return SimpleNamespace(
        header=SimpleNamespace(
            frame_id=parent, stamp=SimpleNamespace(sec=stamp // S_NS, nanosec=stamp % S_NS)
        ),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(x=x, y=y, z=z),
            rotation=SimpleNamespace(x=qx, y=qy, z=qz, w=qw),
        ),
    )


def tree(*transforms, static=()):
    found = TransformTree()
    found.add(True, SimpleNamespace(transforms=list(static)))
    for item in transforms:
        found.add(False, SimpleNamespace(transforms=[item]))
    return found


def at(poses, time_s):
    return poses.at(EPOCH_NS + round(time_s * S_NS))


def assert_pose(found, x, y, yaw):
    np.testing.assert_allclose((found.x, found.y, found.yaw), (x, y, yaw), atol=1e-9)


def test_a_moving_frame_is_interpolated_in_time():
    fixed, poses = tree(
        transform("odom", "base_link", 0.0, (10.0, 0.0, 0.3)),
        transform("odom", "base_link", 1.0, (20.0, 4.0, 0.3), turned(math.pi / 2)),
    ).poses("base_link")
    assert fixed == "odom"
    assert_pose(at(poses, 0.5), 15.0, 2.0, math.pi / 4)


def test_transforms_over_several_frames_of_their_own_rates_are_composed():
    # The map shifts once; the vehicle drives north; the lidar looks back, 2 m ahead of its axle.
    fixed, poses = tree(
        *(transform("map", "odom", t, (100.0, 0.0, 0.0)) for t in (0.0, 5.0)),
        *(transform("odom", "base_link", t, (0.0, 10.0 * t, 0.0), turned(math.pi / 2))
          for t in (0.0, 1.0, 2.0)),
        static=[transform("base_link", "lidar", 0.0, (2.0, 0.0, 1.5), turned(math.pi))],
    ).poses("lidar")  # fmt: skip
    assert fixed == "map"
    assert_pose(at(poses, 1.5), 100.0, 17.0, -math.pi / 2)


def test_a_tilted_sensor_is_turned_in_space():
    # An optical frame: z ahead, x right. Its yaw in the vehicle's plane is that of its x axis.
    optical = (-0.5, 0.5, -0.5, 0.5)
    _, poses = tree(
        *(transform("map", "base_link", t) for t in (0.0, 1.0)),
        static=[transform("base_link", "camera", 0.0, (1.0, 0.0, 1.0), optical)],
    ).poses("camera")
    assert_pose(at(poses, 0.5), 1.0, 0.0, -math.pi / 2)


@pytest.mark.parametrize("frame", ["map", "odom", "world", "site", "unknown"])
def test_frames_that_do_not_move_are_left_alone(frame):
    found = tree(
        *(transform("map", "odom", t, (t, 0.0, 0.0)) for t in (0.0, 1.0)),
        static=[transform("earth", "map", 0.0), transform("earth", "site", 0.0)],
    ).poses(frame)
    assert found is None


def test_the_map_comes_before_the_earth():
    fixed, _ = tree(
        *(transform("map", "base_link", t) for t in (0.0, 1.0)),
        static=[transform("earth", "map", 0.0, (4e6, 6e5, 5e6), (0.1, 0.3, 0.2, 0.9))],
    ).poses("/base_link")
    assert fixed == "map"


def test_no_pose_is_invented_before_after_or_in_a_loop():
    poses = tree(transform("odom", "base_link", 1.0), transform("odom", "base_link", 2.0)).poses(
        "base_link"
    )[1]
    for time_s in (0.9, 2.1):
        with pytest.raises(FrameError, match=r"0\.100 s away"):
            at(poses, time_s)
    loop = tree(transform("a", "b", 0.0), transform("b", "a", 0.0), transform("a", "b", 1.0))
    assert loop.poses("b") is None
    assert loop.is_apart("b")
    above = tree(
        transform("odom", "b", 0.0), transform("c", "odom", 0.0), transform("odom", "c", 0.0)
    )
    assert above.poses("b")[0] == "odom"
    assert not above.is_apart("b")
    odd = [
        transform("odom", "base_link", 0.0, (math.nan, 0.0, 0.0)),
        transform("odom", "base_link", 0.0, rotation=(0.0, 0.0, 0.0, 0.0)),
        transform("odom", "odom", 0.0),
        transform("odom", "", 0.0),
    ]
    assert tree(*odd).poses("base_link") is None


def messages_of(transforms):
    """A tf2_msgs/TFMessage as CDR."""
    store = bag_typestore()
    types = TypestoreTypes(store)

    def made(name, item, **changes):
        return types.make(name, **{**vars(item), **changes})

    stamped = []
    for item in transforms:
        stamp = made("builtin_interfaces/msg/Time", item.header.stamp)
        shift = made("geometry_msgs/msg/Vector3", item.transform.translation)
        turn = made("geometry_msgs/msg/Quaternion", item.transform.rotation)
        stamped.append(
            made(
                "geometry_msgs/msg/TransformStamped",
                item,
                header=made("std_msgs/msg/Header", item.header, stamp=stamp),
                transform=types.make(
                    "geometry_msgs/msg/Transform", translation=shift, rotation=turn
                ),
            )
        )
    return bytes(store.serialize_cdr(types.make(TRANSFORMS, transforms=stamped), TRANSFORMS))


@pytest.mark.parametrize("source", ["tf", "odometry"])
def test_objects_of_a_sensor_are_lifted_by_the_bag(tmp_path, source, caplog):
    """The lidar is 2 m ahead of an axle that drives at 5 m/s; both sources give the same."""
    mount = transform("base_link", "lidar", 0.0, (2.0, 0.0, 1.5))
    with OddBag(tmp_path / "bag.mcap") as bag:
        objects = bag.objects()
        bag.add(bag.channel("/tf_static", TRANSFORMS), messages_of([mount]), 0.0)
        if source == "tf":
            moving = bag.channel("/tf", TRANSFORMS)
        else:
            moving = bag.channel("/odom", "nav_msgs/msg/Odometry")
        for i in range(1, 41):
            time_s = i / 20
            if source == "tf":
                data = messages_of([transform("odom", "base_link", time_s, (5 * time_s, 0, 0))])
            else:
                data = odometry(time_s)
            bag.add(moving, data, time_s)
            if i % 4 == 0 or i < 3:
                bag.add(objects, bytes_of(states_at(time_s - 0.03, frame="lidar")), time_s)
    (recording,) = load_recordings(tmp_path / "bag.mcap", "bag")
    # The first object comes before the first pose.
    assert recording.counts == {"not_lifted": 1}
    assert "1 messages that could not be transformed into the fixed frame" in caplog.text
    time_s = (recording.start_time_ns - EPOCH_NS) / S_NS + recording.frame / recording.frame_rate
    number = recording.track_id[recording.track]
    expected = 12.0 * number + 10.0 * time_s + 2.0 + 5.0 * time_s
    np.testing.assert_allclose(recording.position[:, 0], expected, atol=1e-5)


def odometry(time_s):
    from fleet import odometry_message

    message = odometry_message(EPOCH_NS + round(time_s * S_NS), Pose2(5 * time_s, 0.0, 0.0))
    return bytes(bag_typestore().serialize_cdr(message, "nav_msgs/msg/Odometry"))


def test_of_two_parents_the_one_that_is_known_better_counts():
    both = [
        transform(parent, "base_link", t / 10, (float(t), shift, 0.0))
        for t in range(20)
        for parent, shift in (("start", 7.0), ("odom", 0.0))
    ]
    fixed, poses = tree(*both, transform("map", "base_link", 0.0)).poses("base_link")
    assert fixed == "odom"
    assert_pose(at(poses, 1.05), 10.5, 0.0, 0.0)


@pytest.mark.parametrize(
    ("frame", "apart"),
    [
        ("lidar", False),
        ("base_link", False),
        ("odom", False),
        ("map", False),
        ("", False),
        ("camera", True),
        ("/camera", True),
        ("radar", True),
    ],
)
def test_frames_that_the_transforms_say_nothing_of_are_apart(frame, apart):
    moving = [transform("odom", "base_link", t) for t in (0.0, 1.0)]
    static = [transform("base_link", "lidar", 0.0), transform("roof", "camera", 0.0)]
    assert tree(*moving, static=static).is_apart(frame) == apart
    loop = [transform("a", "camera", 0.0), transform("camera", "a", 0.0)]
    assert not tree(static=[*static, *loop]).is_apart(frame)


def test_a_sensor_whose_mounting_is_missing_gets_a_warning(tmp_path, caplog):
    with OddBag(tmp_path / "bag.mcap") as bag:
        objects, moving = bag.objects(), bag.channel("tf", TRANSFORMS)
        for i in range(20):
            driven = transform("odom", "base_link", i / 10, (i / 2, 0.0, 0.0))
            bag.add(moving, messages_of([driven]), i / 10)
            bag.add(objects, bytes_of(states_at(i / 10, frame="lidar")), i / 10)
    (recording,) = load_recordings(tmp_path / "bag.mcap", "bag")
    assert len(recording) == 60
    (record,) = caplog.records
    assert "objects come in frame 'lidar', which the bag's transforms do not" in record.message


OPTICAL = (-0.5, 0.5, -0.5, 0.5)
"""Rotation of a camera's optical frame in its vehicle: z ahead, x right, y down."""


def test_objects_of_an_optical_frame_are_refused_as_in_the_node(tmp_path):
    with OddBag(tmp_path / "bag.mcap") as bag:
        objects, moving = bag.objects(), bag.channel("/tf", TRANSFORMS)
        mount = transform("base_link", "camera", 0.0, (1.0, 0.0, 1.5), OPTICAL)
        bag.add(bag.channel("/tf_static", TRANSFORMS), messages_of([mount]), 0.0)
        for i in range(20):
            driven = transform("map", "base_link", i / 10, (i / 2, 0.0, 0.0))
            bag.add(moving, messages_of([driven]), i / 10)
            bag.add(objects, bytes_of(states_at(i / 10, frame="camera")), i / 10)
    sentence = "the z axis of frame 'camera' is tilted by 90 degrees in 'map', expected z up"
    with pytest.raises(RecordingError, match=sentence):
        load_recordings(tmp_path / "bag.mcap", "bag")


def test_a_sensor_that_looks_down_a_little_is_none_of_them():
    pitched = (0.0, math.sin(0.25), 0.0, math.cos(0.25))
    found = tree(
        *(transform("map", "base_link", t) for t in (0.0, 1.0)),
        static=[transform("base_link", "lidar", 0.0, (1.0, 0.0, 1.5), pitched)],
    )
    assert_pose(at(found.poses("lidar")[1], 0.5), 1.0, 0.0, 0.0)
    assert not found.unusable


def on_a_circle(time_s):
    """A vehicle at 5 m/s on a radius of 20 m."""
    angle = time_s / 4
    return (20 * math.sin(angle), 20 - 20 * math.cos(angle), 0.0), turned(angle)


@pytest.mark.parametrize("chain", ["direct", "below the map"])
def test_a_long_gap_is_no_straight_line(chain):
    times = [t / 10 for t in range(100) if not 30 < t < 60]
    driven = [transform("odom", "base_link", t, *on_a_circle(t)) for t in times]
    # The map moves a little, now and then, for which nothing is dropped.
    maps = [transform("map", "odom", t, (t / 100, 0.0, 0.0)) for t in (0.0, 5.0, 9.9)]
    more = [transform("map", "odom", t / 10, (0.0, 0.0, 0.0)) for t in range(100)]
    above = {"direct": [], "below the map": [*maps, *more]}[chain]
    poses = tree(*driven, *above).poses("base_link")[1]
    for time_s in (1.05, 3.0, 6.0, 8.35):
        found, (place, _) = at(poses, time_s), on_a_circle(time_s)
        assert math.dist((found.x, found.y), place[:2]) < 0.2
    for time_s in (3.1, 4.5, 5.9):
        with pytest.raises(FrameError, match=r"are 3\.000 s apart, expected at most 2\.500 s"):
            at(poses, time_s)


def test_a_frame_that_stands_through_a_gap_of_one_transform_is_known():
    still = [transform("map", "odom", t, (100.0, 0.0, 0.0)) for t in (0.0, 8.0)]
    driven = [transform("odom", "base_link", t / 10, (t / 2, 0.0, 0.0)) for t in range(80)]
    assert_pose(at(tree(*still, *driven).poses("base_link")[1], 4.0), 120.0, 0.0, 0.0)


def test_odometry_is_not_interpolated_over_a_long_gap(tmp_path, caplog):
    with OddBag(tmp_path / "bag.mcap") as bag:
        objects, moving = bag.objects(), bag.channel("/odom", "nav_msgs/msg/Odometry")
        for i in range(100):
            if not 30 < i < 60:
                bag.add(moving, odometry(i / 10), i / 10)
            bag.add(objects, bytes_of(states_at(i / 10, frame="base_link")), i / 10)
    (recording,) = load_recordings(tmp_path / "bag.mcap", "bag")
    assert recording.counts == {"not_lifted": 29}
    assert "29 messages that could not be transformed" in caplog.text


def test_objects_without_the_name_of_a_frame_get_a_remark(tmp_path, caplog):
    stream = [(t / 10, states_at(t / 10, frame="")) for t in range(20)]
    (recording,) = load_recordings(write_stream(tmp_path / "bag.mcap", stream), "bag")
    assert len(recording) == 60
    (record,) = caplog.records
    assert "objects come without the name of a frame: they are read as in" in record.message


@pytest.mark.parametrize(
    ("frame", "wanted", "fixed"),
    [
        ("base_link", "", "map"),
        ("base_link", "odom", "odom"),
        ("base_link", "map", "map"),
        ("base_link", "nowhere", "map"),
        ("odom", "", None),
        ("odom", "map", "map"),
        ("map", "map", None),
    ],
)
def test_a_wanted_fixed_frame_is_taken_where_the_transforms_lead_there(frame, wanted, fixed):
    found = tree(
        *(transform("map", "odom", t, (t, 0.0, 0.0)) for t in (0.0, 1.0)),
        *(transform("odom", "base_link", t, (0.0, t, 0.0)) for t in (0.0, 1.0)),
    ).poses(frame, wanted)
    assert (found and found[0]) == fixed


def test_a_fixed_frame_below_the_vehicle_is_as_good_as_one_above():
    """Some localisations publish where the map is in the vehicle's frame."""
    found = tree(
        transform("base_link", "map", 0.0, (-4.0, 3.0, 0.0), turned(-math.pi / 2)),
        transform("base_link", "map", 1.0, (-5.0, 3.0, 0.0), turned(-math.pi / 2)),
        static=[transform("base_link", "lidar", 0.0, (2.0, 0.0, 1.0))],
    )
    fixed, poses = found.poses("base_link")
    assert fixed == "map"
    assert_pose(at(poses, 0.0), 3.0, 4.0, math.pi / 2)
    assert_pose(at(poses, 0.5), 3.0, 4.5, math.pi / 2)
    fixed, poses = found.poses("lidar")
    assert fixed == "map"
    assert_pose(at(poses, 1.0), 3.0, 7.0, math.pi / 2)
    assert found.poses("map") is None


def test_a_static_frame_below_the_vehicle_says_nothing_of_its_way():
    below = [transform("base_link", "map", 0.0, (-4.0, 3.0, 0.0))]
    assert tree(static=below).poses("base_link") is None


def test_a_frame_that_moves_below_a_fixed_one_of_any_name_is_not_taken():
    found = tree(*(transform("utm", "map", t, (t, 0.0, 0.0)) for t in (0.0, 1.0)))
    assert found.poses("utm") is None


@pytest.mark.parametrize(("wanted", "fixed"), [("", "odom"), ("odom", "odom"), ("map", "map")])
def test_odometry_counts_unless_the_transforms_lead_where_it_does_not(tmp_path, wanted, fixed):
    path = tmp_path / "bag.mcap"
    with OddBag(path) as bag:
        moving, driven = bag.channel("/tf", TRANSFORMS), bag.channel("/odom", ODOMETRY)
        for i in range(10):
            links = [
                transform("map", "odom", i / 10, (100.0, 0.0, 0.0)),
                transform("odom", "base_link", i / 10, (i / 2, 0.0, 0.0)),
            ]
            bag.add(moving, messages_of(links), i / 10)
            bag.add(driven, odometry(i / 10), i / 10)
    with DecodingBagReader(path) as reader:
        lifted = BagPoses(reader, fixed_frame=wanted).lift(states_at(0.5, frame="base_link"))
    assert lifted.frame_id == fixed
    # The first object is 17 m ahead of the vehicle, which has driven 2.5 m.
    assert lifted.position[0, 0] == pytest.approx(19.5 + (100.0 if fixed == "map" else 0.0))


def test_transforms_have_the_type_of_the_first_versions_of_ros_1_as_well(tmp_path, caplog):
    early = "tf/msg/tfMessage"
    with OddBag(tmp_path / "bag.mcap") as bag:
        objects = bag.objects()
        moving = bag.channel("/tf", early, definition_of(TRANSFORMS))
        for i in range(20):
            driven = transform("map", "base_link", i / 10, (i / 2, 0.0, 0.0))
            bag.add(moving, messages_of([driven]), i / 10)
            bag.add(objects, bytes_of(states_at(i / 10, frame="base_link")), i / 10)
    (recording,) = load_recordings(tmp_path / "bag.mcap", "bag")
    # 10 m/s of the objects and 5 m/s of the vehicle.
    moved = recording.position[recording.track == 0][:, 0]
    np.testing.assert_allclose(np.diff(moved), 1.5, atol=1e-4)
    assert not caplog.records


def test_transforms_without_a_time_in_common_are_called_so(tmp_path):
    with OddBag(tmp_path / "bag.mcap") as bag:
        objects, moving = bag.objects(), bag.channel("/tf", TRANSFORMS)
        for i in range(20):
            links = [
                transform("map", "base_link", i / 10, (i / 2, 0.0, 0.0)),
                transform("base_link", "lidar", -EPOCH_NS / S_NS),  # as if it were static
            ]
            bag.add(moving, messages_of(links), i / 10)
            bag.add(objects, bytes_of(states_at(i / 10, frame="lidar")), i / 10)
    sentence = "the transforms from frame 'lidar' to 'map' have no time in common"
    with pytest.raises(RecordingError, match=sentence):
        load_recordings(tmp_path / "bag.mcap", "bag")
