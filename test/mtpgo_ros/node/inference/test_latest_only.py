# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Only the newest waiting item is handled."""

import threading

from mtpgo_ros.node.inference.latest_only import LatestOnly


def test_older_waiting_items_are_dropped():
    handled, entered, go = [], threading.Semaphore(0), threading.Semaphore(0)

    def handle(item):
        entered.release()
        assert go.acquire(timeout=30.0)
        handled.append(item)

    latest = LatestOnly(handle, "test")
    latest.submit(1)
    assert entered.acquire(timeout=30.0)
    for item in (2, 3, 4):
        latest.submit(item)
    go.release(2)
    assert entered.acquire(timeout=30.0)
    assert latest.stop(30.0)
    assert handled == [1, 4]
