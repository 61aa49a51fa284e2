# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From an observation to the window of a prediction that is due. No ROS in here.

Everything here runs on the subscription's thread. A window is not changed after it was returned,
so the worker needs no lock.
"""

from __future__ import annotations

import dataclasses
from typing import Protocol

import numpy as np

from msg_adapters.stamp_seconds import StampPace, StampSeconds
from mtpgo_core.history.checks.stream_checks import StreamChecks
from mtpgo_core.history.odd_input import ODD_INPUT
from mtpgo_core.history.stream_guard import LATE_NS
from mtpgo_core.history.track_history import TrackHistory, UpdateReport
from mtpgo_core.schema import HistoryWindow, KeyArray, TrackedStates
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.node.rate_limiter import RateLimiter
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.runtime.receipt_clock import UNKNOWN, Receipt

_STAMPS_FOLLOW_NS = 1_000_000_000
"""How long after its clock was set a sender may have stamps from before (ns), of messages that
were stamped before and sent after it; chosen: several periods of most trackers."""

_CONFIRMATIONS = 3
"""Consecutive observations from the future after which the stream's clock is accepted; chosen as
for a jump of the clock backwards."""

LONGEST_DELAY_S = 0.5
"""Longer delays are not compensated (s): the history is not extrapolated farther."""

_COUNTED = tuple(
    field.name
    for field in dataclasses.fields(UpdateReport)
    if field.name not in ("accepted", "new_tracks", "forgotten")
)


class Resettable(Protocol):
    """What has to forget the past together with the history."""

    def reset(self) -> None:
        """Forget the past; any thread."""


class HistoryInput:
    """Updates the history and decides which observations start a prediction.

    An observation is usable if it enters the history: if at least one of its objects does, or if
    it has none, as on an empty road. One whose objects were all rejected starts no prediction
    unless earlier ones are still carried on: an empty prediction would look like an empty road.

    Args:
        history: the tracks.
        predictor: forgets its graphs and trails when the history is cleared.
        events: where odd input is counted.
        parameters: the initial parameters.

    Attributes:
        report: on the last observation; None where it did not reach the history.
        rejection: why the last observation was not usable, empty if it was.
        checks: whether the stream as a whole can be what it should.
    """

    def __init__(
        self,
        history: TrackHistory,
        predictor: Resettable,
        events: EventLog,
        parameters: PredictorParameters,
    ) -> None:
        self.report: UpdateReport | None = None
        self._history = history
        self._predictor = predictor
        self._events = events
        self._parameters = parameters
        self._rate_limiter = RateLimiter(parameters.rate)
        self._seconds, self._pace = StampSeconds(), StampPace()
        self._ahead = 0
        self._newest_ns: int | None = None
        self._newest_came_ns = 0  # by the node's clock
        self._sender_set_until_ns = 0  # of the monotonic clock
        self._added_key: KeyArray | None = None  # of the ego, as it was added last
        self.rejection = ""
        self.checks = StreamChecks(history.config)

    def configure(self, parameters: PredictorParameters) -> None:
        """Use other parameters from the next observation on."""
        if parameters.rate != self._parameters.rate:
            self._rate_limiter.change(parameters.rate)
        if parameters.twist_frame != self._parameters.twist_frame:
            self.checks.twist_frame_changed()
        self._parameters = parameters

    def clock_jumped_back(self, now_ns: int) -> bool:
        """Clear the history if it is newer than ``now_ns``, to which the clock was set back.

        A clock at zero shows no time: with simulated time, before the first message on /clock.

        Returns:
            Whether it was cleared.
        """
        if now_ns == 0:
            return False
        tolerance_ns = round(self._parameters.stamp_tolerance * 1e9)
        if self._newest_ns is None or self._newest_ns <= now_ns + tolerance_ns:
            return False
        self._events.count("clock_reset")
        self.reset()
        return True

    def reset(self) -> None:
        """Clear the history."""
        self.forget_tracks()
        self._predictor.reset()
        self._rate_limiter.reset()

    def forget_tracks(self) -> None:
        """Forget the tracks and the times, so that nothing is compared with what was before."""
        self._history.clear()
        self._newest_ns = None
        self._ahead = 0
        self._pace = StampPace()

    def update(
        self,
        states: TrackedStates,
        now_ns: int,
        ego_key: KeyArray | None = None,
        skipped_objects: int = 0,
        *,
        with_ego: bool = False,
        doubles: KeyArray | None = None,
        receipt: Receipt = UNKNOWN,
    ) -> HistoryWindow | None:
        """Add an observation to the history.

        Args:
            states: in the fixed frame.
            now_ns: the node's time (ns), 0 while it has none.
            ego_key: [4] identity of the ego.
            skipped_objects: objects of the message that could not be read.
            with_ego: the ego was added to the objects by its own odometry; it makes a message
                whose objects are all rejected no more usable.
            doubles: [k, 4] identities of objects that were left out because they are the ego.
            receipt: what is known of the message's way.

        Returns:
            The window of the prediction that the observation starts, None if none is due.
        """
        self.report = None
        refused = self._refused_stamp(states.stamp_ns, now_ns, receipt)
        if refused:
            ahead = _ahead(states.stamp_ns, now_ns) if refused == "future_stamp" else ""
            self._events.count(refused, detail=ahead)
            self.rejection = ODD_INPUT[refused]
            return None
        set_forward = self._set_forward(states.stamp_ns, now_ns, self._sender_set(receipt))
        if set_forward:
            self._history.clear()
        self._forget_other_egos(ego_key, doubles, added=with_ego)
        frames = f"{states.frame_id!r}, before {self._history.frame_id!r}"
        report = self._history.update(states, ego_key)
        for name in _COUNTED:
            detail = frames if name in ("frame_changed", "wrong_frame") else ""
            self._events.count(name, int(getattr(report, name)), detail=detail)
        if set_forward:
            self._events.count("clock_set", reason="the clock of the objects was set forward")
            # Only once: two senders whose clocks differ would otherwise clear it alternately.
            self._sender_set_until_ns = 0
            report = dataclasses.replace(report, clock_reset=True)
        self.report = report
        self._events.count("unknown_class", int(np.count_nonzero(states.agent_class == 0)))
        if report.wrong_frame:
            self.rejection = ODD_INPUT["frame_changed"]
            return None
        accepted, objects = report.accepted, len(states)
        if with_ego:
            objects -= 1
            accepted -= int(self._observed(ego_key, states.stamp_ns))
        self.rejection = _rejection(report, accepted, objects, skipped_objects)
        if report.clock_reset or report.frame_changed:
            self._predictor.reset()
            self._rate_limiter.reset()
            self._newest_ns = None
        if self._newest_ns is None or states.stamp_ns > self._newest_ns:
            self._newest_ns, self._newest_came_ns = states.stamp_ns, now_ns
        if report.accepted:
            self.checks.observed(states.stamp_ns, now_ns)
        if not self._rate_limiter.due(states.stamp_ns):
            return None
        delay_ns = self._delay_ns(states.stamp_ns, now_ns)
        window = self._history.window(states.stamp_ns + delay_ns)
        if not len(window) and not window.frame_id:  # no object has come so far
            window = dataclasses.replace(window, frame_id=states.frame_id)
        if self.checks.due(states.stamp_ns):
            self.checks.look(self._history.window(states.stamp_ns) if delay_ns else window)
            for kind, sentence in self.checks.doubts.items():
                self._events.log(kind, sentence)
        return None if self.rejection and not window.valid[:, -1].any() else window

    def _forget_other_egos(
        self, key: KeyArray | None, doubles: KeyArray | None, *, added: bool
    ) -> None:
        """Forget the ego under other identities: it would be carried on beside itself.

        Args:
            key: [4] the ego's identity.
            doubles: [k, 4] those of its own track, which may have come before its odometry.
            added: the ego is added under ``key`` now.
        """
        if doubles is not None and len(doubles):
            self._history.forget(doubles)
        before = self._added_key
        if before is not None and (key is None or (key != before).any()):
            self._history.forget(before[None])
            self._added_key = None
        if added:
            self._added_key = key

    def _observed(self, key: KeyArray | None, stamp_ns: int) -> bool:
        """Return whether the last message was an observation of the agent with a key [4]."""
        if key is None:
            return False
        number = self._history.track_numbers(key[None], stamp_ns)
        return bool(np.isin(number, self._history.observed).any())

    def _refused_stamp(self, stamp_ns: int, now_ns: int, receipt: Receipt) -> str:
        """Return the counter for a stamp that is not used, empty if it is; call once a message."""
        if stamp_ns <= 0:  # 1970 or before: the clock was not set
            return "unstamped"
        if self._is_of_another_unit(stamp_ns, receipt.monotonic_ns):
            return "stamp_unit"
        self._pace.add(stamp_ns, now_ns)
        self._events.count("stamp_pace", int(self._pace.is_slow))
        return "future_stamp" if self._is_from_the_future(stamp_ns, now_ns) else ""

    def _is_of_another_unit(self, stamp_ns: int, received_ns: int) -> bool:
        """Return whether ``nanosec`` of the stamps seems to be in another unit, such as ms.

        The history would take all messages of a second for duplicates. A stamp outside of the
        first millisecond of a second proves that the unit is right.
        """
        self._seconds.add(stamp_ns, received_ns)
        if not self._seconds.are_in_first_millisecond:
            self._seconds = StampSeconds()
        return self._seconds.are_of_another_unit

    def _is_from_the_future(self, stamp_ns: int, now_ns: int) -> bool:
        """Return whether to drop an observation because its stamp is ahead of the clock.

        A single such stamp would make all later ones look old. A stream that stays ahead has
        another clock than the node: it is accepted, and counted.
        """
        tolerance_ns = round(self._parameters.stamp_tolerance * 1e9)
        if now_ns == 0 or stamp_ns <= now_ns + tolerance_ns:
            self._ahead = 0
            return False
        self._ahead += 1
        if self._ahead < _CONFIRMATIONS:
            return True
        self._events.count("future_stamp", detail=_ahead(stamp_ns, now_ns))
        return False

    def _sender_set(self, receipt: Receipt) -> bool:
        """Return whether the sender's clock was set forward, before this message or lately."""
        if receipt.sender_set:
            self._sender_set_until_ns = receipt.monotonic_ns + _STAMPS_FOLLOW_NS
            return True
        return receipt.monotonic_ns < self._sender_set_until_ns

    def _set_forward(self, stamp_ns: int, now_ns: int, sender_set: bool) -> bool:
        """Return whether the stream's clock was set forward.

        Two conditions must hold, since a bag may be played faster than real time, and a simulation
        or a sensor has a clock of its own: the stamps are ahead of the node's clock since now, or
        the sender's clock was set; and the stamps advanced by more than the node's clock.
        """
        if self._newest_ns is None or not (sender_set or self._ahead == _CONFIRMATIONS):
            return False
        return stamp_ns - self._newest_ns - (now_ns - self._newest_came_ns) > LATE_NS

    def _delay_ns(self, stamp_ns: int, now_ns: int) -> int:
        """Return how long after the observation the horizon starts (ns)."""
        if not self._parameters.delay_compensation or now_ns == 0:
            return 0
        delay_ns = now_ns - stamp_ns
        if delay_ns > round(LONGEST_DELAY_S * 1e9):
            self._events.count("delay_not_compensated")
            return 0
        return max(0, delay_ns)


def _ahead(stamp_ns: int, now_ns: int) -> str:
    """Return in words how far a stamp is ahead of the clock."""
    return f"by {(stamp_ns - now_ns) * 1e-9:.1f} s"


def _rejection(report: UpdateReport, accepted: int, objects: int, skipped_objects: int) -> str:
    """Return why no object of an observation entered the history, empty if one did."""
    if accepted or objects + skipped_objects == 0:
        return ""
    numbers = {name: int(getattr(report, name)) for name in _COUNTED if name in ODD_INPUT}
    numbers["skipped_objects"] = skipped_objects
    most = max(numbers, key=lambda name: numbers[name])
    return ODD_INPUT[most]
