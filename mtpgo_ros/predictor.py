# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK
"""``predictor``: the executable that runs the node.

All settings are ROS parameters (``--ros-args -p rate:=10.0 -r objects:=/perception/objects``).
SIGINT and SIGTERM end it with status 0, bad input with status 2 and one sentence on stderr.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from mtpgo_ros.lifecycle.node_executable import run_executable
from mtpgo_ros.runtime.allocator import tune_allocator, use_small_pages
from mtpgo_ros.runtime.executable import run_as_process, share_interpreter, stop_on_signals


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run the executable ``predictor``.

    Args:
        argv: arguments, default those of the process.

    Returns:
        0 after a signal, 2 for bad input.
    """
    stopped = stop_on_signals()
    tune_allocator()
    use_small_pages()
    share_interpreter()
    return run_executable("predictor", __doc__, argv, stopped, _node_class)


def _node_class() -> Callable[..., Any]:
    from mtpgo_ros.node.predictor_node import PredictorNode

    return PredictorNode


def run() -> NoReturn:
    """Be the executable ``predictor``: end the process with the status of :func:`main`."""
    run_as_process(main)


if __name__ == "__main__":
    run()
