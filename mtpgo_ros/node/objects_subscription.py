# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The subscription to the tracked objects, with the message type that is published.

The executor's thread takes only the bytes of a message. A thread of its own checks them, decodes
them and calls the handler, so that a large message keeps nothing else from being served.
"""

from __future__ import annotations

import contextlib
import gc
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator
from typing import Any, cast

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_policy_name_from_kind
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from msg_adapters.adapter import InputAdapter
from msg_adapters.registry import INPUTS, adapter_for_type, input_adapter
from msg_adapters.types import message_class
from msg_adapters.wire.input_limits import DEFAULT_LIMITS, InputLimits
from mtpgo_core.errors import MessageError
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.diagnostics.topic_candidates import other_topics
from mtpgo_ros.node.reliability_choice import ReliabilityChoice
from mtpgo_ros.runtime.receipt_clock import Receipt, ReceiptClock
from mtpgo_ros.runtime.sender_clock import SenderClock
from mtpgo_ros.runtime.work_queue import WorkQueue

TOPIC = "objects"

_DEPTH = 5
"""Messages of a publisher that wait for the middleware to hand them over, and again to be decoded;
chosen."""

_MOST_PUBLISHERS = 32
"""Publishers for which as many messages can wait each; chosen. With more of them, some are lost
when all send at once."""

_REST_S = 0.02
"""While messages of a publisher are lost, decoding rests so long after each (s); chosen: some 40 a
second are then decoded, more than the history needs. Of 64 road users at 1000 Hz, the model served
96 to 100 % of the cycles with it and 0 to 2 % without (measured): they share one interpreter."""

_POLL_S = 0.1
"""Time between two checks of the published type (s); chosen."""

_SEARCH_S = 3.0
"""Time without a publisher between two searches for other topics with objects (s); chosen: a
tracker that starts with the node is there by then."""

_OVERLAP_S = 1.0
"""How long a subscription goes on after its successor was made (s); chosen above the time that
discovery takes."""

_PATIENCE_S = 0.1
"""How long closing waits for a message that is being decoded (s); chosen: transitions are to be
answered within 0.2 s."""

Handler = Callable[[Any, InputAdapter, Receipt], None]
"""Takes a message, its adapter, and what is known of its receipt.

