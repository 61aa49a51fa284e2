# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The service that replaces the model of a configured node without a gap in its predictions.

The type is rcl_interfaces/SetParametersAtomically: it comes with every ROS 2, carries the file
(and what else belongs to it) in the one call that acts, so that two callers cannot mix their
files, and answers with a reason. A parameter for the file would have to be writable while the node
is active; a service can be permitted separately.
"""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter

from mtpgo_core.errors import ConfigurationError, ModelFileError, MtpgoError
from mtpgo_ros.diagnostics.event_log import shortened
from mtpgo_ros.node.model_host import ModelHost
from mtpgo_ros.parameters.parameter_server import ParameterServer
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

SWAPPED = ("model", "model_sha256")
"""Parameters that a request may contain."""

LIMIT_S = 60.0
"""A model that is not loaded by then is given up (s); chosen: loading takes a second or two."""

_WAIT_S = 0.005
"""The executor looks after a swap at most this often (s), so that waiting costs nothing."""


class ModelSwap:
    """The service ``~/swap_model``.

    Args:
        node: the node.
        server: its parameters.
        current: returns the model in use, None while the node is unconfigured.
        no_cycle_skipped: returns the context in which a model is loaded: reading a TorchScript
            file keeps all threads of Python waiting (0.3 s for the shipped model, measured).
        on_swapped: called on the executor's thread after a swap.
    """

    def __init__(
        self,
        node: LifecycleNode,
        server: ParameterServer,
        current: Callable[[], ModelHost | None],
        no_cycle_skipped: Callable[[], AbstractContextManager[None]],
        on_swapped: Callable[[], None],
    ) -> None:
        self._node, self._server = node, server
        self._current, self._on_swapped = current, on_swapped
        self._no_cycle_skipped = no_cycle_skipped
        self._under_way: _Loading | None = None
        # A swap waits for its thread, and other callbacks must go on meanwhile; a second request
        # is refused immediately.
        self._service = node.create_service(
            SetParametersAtomically,
            "~/swap_model",
            self._swap,
            callback_group=ReentrantCallbackGroup(),
        )

    @property
    def busy(self) -> bool:
        """Whether a model is being loaded."""
        return self._under_way is not None and self._under_way.is_alive()

    async def _swap(self, request: Any, response: Any) -> Any:
        try:
            sentence = await self._replace(
                {p.name: Parameter.from_parameter_msg(p).value for p in request.parameters}
            )
        except Exception as error:  # Every request is answered.
            kind = "" if isinstance(error, MtpgoError) else f"{type(error).__name__}: "
            reason = f"the model was not swapped: {kind}{error}"
            self._node.get_logger().error(shortened(reason))
            response.result = SetParametersResult(successful=False, reason=reason)
        else:
            self._node.get_logger().info(sentence)
            response.result = SetParametersResult(successful=True, reason=sentence)
        return response

    async def _replace(self, values: dict[str, Any]) -> str:
        """Load the model, put it in the place of the current one, and say so.

        Raises:
            MtpgoError: why the current model was kept.
        """
        parameters = self._requested(values)
        host = self._current()
        if host is None:
            raise ConfigurationError(
                "the node is unconfigured: set the parameter model and configure it"
            )
        if self.busy:
            raise ConfigurationError("another swap is under way")
        self._under_way = loading = _Loading(
            host, parameters, self._no_cycle_skipped(), lambda: self._current() is host
        )
        loading.start()
        await loading
        if self._current() is not host:
            raise ConfigurationError("the node was cleaned up meanwhile")
        self._server.commit(values)
        self._on_swapped()
        about = host.describe()
        return f"the model is now {about['model']} of file {about['file']}"

    def _requested(self, values: dict[str, Any]) -> PredictorParameters:
        """Return the parameters with those of the request.

        Raises:
            ConfigurationError: a name or a value is not allowed.
        """
        for name in values:
            if name not in SWAPPED:
                raise ConfigurationError(
                    f"parameter {name} given, expected {' or '.join(SWAPPED)}"
                )
        return dataclasses.replace(self._server.checked(values), require_model=True)


class _Loading(threading.Thread):
    """Loads and warms up a model and puts it in the place of another one.

    A daemon: a file that never ends loading must not keep the process alive.

    Args:
        host: whose model is replaced.
        parameters: the name of the new one.
        no_cycle_skipped: the context in which it is loaded.
        in_use: returns whether the host still is the node's. Where the node was cleaned up
            meanwhile nothing is replaced: the calibration file may be that of another host by now.
    """

    def __init__(
        self,
        host: ModelHost,
        parameters: PredictorParameters,
        no_cycle_skipped: AbstractContextManager[None],
        in_use: Callable[[], bool],
    ) -> None:
        super().__init__(name="model swap", daemon=True)
        self._host, self._parameters = host, parameters
        self._no_cycle_skipped, self._in_use = no_cycle_skipped, in_use
        self._end_s = time.monotonic() + LIMIT_S
        self._error: Exception | None = None
        self._done = threading.Event()

    def run(self) -> None:
        """Load, warm up, replace."""
        try:
            with self._no_cycle_skipped:
                loaded = ModelHost(self._parameters)
                loaded.warm_up(permanent=False)
            if time.monotonic() > self._end_s:
                raise self._too_late()
            if self._in_use():
                self._host.replace_by(loaded)
        except Exception as error:
            self._error = error
        finally:
            self._done.set()

    def __await__(self) -> Generator[None, None, None]:
        """Wait for the end.

        Raises:
            Exception: what the thread raised.
            ModelFileError: it has not ended in time.
        """
        while not self._done.wait(_WAIT_S):
            if time.monotonic() > self._end_s:
                raise self._too_late()
            yield
        if self._error is not None:
            raise self._error

    def _too_late(self) -> ModelFileError:
        return ModelFileError(
            f"model {self._parameters.model} was not loaded within {LIMIT_S:g} s"
        )
