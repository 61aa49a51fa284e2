# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A thread that works beside a block of code, and ends with it. No ROS here."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def side_thread(name: str, work: Callable[[threading.Event], None]) -> Iterator[None]:
    """Work on a thread of its own within the block, which then waits for its end.

    Args:
        name: of the thread.
        work: called with the event that tells it to end; it must then return soon.
    """
    ended = threading.Event()
    thread = threading.Thread(target=work, args=(ended,), name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
