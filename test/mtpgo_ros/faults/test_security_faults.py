# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The policy that ships under DDS Security: keys are needed to hear the predictor and be heard."""

import os
import subprocess
import sys
import time

import pytest
import rclpy
from ros_helpers import LIMIT_S, ROOT, end, message_of, traffic
from sensor_msgs.msg import PointCloud2

keystore = pytest.importorskip("sros2.keystore", reason="sros2 (ROS 2 Jazzy) is not installed")

TRACKER_POLICY = """<policy version="0.2.0"><enclaves><enclave path="/tracker"><profiles>
<profile ns="/" node="tracker">
<topics publish="ALLOW"><topic>objects</topic><topic>parameter_events</topic></topics>
<topics subscribe="ALLOW"><topic>/predictor/predictions</topic></topics>
<services reply="ALLOW"><service>~/get_type_description</service></services>
</profile></profiles></enclave></enclaves></policy>"""

TRACKER = """
import rclpy
from rclpy.node import Node
from ros_helpers import message_of, traffic
from sensor_msgs.msg import PointCloud2
rclpy.init()
node = Node("tracker", enable_rosout=False, start_parameter_services=False)
objects = node.create_publisher(PointCloud2, "objects", 5)
heard = []
node.create_subscription(PointCloud2, "/predictor/predictions", heard.append, 5)
number = 0
while len(heard) < 10:
    number += 1
    objects.publish(message_of(traffic(0.1 * number)))
    rclpy.spin_once(node, timeout_sec=0.1)
"""

WITHOUT_SECURITY = "doesn't have the security libraries"
"""What Fast DDS says where it was built without them, as for pip."""


@pytest.fixture
def secure(tmp_path, monkeypatch):
    """Processes that are started need keys; there are those of the predictor and a tracker."""
    keys, policy = tmp_path / "keys", tmp_path / "tracker.xml"
    policy.write_text(TRACKER_POLICY)
    keystore.create_keystore(keys)
    shipped = ROOT / "config" / "sros2" / "predictor.policy.xml"
    for name, file in (("predictor", shipped), ("tracker", policy)):
        keystore.create_enclave(keys, f"/{name}")
        keystore.create_permission(keys, f"/{name}", file)
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", str(keys))
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")


@pytest.mark.usefixtures("secure")
def test_a_stranger_without_keys_neither_hears_nor_is_heard(process, peer, models):
    stolen = []
    peer.create_subscription(PointCloud2, "/predictor/predictions", stolen.append, 5)
    injected = peer.create_publisher(PointCloud2, "/objects", 5)
    model = f"model:={models['quick']}"
    predictor = process("predictor", "--ros-args", "--enclave", "/predictor", "-p", model)
    try:
        predictor.wait_for("ready")
    except AssertionError as error:
        if WITHOUT_SECURITY in str(error):
            pytest.skip("Fast DDS was built without DDS Security")
        raise
    path = os.pathsep.join([str(ROOT), str(ROOT / "test" / "mtpgo_ros"), *sys.path])
    tracker = subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", TRACKER, "--ros-args", "--enclave", "/tracker"],
        env={**os.environ, "PYTHONPATH": path},
    )
    try:
        end_s = time.monotonic() + LIMIT_S
        while tracker.poll() is None:
            assert time.monotonic() < end_s, "the tracker has heard no predictions"
            injected.publish(message_of(traffic(100.0, 1)))
            rclpy.spin_once(peer, timeout_sec=0.05)
    finally:
        end(tracker)
    assert tracker.returncode == 0
    assert not stolen
    assert injected.get_subscription_count() == 0
