# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Items are handled in order on another thread; a full queue loses its oldest."""

import threading

from mtpgo_ros.runtime.work_queue import WorkQueue

LIMIT_S = 30.0


class Scene:
    """A queue whose handler waits until it is released, item by item."""

    def __init__(self, depth, **options):
        self.handled, self.dropped = [], 0
        self.begun, self.go = threading.Semaphore(0), threading.Semaphore(0)
        self.queue = WorkQueue(self.handle, depth, "test", self.drop, **options)

    def handle(self, item):
        self.begun.release()
        assert self.go.acquire(timeout=LIMIT_S)
        self.handled.append((item, threading.current_thread().name))

    def drop(self):
        self.dropped += 1


def test_order_and_loss_of_the_oldest():
    scene = Scene(depth=2)
    for item in range(5):
        scene.queue.submit(item)
        if item == 0:
            assert scene.begun.acquire(timeout=LIMIT_S)
    assert scene.dropped == 2
    scene.go.release(3)
    for _ in range(2):
        assert scene.begun.acquire(timeout=LIMIT_S)
    scene.queue.stop(LIMIT_S)
    assert [item for item, _ in scene.handled][:2] == [0, 3]
    assert {name for _, name in scene.handled} == {"test"}


def test_stopping_says_whether_an_item_is_still_handled():
    scene = Scene(depth=2)
    scene.queue.submit("a")
    assert scene.begun.acquire(timeout=LIMIT_S)
    scene.queue.submit("b")
    assert not scene.queue.stop(0.0)
    assert scene.queue.stopped
    scene.go.release(2)
    assert scene.queue.stop(LIMIT_S)
    assert [item for item, _ in scene.handled] == ["a"]


def test_with_a_depth_of_one_older_waiting_items_are_dropped():
    scene = Scene(depth=1)
    scene.queue.submit(1)
    assert scene.begun.acquire(timeout=LIMIT_S)
    for item in (2, 3, 4):
        scene.queue.submit(item)
    scene.go.release(2)
    assert scene.begun.acquire(timeout=LIMIT_S)
    assert scene.queue.stop(LIMIT_S)
    assert [item for item, _ in scene.handled] == [1, 4]


def test_a_queue_that_loses_items_rests_after_each_and_stops_at_once():
    scene = Scene(depth=1, rest_s=LIMIT_S)
    scene.go.release(2)
    for item in "ab":  # nothing is lost: no rest
        scene.queue.submit(item)
        assert scene.begun.acquire(timeout=LIMIT_S)
    scene.queue.stop(LIMIT_S)
    scene = Scene(depth=1, rest_s=LIMIT_S)
    scene.queue.submit("a")
    assert scene.begun.acquire(timeout=LIMIT_S)
    for item in "bc":
        scene.queue.submit(item)
    scene.go.release(10)
    assert not scene.begun.acquire(timeout=0.1)
    assert scene.queue.stop(LIMIT_S)
    assert [item for item, _ in scene.handled] == ["a"]
