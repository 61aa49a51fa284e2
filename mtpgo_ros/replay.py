# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK
"""``replay``: plays a bag in real time or faster, with ``/clock`` and a progress bar.

The recorded bytes are published as they are: nothing is decoded, and any installed message type
can be played. Where ROS 2 is installed, ``ros2 bag play --clock`` does the same.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from mtpgo_core.errors import MtpgoError, RecordingError
from mtpgo_core.maps.lane_file_options import AUTO, PROJECTIONS, LaneFileOptions
from mtpgo_core.processes.parent_process import end_with_parent
from mtpgo_ros.runtime.executable import (
    ArgumentParser,
    Interrupted,
    add_end_with_parent,
    answered,
    fail,
    interruptible,
    not_negative,
    positive,
    run_as_process,
    stop_on_signals,
    tell,
)

if TYPE_CHECKING:
    from mtpgo_ros.bags.clock_gap import PlayedPart
    from mtpgo_ros.bags.playback import PlaybackTiming

_SWITCH_INTERVAL_S = 5e-4
"""Longest time that the reading thread keeps the interpreter (s), a tenth of Python's default;
chosen: no message waits longer for it."""

_LONGEST_S = 1e10
"""Longer times on the command line count as this (s): no bag lasts three hundred years."""


def main(argv: Sequence[str] | None = None) -> int | None:
    """Entry of the executable ``replay``.

    Args:
        argv: arguments, by default the process's; ``--ros-args`` may follow.

    Returns:
        0 when the bag was played or the user ended it, 2 for bad input.
    """
    stopped = stop_on_signals()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    arguments = list(sys.argv[1:] if argv is None else argv)
    if answered("replay", arguments, _parser):
        return 0
    import rclpy

    from mtpgo_ros.runtime.ros_start import own_arguments, start

    try:
        options = _parser().parse_args(own_arguments(arguments))
        if options.end_with_parent:
            end_with_parent()
        start(arguments)
        _replay(options, stopped)
    except MtpgoError as error:
        status = fail("replay", error)
    except Interrupted:
        status = 0
    else:
        status = 0
    rclpy.try_shutdown()
    return status


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(prog="replay", description=__doc__.split("\n\n")[0])
    add = parser.add_argument
    add("bag", type=Path, help="rosbag2 directory, or one .mcap or .db3 file")
    add("--rate", type=positive, default=1.0, help="seconds of the bag per second (1)")
    add("--loop", action="store_true", help="start again at the end, until interrupted")
    add(
        "--start-offset",
        type=not_negative,
        default=0.0,
        metavar="S",
        help="skip this much of the bag (s)",
    )
    add("--duration", type=positive, metavar="S", help="play this much of the bag (s)")
    add("--topics", action="extend", nargs="+", metavar="TOPIC", help="play only these topics")
    add(
        "--clock-rate",
        type=not_negative,
        default=100.0,
        metavar="HZ",
        help="ticks of /clock per second, 0 for no /clock (100)",
    )
    add(
        "--wait-for-subscribers",
        type=int,
        default=0,
        metavar="N",
        help="start when this many nodes subscribe to one of the topics",
    )
    add(
        "--wait-timeout",
        type=positive,
        default=60.0,
        metavar="S",
        help="give up waiting for subscribers after this long (60 s)",
    )
    add(
        "--delay",
        type=not_negative,
        default=0.5,
        metavar="S",
        help="time between the publishers' start and the first message, for discovery (0.5 s)",
    )
    add(
        "--lane-file",
        metavar="FILE",
        help="publish the lanes of a Lanelet2 map (OSM) or GeoJSON on /lane_markings, latched, in "
        "place of the bag's",
    )
    add(
        "--lane-projection",
        default=AUTO,
        choices=PROJECTIONS,
        help="how its coordinates become metres: those in the file, or of latitude and longitude "
        "(auto)",
    )
    add("--lane-origin", default="", metavar="LAT,LON", help="origin of the metres (degrees)")
    add("--lane-offset", default="", metavar="X,Y", help="subtracted from the metres (m)")
    add("--lane-frame", default="map", help="frame of the metres (map)")
    add("--start-paused", action="store_true", help="start when Enter is pressed")
    add("--no-progress", action="store_true", help="no progress bar")
    add_end_with_parent(parser)
    return parser


def _replay(options: argparse.Namespace, stopped: Callable[[], bool]) -> None:
    """Play a bag as the options say.

    Raises:
        MtpgoError: the bag or the lane file cannot be used, or nothing was played.
    """
    from msg_adapters.bags.bag_reader import BagReader
    from mtpgo_core.maps.lane_file import read_lane_file
    from mtpgo_ros.bags.clock_gap import played_part
    from mtpgo_ros.bags.player_node import LANES_TOPIC, BagPlayer, Wait

    how = LaneFileOptions(options.lane_projection, options.lane_origin, options.lane_offset)
    with contextlib.ExitStack() as files:
        with interruptible():  # A bag without an index is read as a whole.
            lanes = None if options.lane_file is None else read_lane_file(options.lane_file, how)
            if lanes is not None:
                tell(f"replay: lane file: {lanes.sentence}", error=True)
            bag = files.enter_context(BagReader(options.bag))
            topics = bag.topics(options.topics)
            if lanes is not None:
                topics = [topic for topic in topics if topic.name != LANES_TOPIC]
            for topic, reason in bag.skipped().items():
                if options.topics is None or topic in {chosen.name for chosen in topics}:
                    tell(f"replay: skipping {topic}: {reason}", error=True)
            part = played_part(bag, topics)
        for sentence in part.sentences:
            tell(f"replay: {sentence}", error=True)
        player = BagPlayer(bag, _timing(options, part), topics)
        try:
            if lanes is not None:
                player.publish_lanes(lanes.lines, options.lane_frame)
            wait = Wait(
                options.wait_for_subscribers,
                options.wait_timeout,
                options.delay,
                options.start_paused,
            )
            if player.wait(wait, stopped):
                report = player.run(stopped, loop=options.loop, progress=not options.no_progress)
                if not report.messages and not stopped():
                    raise RecordingError(f"bag {options.bag} has no message to play{_of(options)}")
                tell(f"played {report.sentence()}")
        finally:
            player.close()


def _timing(options: argparse.Namespace, part: PlayedPart) -> PlaybackTiming:
    """Return which part of a bag is played, and how fast.

    Raises:
        RecordingError: the bag ends before the start offset.
    """
    from mtpgo_ros.bags.playback import PlaybackTiming

    origin_ns, end_ns = part.start_ns + _ns(options.start_offset), part.end_ns
    if options.duration is not None:
        end_ns = min(end_ns, origin_ns + _ns(options.duration))
    if origin_ns > part.end_ns:
        raise RecordingError(
            f"--start-offset is {options.start_offset:g} s, but bag {options.bag} lasts only"
            f" {(part.end_ns - part.start_ns) * 1e-9:.3f} s"
        )
    return PlaybackTiming(origin_ns, end_ns, options.rate, options.clock_rate)


def _ns(seconds: float) -> int:
    """Return a time from the command line (s) in ns, limited to :data:`_LONGEST_S`."""
    return round(1e9 * min(seconds, _LONGEST_S))


def _of(options: argparse.Namespace) -> str:
    """Return the selected topics and times as the end of a sentence."""
    words = [] if options.topics is None else [f"on {', '.join(options.topics)}"]
    if options.start_offset or options.duration is not None:
        words.append("in the time that was asked for")
    return " " + " ".join(words) if words else ""


def run() -> NoReturn:
    """Be the executable ``replay``: end the process with the status of :func:`main`."""
    run_as_process(main)


if __name__ == "__main__":
    run()
