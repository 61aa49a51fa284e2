# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK
"""``record``: writes what the predictor publishes into an MCAP bag.

Messages are stored as the bytes received, with the time of their receipt. They are written every
second, into a bag that has its own name from the beginning: whatever ends the recording, what was
written stays. SIGINT and SIGTERM end it and leave a complete bag.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from mtpgo_core.errors import MtpgoError
from mtpgo_core.processes.parent_process import end_with_parent
from mtpgo_ros.runtime.executable import (
    ArgumentParser,
    add_end_with_parent,
    answered,
    fail,
    positive,
    run_as_process,
    stop_on_signals,
    tell,
)

NOTHING_CAME = 1
"""Exit status of a recording without a message."""


def main(argv: Sequence[str] | None = None) -> int | None:
    """Entry of the executable ``record``.

    Args:
        argv: arguments, by default the process's; ``--ros-args`` may follow.

    Returns:
        0 when messages were recorded, 1 when none came, 2 for bad input or when the output can no
        longer be written.
    """
    stopped = stop_on_signals()
    arguments = list(sys.argv[1:] if argv is None else argv)
    if answered("record", arguments, _parser):
        return 0
    import rclpy

    from mtpgo_ros.bags.recorder_node import predictor_types, record
    from mtpgo_ros.runtime.ros_start import own_arguments, start

    status = 0
    try:
        options = _parser().parse_args(own_arguments(arguments))
        if options.end_with_parent:
            end_with_parent()
        start(arguments)
        until = _until(stopped, options.duration)
        known = predictor_types(predictor_of(options))
        recorded = record(options.output, topics_of(options), known, until)
        status = 0 if recorded.messages else NOTHING_CAME
        if recorded.messages:
            tell(recorded.sentence)
        else:
            tell(f"record: {recorded.sentence}", error=True)
    except MtpgoError as error:
        status = fail("record", error)
    rclpy.try_shutdown()
    return status


def _until(stopped: Callable[[], bool], duration_s: float | None) -> Callable[[], bool]:
    """Return whether a signal came or the duration (s) from now on is over, as a function."""
    if duration_s is None:
        return stopped
    end = time.monotonic() + duration_s
    return lambda: stopped() or time.monotonic() >= end


def predictor_of(options: argparse.Namespace) -> str:
    """Return the absolute name of the predictor."""
    return "/" + str(options.predictor).strip("/")


def topics_of(options: argparse.Namespace) -> list[str]:
    """Return the absolute names of the topics to be recorded, by default the predictor's own."""
    from mtpgo_ros.bags.recorder_node import predictor_types

    names = [*(options.topics or predictor_types(predictor_of(options)))]
    if options.objects:
        names.append(options.objects)
    return list(dict.fromkeys("/" + name.lstrip("/") for name in names))


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(prog="record", description=__doc__.split("\n\n")[0])
    add = parser.add_argument
    add(
        "-o",
        "--output",
        type=Path,
        required=True,
        help="new bag: a folder, or one file if it ends in .mcap",
    )
    add(
        "--topics",
        action="extend",
        nargs="+",
        metavar="TOPIC",
        help="record these; by default the predictions, their processing time and scores, and the "
        "diagnostics",
    )
    add(
        "--objects",
        nargs="?",
        const="/objects",
        metavar="TOPIC",
        help="record the tracked objects too: this topic (/objects)",
    )
    add(
        "--predictor",
        default="/predictor",
        metavar="NODE",
        help="name of the predictor (/predictor)",
    )
    add("--duration", type=positive, metavar="S", help="stop after this long (s)")
    add_end_with_parent(parser)
    return parser


def run() -> NoReturn:
    """Be the executable ``record``: end the process with the status of :func:`main`."""
    run_as_process(main)


if __name__ == "__main__":
    run()
