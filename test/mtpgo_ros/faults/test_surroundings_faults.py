# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Faults of the machine and of the other nodes around the predictor, over real DDS."""

import contextlib
import os
import resource
import signal
import statistics
import subprocess
import sys
import time

import numpy as np
import pytest
from fault_harness import ERROR, OK, PATIENT_S, RELIABLE, check_invariants
from fault_tools import Resources, ServiceManager, sources
from nav_msgs.msg import Odometry
from ros_helpers import START_NS, end
from sensor_msgs.msg import PointCloud2

from mtpgo_core.resources import find_resource
from mtpgo_core.schema import Source
from mtpgo_training.demo.demo_pipeline import SHIPPED


@pytest.fixture(scope="module")
def manager(tmp_path_factory):
    """A service manager that expects a sign of life every second."""
    return ServiceManager(tmp_path_factory.mktemp("service") / "notify")


@pytest.fixture(scope="module")
def node(start_predictor, manager, tmp_path_factory):
    """A predictor as a service: no HOME, logs nowhere, a watchdog, two unknown parameters."""
    shared = tmp_path_factory.mktemp("parameters") / "shared.yaml"
    shared.write_text(
        "/**:\n  ros__parameters:\n    camera_topic: /camera\n    rate: 5.0\n"
        "/**/predictor:\n  ros__parameters:\n    max_agent: 3\n"
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("HOME", raising=False)
        patch.setenv("ROS_LOG_DIR", "/proc/no_folder_of_ours")
        patch.setenv("NOTIFY_SOCKET", manager.path)
        patch.setenv("WATCHDOG_USEC", "400000")
        node = start_predictor(
            fixed_frame="odom",
            input_timeout=PATIENT_S,
            modell="highway",
            arguments=["--params-file", str(shared)],
            wait=False,
        )
    node.process.wait_for("hearing", node.spin)
    node.process.wait_for("heard by", node.spin)
    node.healthy_in_odom = lambda: node.predict_next(frame_id="odom")
    return node


@pytest.fixture(scope="module", autouse=True)
def before(node):
    """Threads and memory of the predictor at the start."""
    for _ in range(3):
        node.healthy_in_odom()
    return Resources(node)


@pytest.fixture(scope="module")
def odometry(node):
    """The publisher of the vehicle's odometry."""
    publisher = node.peer.create_publisher(Odometry, "odometry", 50)
    node.until(lambda: publisher.get_subscription_count() > 0)
    return publisher


def pose(time_s, *, x=0.0, parent="odom", child="base_link"):
    """Return the odometry of a vehicle that stands at ``x``, at a time (s) of the stream."""
    message = Odometry(child_frame_id=child)
    message.header.frame_id = parent
    stamp_ns = START_NS + round(time_s * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.pose.pose.position.x = x
    message.pose.pose.orientation.w = 1.0
    return message


def in_vehicle(node):
    """Return healthy traffic in the vehicle's frame."""
    return node.states(frame_id="base_link")


def let_handle(node):
    """Wait until the node has handled what came before: twice since it has made diagnostics."""
    node.settle()
    node.settle()


def log_of(node):
    """Return everything that the process has printed."""
    return "".join([*node.process.out, *node.process.err])


def test_no_home_and_an_unwritable_log_folder(node):
    (line,) = [line for line in log_of(node).splitlines() if "log files go to" in line]
    assert "/proc/no_folder_of_ours is not writable" in line
    assert "ROS_LOG_DIR" in line


def test_a_service_manager_with_a_watchdog(node, manager):
    node.until(lambda: manager.hears("READY=1"), "ready")
    node.until(lambda: manager.hears("WATCHDOG=1"), "a sign of life")
    node.until(lambda: manager.hears("STATUS="), "a sentence")


def test_parameters_that_the_node_does_not_have(node):
    lines = [line for line in log_of(node).splitlines() if "has no effect" in line]
    found = {line.split("parameter ")[1].split()[0]: line for line in lines}
    assert set(found) == {"modell", "max_agent", "camera_topic"}
    assert len(lines) == 3  # each once
    assert "WARN" in found["modell"]
    assert "did you mean model?" in found["modell"]
    assert "WARN" in found["max_agent"]
    assert "did you mean max_agents?" in found["max_agent"]
    assert "INFO" in found["camera_topic"]  # a file for all nodes


def test_odometry_that_is_missing(node):
    with node.counts(not_lifted=1):
        node.send(in_vehicle(node))
    node.level("input", ERROR, "nothing came there")
    node.healthy_in_odom()
    node.until(lambda: node.healthy_in_odom() is not None and node.statuses["input"].level == OK)


def test_tf_that_is_absent(node):
    """Without tf2_ros the sentence names the topic; with it, the transform that is missing."""
    node.send(in_vehicle(node))
    node.level("input", ERROR, "'base_link'")


def test_odometry_of_another_frame(node, odometry):
    def told():
        """Return whether it was heard; discovery may end later on the other side than here."""
        odometry.publish(pose(node.time_s, child="trailer"))
        node.send(in_vehicle(node))
        return node.comes_true(lambda: "'trailer'" in node.statuses["input"].message, 0.5)

    node.until(told, "the odometry of a trailer")
    with node.counts(not_lifted=1):
        node.send(in_vehicle(node))
    node.level("input", ERROR, "'trailer'")


def test_odometry_of_another_frame_beside_the_right_one(node, odometry):
    def answered():
        """Return whether an observation has an answer; what is sent before discovery is lost."""
        states = in_vehicle(node)
        odometry.publish(pose(node.time_s))
        for other in ({"child": "trailer"}, {"parent": "earth"}):
            odometry.publish(pose(node.time_s, **other))
        let_handle(node)
        node.send(states)
        return node.comes_true(lambda: node.answered(states.stamp_ns), 0.5)

    node.fresh()
    node.until(answered, "an answer with three kinds of odometry")


def test_odometry_that_is_late(node, odometry):
    node.fresh()
    odometry.publish(pose(node.time_s - 5.0))
    odometry.publish(pose(node.time_s - 4.9))
    let_handle(node)
    with node.counts(not_lifted=1):
        node.send(in_vehicle(node))
    node.level("input", ERROR)


def test_odometry_that_jumps(node, odometry):
    node.fresh()
    for step in range(6):
        x = 0.0 if step < 3 else 500.0
        states = in_vehicle(node)
        odometry.publish(pose(node.time_s, x=x))
        let_handle(node)
        if step == 3:
            with node.counts(restarted=4):
                node.send(states)
                prediction = node.answer(states.stamp_ns).prediction
        else:
            node.send(states)
            prediction = node.answer(states.stamp_ns).prediction
        check_invariants(prediction)
        assert prediction.frame_id == "odom"
        # The tracks are in the new place at once, and nothing is predicted across the jump.
        first = prediction.mean[:, 0, 0, 0] - (states.position[:, 0] + x)
        assert np.abs(first).max() < 5.0
    node.fresh()
    node.healthy_in_odom()


def test_a_subscriber_that_never_reads(node):
    deaf = node.peer.create_subscription(PointCloud2, "predictor/predictions", print, RELIABLE)
    node.executor.remove_node(node.peer)  # nothing of this side is served for a while
    for _ in range(30):
        states = node.states(frame_id="odom")
        node.send(states)
        time.sleep(0.01)
    node.executor.add_node(node.peer)
    node.until(lambda: node.answered(states.stamp_ns), "the prediction of the last")
    node.peer.destroy_subscription(deaf)
    node.time_s += 1.0
    node.healthy_in_odom()


STOPPED = """
import sys
import rclpy
from sensor_msgs.msg import PointCloud2
rclpy.init()
node = rclpy.create_node("stopped", namespace=sys.argv[1])
node.create_subscription(PointCloud2, "predictor/predictions", lambda _: print(1, flush=True), 1)
rclpy.spin(node)
"""


def _usual_s(node, cycles):
    """Return the median time of healthy cycles (s).

    Not the sum: the harness waits long for the answer to an observation that was lost, which
    happens once in a while with or without the fault.
    """
    durations = []
    for _ in range(cycles):
        begin_s = time.monotonic()
        node.healthy_in_odom()
        durations.append(time.monotonic() - begin_s)
    return statistics.median(durations)


def test_a_subscriber_that_is_stopped(node):
    other = subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", STOPPED, node.namespace],
        stdout=subprocess.PIPE,
        text=True,
        # A process that is stopped while it holds a lock of Fast DDS's shared memory holds up the
        # others (docs/node.md, MTPGO_TRANSPORT), which would be a matter of luck here.
        env=os.environ | {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"},
    )
    try:
        os.set_blocking(other.stdout.fileno(), False)
        node.until(lambda: node.healthy_in_odom() is not None and other.stdout.readline())
        reading_s = _usual_s(node, 15)
        other.send_signal(signal.SIGSTOP)
        # Beside the same while it reads, and several times, since the machine may be busy.
        assert any(_usual_s(node, 30) < 3.0 * reading_s for _ in range(3))
    finally:
        end(other)


def test_a_full_disk(node):
    """No file can grow: as on a full disk, every write of a log line fails."""
    process = node.process.popen.pid
    before = resource.prlimit(process, resource.RLIMIT_FSIZE)
    resource.prlimit(process, resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        with node.counts(unstamped=1):
            states = node.states(frame_id="odom")
            node.send(type(states)(**{**vars(states), "stamp_ns": 0}))
        node.healthy_in_odom()
    finally:
        resource.prlimit(process, resource.RLIMIT_FSIZE, before)
    node.healthy_in_odom()


def test_no_more_files_may_be_opened(node):
    process = node.process.popen.pid
    before = resource.prlimit(process, resource.RLIMIT_NOFILE)
    resource.prlimit(process, resource.RLIMIT_NOFILE, (3, before[1]))
    try:
        node.healthy_in_odom()
        node.healthy_in_odom()
    finally:
        resource.prlimit(process, resource.RLIMIT_NOFILE, before)
    node.healthy_in_odom()


def test_one_core_shared_with_a_cpu_hog(node):
    process, core = node.process.popen.pid, min(os.sched_getaffinity(0))
    threads = [int(name) for name in os.listdir(f"/proc/{process}/task")]
    before = os.sched_getaffinity(process)
    hog = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    os.sched_setaffinity(hog.pid, {core})
    first = len(node.answers)
    try:
        for thread in threads:
            with contextlib.suppress(ProcessLookupError):
                os.sched_setaffinity(thread, {core})
        for _ in range(10):  # late or at constant velocity, but never wrong
            node.healthy_in_odom()
    finally:
        hog.kill()
        hog.wait()
        for thread in threads:
            with contextlib.suppress(ProcessLookupError):  # a thread that has ended
                os.sched_setaffinity(thread, before)
    assert set(sources(node, first)) <= {int(Source.MODEL), int(Source.CONSTANT_VELOCITY)}


def test_threads_and_memory_are_as_before(node, before):
    node.fresh().healthy_in_odom()
    before.check()


@pytest.mark.parametrize("name", ["predictor", "replay", "record"])
def test_the_launch_process_ends_and_takes_the_node_with_it(tmp_path, models, name):
    """``ros2 launch`` leaves its processes behind when it is ended by SIGTERM."""
    arguments, word = {
        "predictor": (["--ros-args", "-p", f"model:={models['quick']}"], "ready"),
        "replay": ([str(find_resource(*SHIPPED)), "--loop"], "replay:"),  # the progress bar
        "record": (["-o", str(tmp_path / "bag")], "ready"),
    }[name]
    launcher = (
        "import subprocess, sys, time\n"
        "child = subprocess.Popen([sys.executable, '-W', 'ignore', '-m', sys.argv[1],"
        " '--end-with-parent', *sys.argv[2:]], stdout=sys.stderr)\n"
        "print(child.pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", launcher, f"mtpgo_ros.{name}", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as parent:
        child = int(parent.stdout.readline())
        for line in parent.stderr:
            if word in line:
                break
        parent.terminate()
        parent.stderr.read()  # ends when the node has ended
        assert not os.path.exists(f"/proc/{child}/stat") or "Z" in state_of_process(child)


def state_of_process(number):
    """Return the state of a process, Z for one that has ended."""
    with open(f"/proc/{number}/stat", encoding="utf-8") as file:
        return file.read().rpartition(")")[2].split()[0]
