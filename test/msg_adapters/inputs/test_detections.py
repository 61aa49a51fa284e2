# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Detection3DArray of vision_msgs: box, class of the best hypothesis, round trip."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from msg_adapters.bags.bag_types import bag_typestore, earlier_typestore
from msg_adapters.inputs.detections import PACKAGE
from msg_adapters.registry import INPUTS
from msg_adapters.types import TypestoreTypes
from mtpgo_core.class_map import class_map
from mtpgo_core.identity import keys_from_integers, keys_from_strings
from mtpgo_core.schema import AgentClass

ADAPTER = INPUTS["vision"]


def detection(types, number, results=(("car", 0.9),), *, position=(1.0, 2.0), yaw=0.0):
    make = types.make
    stale = make(
        "std_msgs/msg/Header",
        stamp=make("builtin_interfaces/msg/Time", sec=1, nanosec=0),
        frame_id="camera",
    )
    center = make(
        "geometry_msgs/msg/Pose",
        position=make("geometry_msgs/msg/Point", x=position[0], y=position[1], z=0.25),
        orientation=make(
            "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2)
        ),
    )
    covariance = np.zeros(36)
    covariance[[0, 1, 6, 7]] = 0.4, 0.1, 0.1, 0.2
    return make(
        PACKAGE + "Detection3D",
        header=stale,
        results=[
            make(
                PACKAGE + "ObjectHypothesisWithPose",
                hypothesis=make(PACKAGE + "ObjectHypothesis", class_id=name, score=score),
                pose=make("geometry_msgs/msg/PoseWithCovariance", covariance=covariance),
            )
            for name, score in results
        ],
        bbox=make(
            PACKAGE + "BoundingBox3D",
            center=center,
            size=make("geometry_msgs/msg/Vector3", x=4.0, y=2.0, z=1.5),
        ),
        id=number,
    )


def detections(types, *items):
    header = types.make(
        "std_msgs/msg/Header",
        stamp=types.make("builtin_interfaces/msg/Time", sec=9, nanosec=7),
        frame_id="map",
    )
    return types.make(PACKAGE + "Detection3DArray", header=header, detections=list(items))


def test_box_centre_yaw_size_and_the_arrays_header(offline, decoded):
    message = detections(offline, detection(offline, "17", position=(3.0, -4.0), yaw=2.5))
    for again in decoded(message, ADAPTER.message_type).values():
        states = ADAPTER.to_states(again)
        assert (states.stamp_ns, states.frame_id) == (9_000_000_007, "map")
        np.testing.assert_allclose(states.position, [[3.0, -4.0]])
        np.testing.assert_allclose(states.z, [0.25])
        np.testing.assert_allclose(states.yaw, [2.5])
        np.testing.assert_allclose(states.size, [[4.0, 2.0]])
        np.testing.assert_allclose(states.covariance[0, :2, :2], [[0.4, 0.1], [0.1, 0.2]])
        for unknown in (states.velocity, states.acceleration, states.covariance[:, 2:]):
            assert np.isnan(unknown).all()


def test_an_empty_id_is_no_track_and_is_counted(offline, decoded):
    message = detections(offline, *(detection(offline, name) for name in ("", "4", "", "front/7")))
    for again in decoded(message, ADAPTER.message_type).values():
        report = ADAPTER.decode(again)
        wanted = np.concatenate([keys_from_integers([4]), keys_from_strings(["front/7"])])
        np.testing.assert_array_equal(report.states.key, wanted)
        assert report.skipped == {"detection without an id": 2}
        assert report.skipped_total == 2


@pytest.mark.parametrize(
    ("results", "agent_class"),
    [
        ((("car", 0.3), ("Pedestrian", 0.6), ("truck", 0.1)), AgentClass.PEDESTRIAN),
        ((("3", 1.0),), AgentClass.BUS),
        ((("99", 1.0),), AgentClass.UNKNOWN),
        ((("unicorn", 1.0),), AgentClass.UNKNOWN),
        ((("car", np.nan), ("bicycle", 0.2)), AgentClass.BICYCLE),
        ((), AgentClass.UNKNOWN),
    ],
)
def test_class_of_the_best_hypothesis(offline, results, agent_class):
    states = ADAPTER.to_states(detections(offline, detection(offline, "1", results)))
    assert states.agent_class.tolist() == [agent_class]
    if not results:
        assert np.isnan(states.covariance).all()


def test_a_class_map_reads_the_detectors_own_names(offline):
    names = ["vehicle.car", "2", "tram", ""]
    message = detections(
        offline, *(detection(offline, str(i), ((name, 1.0),)) for i, name in enumerate(names))
    )

    def read(name):
        return ADAPTER.to_states(message, class_map=class_map(name)).agent_class.tolist()

    assert read("") == [AgentClass.UNKNOWN, AgentClass.TRUCK, AgentClass.UNKNOWN, 0]
    assert read("nuscenes") == [AgentClass.CAR, AgentClass.TRUCK, AgentClass.UNKNOWN, 0]
    assert read("coco") == [AgentClass.UNKNOWN, AgentClass.CAR, AgentClass.UNKNOWN, 0]


def test_round_trip(states, offline, decoded, assert_equal):
    covariance = states.covariance.copy()
    covariance[:, 2:] = covariance[:, :, 2:] = np.nan
    unknown = np.full((len(states), 2), np.nan)
    wanted = dataclasses.replace(
        states, velocity=unknown, acceleration=unknown, covariance=covariance
    )
    for again in decoded(ADAPTER.from_states(states, offline), ADAPTER.message_type).values():
        assert_equal(ADAPTER.to_states(again), wanted)


def test_detections_recorded_with_earlier_versions_of_the_message():
    now, types = TypestoreTypes(bag_typestore()), TypestoreTypes(earlier_typestore())
    pose = now.make("geometry_msgs/msg/PoseWithCovariance")

    def earlier(**fields):
        results = [
            types.make(PACKAGE + "ObjectHypothesisWithPose", id=name, score=score, pose=pose)
            for name, score in (("truck", 0.2), ("bus", 0.7))
        ]
        return types.make(PACKAGE + "Detection3D", results=results, **fields)

    tracked = earlier(tracking_id="12", is_tracking=True)
    message = types.make(PACKAGE + "Detection3DArray", detections=[tracked, earlier()])
    decoded = ADAPTER.decode(message)
    np.testing.assert_array_equal(decoded.states.key, keys_from_integers([12]))
    assert decoded.states.agent_class.tolist() == [AgentClass.BUS]
    assert decoded.skipped == {"detection without an id": 1}
    # The versions between had no track at all.
    untracked = SimpleNamespace(results=[], bbox=tracked.bbox)
    message = SimpleNamespace(header=message.header, detections=[untracked])
    assert ADAPTER.decode(message).skipped == {"detection without an id": 1}