Instead of a message that was refused before it was decoded, it gets the MessageError that says
why.
"""


class ObjectsSubscription:
    """Subscribes to ``objects`` as soon as the type is known.

    Args:
        node: the node.
        input_type: name of an adapter, or ``auto`` for the type of the topic's publisher.
        handler: called with every message, on the thread of this subscription.
        events: where lost messages and incompatible publishers are counted.
        limits: the largest messages that are decoded.

    Attributes:
        topic: resolved name of the topic.
        status: what is wrong with the topic's publishers, empty if nothing is.
        limits: as above; may be replaced at any time.

    Raises:
        MessageError: the named type's message package is not installed.
    """

    def __init__(
        self,
        node: Node,
        input_type: str,
        handler: Handler,
        events: EventLog,
        limits: InputLimits = DEFAULT_LIMITS,
    ) -> None:
        self._node = node
        self._handler = handler
        self._events = events
        self.limits = limits
        self._lost = LostMessages()
        self._clock, self._sender_clock = ReceiptClock(), SenderClock()
        self._subscription: Subscription | None = None
        self._adapter: InputAdapter | None = None
        self.topic = node.resolve_topic_name(TOPIC)
        self.status = f"no publisher on {self.topic} yet"
        self._matched = False  # ever
        self._elsewhere = ""  # where objects may be
        self._next_search_s = time.monotonic() + _SEARCH_S
        self._follows_type = input_type == "auto"
        self._choice = ReliabilityChoice(time.monotonic())
        # The previous subscription overlaps with its successor until that one is discovered; the
        # source times tell the messages that both receive.
        self._leaving: Subscription | None = None
        self._leaving_s = 0.0
        self._sent_ns: deque[int] = deque(maxlen=2 * _DEPTH)
        self._depth = _DEPTH
        if not self._follows_type:
            self._subscribe(input_adapter(input_type))
        # Created last: if the above fails, nothing would end its thread.
        self._queue = WorkQueue(
            self._decode, self._depth, "objects", self._on_overrun, rest_s=_REST_S
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(_POLL_S, self._check_publishers, clock=steady)

    @property
    def message_type(self) -> str:
        """Message type of the subscription, empty before."""
        return self._adapter.message_type if self._adapter is not None else ""

    def close(self) -> None:
        """Destroy the subscription and end its thread."""
        # A message that is being decoded cannot be interrupted; its result is dropped.
        self._queue.stop(_PATIENCE_S)
        self._node.destroy_timer(self._timer)
        self._unsubscribe()

    def _check_publishers(self) -> None:
        """Subscribe to a published type, as reliably as it is published, to all its publishers."""
        publishers = self._node.get_publishers_info_by_topic(self.topic)
        changed = self._choice.update(
            possible=all(
                info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in publishers
            ),
            matched=self._subscription is not None and bool(publishers),
            now_s=time.monotonic(),
        )
        if self._leaving is not None and time.monotonic() > self._leaving_s:
            self._node.destroy_subscription(self._leaving)
            self._leaving = None
        changed |= self._leaving is None and self._make_room(len(publishers))
        if changed and self._adapter is not None:
            self._subscribe_anew(self._adapter)
        self._check_type({info.topic_type for info in publishers})

    def _make_room(self, publishers: int) -> bool:
        """Deepen the queues so that one message of each publisher fits; return whether changed.

        With too short a queue the middleware keeps the newest messages only, which may always be
        of the same publishers, and the road users of the others would never be seen. The depth is
        doubled, since each change needs a new subscription.
        """
        depth = self._depth
        while self._depth < _DEPTH * min(publishers, _MOST_PUBLISHERS):
            self._depth *= 2
        if self._depth == depth:
            return False
        self._queue.depth = self._depth
        self._queue.rest_s = _REST_S * _DEPTH / self._depth
        self._sent_ns = deque(self._sent_ns, maxlen=2 * self._depth)
        return True

    def _check_type(self, published: set[str]) -> None:
        """Subscribe to a published type if needed, and set the status.

        The status is set on every call, so that a problem is reported only while it lasts.
        """
        others = published - {self.message_type}
        if not published:
            self.status = self._without_publisher()
        elif not others:
            self.status = ""
        elif others != published or not self._follows_type:
            self.status = types_not_heard(self.topic, others, {self.message_type})
            self._events.log("objects type", self.status)
        else:
            self._subscribe_to_one_of(published)

    def _without_publisher(self) -> str:
        """Return the status without a publisher: empty if there was one, else other topics."""
        if self._subscription is not None and self._matched:
            return ""
        if time.monotonic() >= self._next_search_s:
            self._next_search_s = time.monotonic() + _SEARCH_S
            before, self._elsewhere = self._elsewhere, other_topics(self._node, self.topic)
            if self._elsewhere not in ("", before):
                line = f"no publisher on {self.topic} yet; {self._elsewhere}"
                self._events.log("objects topic", line)
        return "; ".join(filter(None, (f"no publisher on {self.topic} yet", self._elsewhere)))

    def _subscribe_to_one_of(self, published: set[str]) -> None:
        """Subscribe to the first of these types that has an adapter and is installed."""
        errors = []
        known = {adapter.message_type for adapter in INPUTS.values()}
        for name in sorted(published, key=lambda name: (name not in known, name)):
            try:
                self._subscribe(adapter_for_type(name))
            except MessageError as error:
                errors.append(str(error))
            else:
                return
        self.status = f"topic {self.topic}: {errors[0]}"
        self._events.log("objects type", self.status, is_error=True)

    def _subscribe(self, adapter: InputAdapter) -> None:
        kind = message_class(adapter.message_type)
        self._unsubscribe()
        self._adapter = adapter
        self._subscription = self._node.create_subscription(
            kind,
            self.topic,
            cast(Callable[[Any], None], self._on_message),  # rclpy counts the arguments
            QoSProfile(
                depth=self._depth,  # Of a backlog only the newest are kept.
                reliability=(
                    ReliabilityPolicy.RELIABLE
                    if self._choice.reliable
                    else ReliabilityPolicy.BEST_EFFORT
                ),
            ),
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=self._on_incompatible_qos,
                matched=self._on_matched,
                message_lost=self._on_message_lost,
            ),
        )
        self.status = ""
        lost = ", reliably, since messages were lost or did not come"
        how = lost if self._choice.reliable else ""
        self._node.get_logger().info(
            f"subscribed to {self.topic} as {adapter.message_type}"
            f" (input_type {adapter.name}){how}"
        )

    def _subscribe_anew(self, adapter: InputAdapter) -> None:
        """Subscribe with the present choice; the last subscription overlaps with the new one."""
        last, self._subscription = self._subscription, None
        self._subscribe(adapter)
        self._leaving, self._leaving_s = last, time.monotonic() + _OVERLAP_S

    def _unsubscribe(self) -> None:
        for subscription in (self._subscription, self._leaving):
            if subscription is not None:
                self._node.destroy_subscription(subscription)
        self._subscription = self._leaving = self._adapter = None

    def _on_message(self, data: bytes, info: dict[str, Any]) -> None:
        sent_ns = int(info.get("source_timestamp", 0))
        if self._leaving is not None and sent_ns in self._sent_ns:
            return  # Both subscriptions have received it.
        self._sent_ns.append(sent_ns)
        if self._adapter is not None:
            received_ns = self._clock.monotonic_ns(int(info.get("received_timestamp", 0)))
            self._queue.submit((data, self._adapter, sent_ns, received_ns))
            if self._choice.received(len(data), time.monotonic()):
                self._subscribe_anew(self._adapter)

    def _decode(self, item: tuple[bytes, InputAdapter, int, int]) -> None:
        """Decode a message and call the handler; on the thread of the queue."""
        data, adapter, sent_ns, received_ns = item
        set_forward = self._sender_clock.was_set_forward(sent_ns, received_ns)
        try:
            adapter.check_serialized(data, self.limits)
            with _without_garbage_collection():
                message = deserialize_message(data, message_class(adapter.message_type))
        except MessageError as error:
            message = error
        except Exception as error:  # rclpy's errors have no common base.
            message = MessageError(f"message of {len(data)} bytes cannot be decoded: {error}")
        if not self._queue.stopped:
            self._handler(message, adapter, Receipt(received_ns, set_forward))

    def _on_overrun(self) -> None:
        self._events.count("input_overruns")

    def _on_matched(self, event: Any) -> None:
        # The two sides discover each other at different times, and messages sent before this side
        # has are lost. Scripts that must not lose the first message wait for this line.
        if event.current_count_change > 0:
            self._matched = True
            self._node.get_logger().info(
                f"hearing {event.current_count} publisher(s) on {self.topic}"
            )

    def _on_incompatible_qos(self, event: Any) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        if policy == "RELIABILITY" and self._choice.reliable:
            return  # The next check of the publishers changes the subscription.
        self._events.count(
            "qos_incompatible",
            event.total_count_change,
            f"a publisher on {self.topic} cannot be heard: its QoS policy {policy} does not fit"
            " best effort, volatile, without a deadline",
            detail=f"{policy} on {self.topic}",
            is_error=True,
        )

    def _on_message_lost(self, event: Any) -> None:
        number = self._lost.add(event.total_count_change)
        self._choice.lost(number)
        self._events.count("messages_lost", number)


class LostMessages:
    """Counts lost messages by the changes that the middleware reports.

    The middleware corrects its count when a message that it reported as lost arrives after all.
    The change is then negative, but is given as an unsigned 64-bit number.
    """

    def __init__(self) -> None:
        self._total = self._reported = 0

    def add(self, change: int) -> int:
        """Return how many messages were newly lost, after a change of the middleware's total."""
        self._total += (change + (1 << 63)) % (1 << 64) - (1 << 63)
        new = max(0, self._total - self._reported)
        self._reported += new
        return new


@contextlib.contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Disable garbage collection within the block.

    Decoding creates hundreds of thousands of objects, and each collection would block all other
    threads for 50 ms (measured). Messages have no reference cycles.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def types_not_heard(topic: str, others: Collection[str], taken: Collection[str]) -> str:
    """Return the sentence for publishers of other message types than those that a node takes."""
    return (
        f"topic {topic}: a publisher of {', '.join(sorted(others))} is not heard, the node takes"
        f" {', '.join(sorted(taken))}"
    )
