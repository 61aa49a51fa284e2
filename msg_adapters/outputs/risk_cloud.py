# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The risk as two PointCloud2: one point per road user, one point per road user and step.

The layouts are described in docs/risk.md. Displays colour the points by ``probability``; an
unknown risk is NaN there, and ``unknown`` says why.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.inputs.object_cloud import KEY_FIELDS
from msg_adapters.types import Types
from msg_adapters.wire.cloud import cloud_to_records, records_to_cloud, require_fields
from mtpgo_core.errors import MessageError
from mtpgo_core.risk.collision_risk import QUANTILES, CollisionRisk

DISTANCE_FIELDS = tuple(f"distance_{round(100 * level):02d}" for level in QUANTILES)
"""Fields of the quantiles of the smallest distance: ``distance_05``, ..."""

_PLACE = ("x", "y", "z", "t", "probability")
_KEYS = [(name, "<u4") for name in KEY_FIELDS]

AGENT_POINT = np.dtype(
    [
        *((name, "<f4") for name in (*_PLACE, "at_least", *DISTANCE_FIELDS)),
        *_KEYS,
        *((name, "<u1") for name in ("class", "known_steps", "source", "unknown")),
    ]
)
"""One road user: where it is at the time of the highest risk, and the risk over the horizon."""

STEP_POINT = np.dtype(
    [
        *((name, "<f4") for name in _PLACE),
        *_KEYS,
        *((name, "<u1") for name in ("class", "step", "source", "unknown")),
    ]
)
"""One road user at one step."""


def risk_to_agent_cloud(risk: CollisionRisk, types: Types) -> Any:
    """Return the cloud with one point for each road user, in the order of the predictions."""
    points = np.zeros(len(risk), dtype=AGENT_POINT)
    row = np.arange(len(risk))
    if len(risk) and risk.position.shape[1]:
        points["x"], points["y"] = risk.position[row, risk.peak_step].T
    points["t"], points["probability"] = risk.peak_time_s, risk.peak
    points["at_least"] = risk.at_least
    for column, name in enumerate(DISTANCE_FIELDS):
        points[name] = risk.distance_m[:, column]
    points["known_steps"] = np.minimum(risk.known_steps, 255)
    points["unknown"] = risk.agent_unknown
    _fill(points, risk, lambda values: values)
    return _cloud(points, risk, types)


def risk_to_step_cloud(risk: CollisionRisk, types: Types) -> Any:
    """Return the cloud with one point for each road user and step, road user by road user.

    Raises:
        MessageError: more steps than a byte counts.
    """
    n, steps = risk.probability.shape
    if steps > 256:
        raise MessageError(f"risk has {steps} steps, expected at most 256")
    points = np.zeros((n, steps), dtype=STEP_POINT)
    points["x"], points["y"] = risk.position[..., 0], risk.position[..., 1]
    points["t"], points["step"] = risk.time_s, np.arange(steps)
    points["probability"], points["unknown"] = risk.probability, risk.unknown
    _fill(points, risk, lambda values: values[:, None])
    return _cloud(points.reshape(-1), risk, types)


def agents_from_cloud(message: Any) -> NDArray[Any]:
    """Return the points of :func:`risk_to_agent_cloud`, as records of :data:`AGENT_POINT`.

    Raises:
        MessageError: the cloud has another layout.
    """
    return _records(message, AGENT_POINT)


def steps_from_cloud(message: Any) -> NDArray[Any]:
    """Return the points of :func:`risk_to_step_cloud`, as records of :data:`STEP_POINT`.

    Raises:
        MessageError: the cloud has another layout.
    """
    return _records(message, STEP_POINT)


def _fill(points: NDArray[Any], risk: CollisionRisk, spread: Any) -> None:
    """Fill what every point has; ``spread`` fits [n] values to the points."""
    points["z"] = spread(np.nan_to_num(risk.z))
    points["class"], points["source"] = spread(risk.agent_class), spread(risk.source)
    for word, name in enumerate(KEY_FIELDS):
        points[name] = spread(risk.key[:, word])


def _cloud(points: NDArray[Any], risk: CollisionRisk, types: Types) -> Any:
    names = [name for name in points.dtype.names or () if points.dtype[name].kind == "f"]
    return records_to_cloud(
        points,
        types,
        stamp_ns=risk.stamp_ns,
        frame_id=risk.frame_id,
        is_dense=all(bool(np.isfinite(points[name]).all()) for name in names),
    )


def _records(message: Any, layout: np.dtype[Any]) -> NDArray[Any]:
    records = cloud_to_records(message)
    names = layout.names or ()
    require_fields(records, names, "such risk")
    out = np.empty(len(records), dtype=layout)
    for name in names:
        out[name] = records[name]
    return out
