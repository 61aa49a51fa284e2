# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions as a pandas data frame, one row for each agent, mode and step."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.identity import key_to_text
from mtpgo_core.schema import AgentClass, CalibrationStage, Prediction, Source

_NAMES = {"class": AgentClass, "source": Source, "calibration": CalibrationStage}
"""Columns of numbers that have names -> the names."""


def prediction_frame(predictions: Prediction | Iterable[Prediction]) -> Any:
    """Return predictions as a ``pandas.DataFrame``, one row for each agent, mode and step.

    The columns: ``stamp_ns`` (ns), ``frame_id``, ``agent`` (identity as text: a number below
    2**64, or a UUID), ``class`` (name), ``source`` and ``calibration`` (names), ``mode``,
    ``step``, ``t`` (s after the stamp), ``weight``, ``x``, ``y``, ``z``, ``length``, ``width``
    (m), ``vx``, ``vy`` (m/s), ``yaw`` (rad), ``cov_xx``, ``cov_xy``, ``cov_yy`` (m^2),
    ``sigma_factor_50``. Texts are categorical. Missing points are rows with NaN.

    Args:
        predictions: one, or several, for instance of :func:`predictions_in_bag`.

    Raises:
        ConfigurationError: pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError:
        raise ConfigurationError(
            "a data frame needs pandas, which is not installed: expected pip install pandas"
        ) from None
    several = [predictions] if isinstance(predictions, Prediction) else list(predictions)
    parts = [_columns(one) for one in several or [_NONE]]
    columns: dict[str, Any] = {
        name: np.concatenate([part[name] for part in parts]) for name in parts[0]
    }
    for name, kinds in _NAMES.items():
        columns[name] = _named(pd, columns[name], kinds)
    for name in ("frame_id", "agent"):
        columns[name] = pd.Categorical(columns[name])
    return pd.DataFrame(columns)


def _named(pd: Any, values: NDArray[Any], kinds: Any) -> Any:
    """Return a categorical of the names of numbers; numbers without a name are missing."""
    names = [kind.name.lower() for kind in kinds]
    codes = np.where(values < len(names), values.astype(np.int16), -1)
    return pd.Categorical.from_codes(codes, categories=names)


def _columns(one: Prediction) -> dict[str, NDArray[Any]]:
    """Return the columns of one prediction, in the order of the table."""
    shape = one.yaw.shape
    n, modes, steps = shape
    identity = np.array([key_to_text(key) for key in one.key], dtype=object)

    def of_agent(values: Any) -> NDArray[Any]:
        return np.broadcast_to(np.asarray(values).reshape(n, 1, 1), shape).reshape(-1)

    def same(value: Any, kind: Any) -> NDArray[Any]:
        return np.full(n * modes * steps, value, dtype=kind)

    def spread(values: NDArray[Any]) -> NDArray[Any]:
        return np.broadcast_to(values, shape).reshape(-1)

    return {
        "stamp_ns": same(one.stamp_ns, np.int64),
        "frame_id": same(one.frame_id, object),
        "agent": of_agent(identity),
        "class": of_agent(one.agent_class),
        "source": of_agent(one.source),
        "calibration": of_agent(one.calibration),
        "mode": spread(np.arange(modes, dtype=np.int16)[:, None]),
        "step": spread(np.arange(steps, dtype=np.int16)),
        "t": spread(one.time_s),
        "weight": spread(one.weight[:, :, None]),
        "x": one.mean[..., 0].reshape(-1),
        "y": one.mean[..., 1].reshape(-1),
        "z": of_agent(one.z),
        "length": of_agent(one.size[:, 0]),
        "width": of_agent(one.size[:, 1]),
        "vx": one.mean[..., 2].reshape(-1),
        "vy": one.mean[..., 3].reshape(-1),
        "yaw": one.yaw.reshape(-1),
        "cov_xx": one.covariance[..., 0, 0].reshape(-1),
        "cov_xy": one.covariance[..., 0, 1].reshape(-1),
        "cov_yy": one.covariance[..., 1, 1].reshape(-1),
        "sigma_factor_50": spread(one.sigma_factor_50[:, None, :]),
    }


_NONE = Prediction(
    stamp_ns=0,
    frame_id="",
    key=np.empty((0, 4), dtype=np.uint32),
    agent_class=np.empty(0, dtype=np.uint8),
    z=np.empty(0),
    size=np.empty((0, 2)),
    initial=np.empty((0, 4)),
    initial_yaw=np.empty(0),
    time_s=np.empty(0),
    weight=np.empty((0, 0)),
    mean=np.empty((0, 0, 0, 4)),
    yaw=np.empty((0, 0, 0)),
    covariance=np.empty((0, 0, 0, 2, 2)),
    source=np.empty(0, dtype=np.uint8),
)
"""A prediction of no agent, for the types of the columns of an empty table."""
