# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A lifecycle node whose parts exist in some of its states only, and end on every way out."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, cast

from rclpy.clock import ROSClock
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from mtpgo_ros.diagnostics.diagnostics_publisher import DiagnosticsPublisher
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.diagnostics.health import Verdict
from mtpgo_ros.lifecycle.lifecycle_answers import answer_invalid_transitions
from mtpgo_ros.lifecycle.manager_bond import ManagerBond, NoBond, form_bond
from mtpgo_ros.lifecycle.recorded_transition import record_failure

_NAMES_PERIOD_S = 1.0
"""Time between two searches for another node of the same name (s); chosen."""


class ResourceNode(LifecycleNode):
    """Forms the bond when active, and closes and releases the parts at the opposite transitions.

    Subclasses create ``_diagnostics`` when constructed, and their parts in ``on_configure`` and
    ``on_activate``.

    Args:
        name: of the node.
        node_options: of :class:`rclpy.node.Node`.

    Attributes:
        failure: why the last transition failed, empty if it did not.
        starting: the executable starts the node and prints a failure itself.
        events: where everything unusual is counted and logged.
        long_step: the context of a step that keeps the executor busy for seconds.
    """

    _diagnostics: DiagnosticsPublisher[Any]

    def __init__(self, name: str, **node_options: Any) -> None:
        super().__init__(name, **node_options)
        self.failure = ""
        self.starting = False
        self.events = EventLog(self.get_logger())
        self.long_step: Callable[[], AbstractContextManager[None]] = nullcontext
        self._names_checked_s, self._namesake = float("-inf"), ""
        self._bond: ManagerBond = NoBond()
        answer_invalid_transitions(self)

    def on_health(self, handler: Callable[[Verdict], None]) -> None:
        """Call ``handler`` with every verdict that is published on ``~/health``."""
        self._diagnostics.on_health = handler

    def namesake(self, what: str) -> str:
        """Return what is known about another node of the same name, empty without one.

        Args:
            what: this node publishes, for the sentence.
        """
        now_s = time.monotonic()
        if now_s - self._names_checked_s < _NAMES_PERIOD_S:
            return self._namesake
        self._names_checked_s, self._namesake = now_s, ""
        own = (self.get_name(), self.get_namespace())
        if self.get_node_names_and_namespaces().count(own) > 1:
            self._namesake = (
                f"another node is called {self.get_fully_qualified_name()}, and its {what} go to"
                " the same topics; one that was killed is still known for 20 s"
            )
            self.events.log("namesake", self._namesake)
        return self._namesake

    def _simulated_ns(self) -> int | None:
        """Return the simulated time (ns), 0 before the first, None with the machine's time."""
        clock = cast(ROSClock, self.get_clock())
        return clock.now().nanoseconds if clock.ros_time_is_active else None

    @abstractmethod
    def _close(self) -> bool:
        """End what exists while the node is active; return false if a part still runs."""

    @abstractmethod
    def _release(self) -> None:
        """Release what exists since the configuration."""

    def _activated(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Activate the publishers and form the bond; called at the end of ``on_activate``."""
        done = super().on_activate(state)
        self._bond = form_bond(self)
        return done

    @record_failure
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the parts of the active node."""
        self._end()
        return super().on_deactivate(state)

    @record_failure
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the configured parts."""
        done = super().on_cleanup(state)
        self._release()
        return done

    @record_failure
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop finally."""
        self._end()
        done = super().on_shutdown(state)
        self._release()
        return done

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Return to unconfigured after a transition that raised."""
        self.stop()
        return super().on_error(state)

    def stop(self) -> bool:
        """End all parts before the process ends; return false if one still runs."""
        ended = self._end()
        self._release()
        return ended

    def destroy_node(self) -> None:
        """Destroy the node and leave the domain, also while other objects refer to parts of it.

        rclpy leaves out the services of the lifecycle, which keep the node in the domain.
        """
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def _end(self) -> bool:
        bond, self._bond = self._bond, NoBond()
        bond.close()
        return self._close()
