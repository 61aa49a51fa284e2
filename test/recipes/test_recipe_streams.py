# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The recipes with a real node and bytes of the stacks' messages over the middleware.

Each runs with the definitions of msg_adapters/wire and, where they were fetched or are installed,
with those that the stacks release (interface_files.py).
"""

import math

import numpy as np
import pytest
from interface_files import folder, released_definitions, typestore_of
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from nav_msgs.msg import Odometry
from recipe_file import read_recipe
from ros_helpers import init
from stack_bench import StackBench, stand_in
from stack_messages import SENSOR_POSE, START_NS, TYPES, StackMessages, scene, uuid_of
from tiny_model import write_tiny_model

from msg_adapters.registry import adapter_for_type
from msg_adapters.wire.definitions import DEFINITIONS
from mtpgo_core.identity import key_to_int
from mtpgo_core.schema import AgentClass

# The first node tries the model out in a process of its own: long on a busy machine.
pytestmark = pytest.mark.timeout(600)

PREDICTED = "autoware_perception_msgs/msg/PredictedObjects"
STEPS = 8


@pytest.fixture(scope="module", params=["repeated", "released"])
def messages(request):
    """The stacks' messages with our copy of the definitions, or with the released ones."""
    if request.param == "repeated":
        return StackMessages(typestore_of(DEFINITIONS))
    released = released_definitions()
    packages = {name.partition("/")[0] for name in TYPES.values()}
    missing = packages - {name.partition("/")[0] for name in released}
    if missing:
        pytest.skip(f"{', '.join(sorted(missing))} neither installed nor in {folder()}")
    return StackMessages(typestore_of(released))


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    init()
    return write_tiny_model(tmp_path_factory.mktemp("model") / "tiny.pt")


@pytest.fixture
def bench(monkeypatch, messages, model):
    """Return a function that starts a recipe; everything is closed at the end."""
    made = []

    def make(stack, kind=None, **given):
        kind = kind or stack
        (recipe, *_) = read_recipe(stack, **given)
        objects_type = stand_in(monkeypatch, messages.typestore, TYPES[kind])
        # The type that is published is that of the stand-in, so `auto` does not find it.
        recipe.parameters["input_type"] = adapter_for_type(TYPES[kind]).name
        del recipe.parameters["model"]
        made.append(StackBench(recipe, objects_type, model))
        made[-1].start()
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.parametrize("stack", sorted(TYPES))
def test_the_adapter_reads_the_bytes(messages, stack):
    """From the stack's bytes to what the core gets, against the scene they were made of."""
    name = TYPES[stack]
    data = messages.octets(stack, 0.5)
    adapter = adapter_for_type(name)
    adapter.check_serialized(data, adapter_limits())
    states = adapter.decode(messages.typestore.deserialize_cdr(data, name)).states
    bodies = scene(0.5)
    assert states.stamp_ns == START_NS + 500_000_000
    if stack == "vision":
        assert states.frame_id == "lidar"
        assert [key_to_int(key) for key in states.key] == [1, 2, 3]
        assert np.isnan(states.velocity).all()
        return
    assert states.frame_id == "map"
    np.testing.assert_allclose(states.position, [(body.x, body.y) for body in bodies])
    np.testing.assert_allclose(states.size, [(b.length, b.width) for b in bodies], rtol=1e-6)
    assert states.agent_class.tolist() == [AgentClass.CAR, AgentClass.CAR, AgentClass.PEDESTRIAN]
    first = bodies[0]
    along = [math.cos(first.yaw) * first.speed, math.sin(first.yaw) * first.speed]
    np.testing.assert_allclose(states.velocity[0], along)
    np.testing.assert_allclose(states.velocity[1], 0.0)


def adapter_limits():
    from msg_adapters.wire.input_limits import DEFAULT_LIMITS

    return DEFAULT_LIMITS


