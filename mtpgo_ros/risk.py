# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK
"""``risk``: the executable that tells how likely predicted road users are in the ego's way.

All settings are ROS parameters (``--ros-args -p plan_type:=path -r plan:=/planner/path``). SIGINT
and SIGTERM end it with status 0, bad input with status 2 and one sentence on stderr.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from mtpgo_ros.lifecycle.node_executable import run_executable
from mtpgo_ros.runtime.executable import run_as_process, stop_on_signals


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run the executable ``risk``.

    Args:
        argv: arguments, default those of the process.

    Returns:
        0 after a signal, 2 for bad input.
    """
    stopped = stop_on_signals()
    return run_executable("risk", __doc__, argv, stopped, _node_class)


def _node_class() -> Callable[..., Any]:
    from mtpgo_ros.risk_node.risk_lifecycle import RiskNode

    return RiskNode


def run() -> NoReturn:
    """Be the executable ``risk``: end the process with the status of :func:`main`."""
    run_as_process(main)


if __name__ == "__main__":
    run()
