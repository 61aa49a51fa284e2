# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A lifecycle node whose parts exist in some of its states only, and end on every way out."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.lifecycle.manager_bond import ManagerBond, NoBond, form_bond
from mtpgo_ros.lifecycle.recorded_transition import record_failure


class ResourceNode(LifecycleNode):
    """Forms the bond when active, and closes and releases the parts at the opposite transitions.

    Subclasses create their parts in ``on_configure`` and ``on_activate``.

    Args:
        name: of the node.
        node_options: of :class:`rclpy.node.Node`.

    Attributes:
        failure: why the last transition failed, empty if it did not.
        starting: the executable starts the node and prints a failure itself.
        events: where everything unusual is counted and logged.
    """

    def __init__(self, name: str, **node_options: Any) -> None:
        super().__init__(name, **node_options)
        self.failure = ""
        self.starting = False
        self.events = EventLog(self.get_logger())
        self._bond: ManagerBond = NoBond()

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

    def _end(self) -> bool:
        bond, self._bond = self._bond, NoBond()
        bond.close()
        return self._close()