def test_autoware_gets_predicted_objects_from_tracked_objects(bench, messages, monkeypatch):
    predicted = stand_in(monkeypatch, messages.typestore, PREDICTED)
    one = bench("autoware")
    heard = one.listen(predicted, "/perception/object_recognition/objects")
    ego = one.peer.create_publisher(Odometry, "/localization/kinematic_state", 10)
    one.until(lambda: ego.get_subscription_count() > 0)
    for step in range(STEPS):
        # The ego is in the graph; its planner knows its way, so it is not among the predictions.
        ego.publish(odometry(START_NS + 100_000_000 * step, "map", "base_link"))
        one.send(messages, "autoware", 0.1 * step)
        one.until(lambda number=step + 1: len(heard) >= number)
    message = messages.typestore.deserialize_cdr(heard[-1], PREDICTED)
    bodies = scene(0.1 * (STEPS - 1))
    stamp = message.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == START_NS + round(1e8 * (STEPS - 1))
    assert message.header.frame_id == "map"
    by_uuid = {bytes(item.object_id.uuid): item for item in message.objects}
    assert set(by_uuid) == {uuid_of(body.number) for body in bodies}
    for body in bodies:
        item = by_uuid[uuid_of(body.number)]
        kinematics = item.kinematics
        assert item.classification[0].label == {"car": 1, "pedestrian": 7}[body.kind]
        paths = kinematics.predicted_paths
        assert 1 <= len(paths) <= 3
        confidence = [path.confidence for path in paths]
        assert confidence == sorted(confidence, reverse=True)
        assert sum(confidence) == pytest.approx(1.0, abs=1e-5)
        pose = kinematics.initial_pose_with_covariance.pose
        assert (pose.position.x, pose.position.y) == pytest.approx((body.x, body.y), abs=1e-3)
        for path in paths:
            assert path.path[0].position.x == pytest.approx(body.x, abs=1e-3)
            step_s = path.time_step.sec + 1e-9 * path.time_step.nanosec
            assert step_s * (len(path.path) - 1) == pytest.approx(5.0)
    first = by_uuid[uuid_of(bodies[0].number)].kinematics
    ahead = first.predicted_paths[0].path[-1].position
    travelled = math.hypot(ahead.x - bodies[0].x, ahead.y - bodies[0].y)
    assert travelled == pytest.approx(5.0 * bodies[0].speed, rel=0.05)
    forward = first.initial_twist_with_covariance.twist.linear
    assert (forward.x, forward.y) == pytest.approx((bodies[0].speed, 0.0), abs=0.2)


def test_carla_objects_are_predicted_on_simulated_time(bench, messages):
    one = bench("carla")
    assert one.node.get_parameter("use_sim_time").value is True
    for step in range(STEPS):
        one.send(messages, "carla", 0.2 * step)
        one.until(lambda number=step + 1: len(one.predictions) >= number)
    prediction, bodies = one.predictions[-1], scene(0.2 * (STEPS - 1))
    assert prediction.frame_id == "map"
    found = {key_to_int(key): row for row, key in enumerate(prediction.key)}
    assert sorted(found) == [101, 102, 103]
    row = found[101]
    assert prediction.agent_class[row] == AgentClass.CAR
    end = prediction.mean[row, 0, -1, :2]
    way = end - np.array([bodies[0].x, bodies[0].y])
    assert np.hypot(*way) == pytest.approx(5.0 * bodies[0].speed, rel=0.05)
    assert math.atan2(way[1], way[0]) == pytest.approx(bodies[0].yaw, abs=0.1)


