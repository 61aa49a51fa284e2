# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the processes run that are killed; a fork server imports it by name, once."""

import contextlib
import os
import sys
import time


@contextlib.contextmanager
def _quiet():
    with open(os.devnull, "w") as nothing:
        os.dup2(nothing.fileno(), 1)
        os.dup2(nothing.fileno(), 2)
        yield


def mtpgo(arguments):
    """Run the command ``mtpgo``; the status of the process is its own."""
    from mtpgo_training import cli

    with _quiet():
        sys.exit(cli.main(arguments))


def build_cache(data, folder):
    """Read recordings through a cache that keeps them."""
    from mtpgo_training.data.data_sources import DataSource, read_sources
    from mtpgo_training.data.recording_cache import RecordingCache

    list(read_sources([DataSource(data, "ind")], RecordingCache(folder)))


def record(arguments, domain):
    """Run the executable ``record``."""
    os.environ["ROS_DOMAIN_ID"] = domain
    from mtpgo_ros import record as executable

    with _quiet():
        os._exit(executable.main(arguments) or 0)


def publish(topic, domain):
    """Publish numbered texts of 1 kB at 200 Hz until killed."""
    os.environ["ROS_DOMAIN_ID"] = domain
    import rclpy
    from rclpy.node import Node
    from std_msgs.msg import String

    rclpy.init()
    publisher = Node("numbers").create_publisher(String, topic, 100)
    number = 0
    while True:
        publisher.publish(String(data=f"{number:08d}" + 1000 * "x"))
        number += 1
        time.sleep(0.005)


PRELOADED = (
    "killed_jobs",
    "mtpgo_training.cli",
    "mtpgo_training.commands.convert",
    "mtpgo_training.commands.export",
    "mtpgo_training.commands.train",
    "mtpgo_training.data.data_sources",
    "mtpgo_training.data.recording_cache",
    "mtpgo_training.export.exporter",
    "mtpgo_training.training.trainer",
)
"""Modules that are imported before a process is forked, so that a job begins at once."""