def test_vision_tracks_are_predicted_in_the_fixed_frame(bench, messages):
    arguments = {"objects": "/tracks", "fixed_frame": "odom", "class_map": "coco"}
    one = bench("vision", odometry="/odometry", **arguments)
    poses = one.peer.create_publisher(Odometry, "/odometry", 10)
    one.until(lambda: poses.get_subscription_count() > 0)
    last = STEPS - 1
    for step in range(STEPS):
        stamp_ns = START_NS + 200_000_000 * step
        poses.publish(odometry(stamp_ns))
        transform = one.node._pipeline.transform
        one.until(lambda at=stamp_ns, known=transform: newest_ns(known) >= at)
        one.send(messages, "vision", 0.2 * step)
        one.until(lambda number=step + 1: len(one.predictions) >= number)
    prediction, bodies = one.predictions[-1], scene(0.2 * last)
    assert prediction.frame_id == "odom"
    found = {key_to_int(key): row for row, key in enumerate(prediction.key)}
    kinds = [AgentClass(int(prediction.agent_class[found[body.number]])) for body in bodies]
    assert kinds == [AgentClass.CAR, AgentClass.CAR, AgentClass.PEDESTRIAN]
    for body in bodies:
        x, y, vx, vy = prediction.mean[found[body.number], 0, 0]
        # Velocities are estimated from the positions.
        velocity = (body.speed * math.cos(body.yaw), body.speed * math.sin(body.yaw))
        assert (vx, vy) == pytest.approx(velocity, abs=0.5)
        ahead_s = prediction.time_s[0]
        assert x == pytest.approx(body.x + ahead_s * velocity[0], abs=0.1)
        assert y == pytest.approx(body.y + ahead_s * velocity[1], abs=0.1)


def test_a_lifecycle_manager_brings_the_predictor_of_nav2_up_and_down(bench, messages):
    one = bench("nav2", "vision", objects="/people", fixed_frame="odom", odometry="/odometry")
    poses = one.peer.create_publisher(Odometry, "/odometry", 10)

    def change(transition):
        request = ChangeState.Request(transition=Transition(id=transition))
        return call(one, ChangeState, "change_state", request).success

    def state():
        return call(one, GetState, "get_state", GetState.Request()).current_state.id

    assert state() == State.PRIMARY_STATE_UNCONFIGURED
    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    assert state() == State.PRIMARY_STATE_ACTIVE
    one.wait_for_peers()
    one.until(lambda: poses.get_subscription_count() > 0)
    poses.publish(odometry(START_NS))
    transform = one.node._pipeline.transform
    one.until(lambda: newest_ns(transform) >= START_NS)
    one.send(messages, "vision", 0.0)
    one.until(lambda: one.predictions)
    assert one.predictions[0].frame_id == "odom"
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert change(Transition.TRANSITION_CLEANUP)
    assert state() == State.PRIMARY_STATE_UNCONFIGURED


def odometry(stamp_ns, frame_id="odom", child_frame_id="lidar"):
    """Return the pose of the sensor, which stands still."""
    x, y, yaw = SENSOR_POSE
    message = Odometry(child_frame_id=child_frame_id)
    message.header.frame_id = frame_id
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z = math.sin(yaw / 2)
    message.pose.pose.orientation.w = math.cos(yaw / 2)
    return message


def newest_ns(transform):
    """Return the time of the newest pose that the node knows."""
    # A copy: odometry of other frames may come meanwhile.
    return max((one._stamp[-1] for one in [*transform._poses.values()] if len(one)), default=0)


def call(one, kind, service, request):
    """Return the answer of one of the node's services."""
    client = one.peer.create_client(kind, one.topic(service))
    one.until(client.service_is_ready)
    future = client.call_async(request)
    one.until(future.done)
    one.peer.destroy_client(client)
    return future.result()


def test_our_copy_of_the_definitions_is_that_of_the_releases():
    released = released_definitions()
    if not released:
        pytest.skip(f"no released definitions: neither installed nor in {folder()}")
    ours, theirs = typestore_of(DEFINITIONS), typestore_of(released)
    packages = {name.partition("/")[0] for name in released}
    compared = [name for name in DEFINITIONS if name.partition("/")[0] in packages]
    assert compared
    for name in compared:
        assert ours.fielddefs[name][1] == theirs.fielddefs[name][1], name
