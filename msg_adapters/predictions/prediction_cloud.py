# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The canonical output: a PointCloud2 with one point per agent, mode and step, and back.

88 bytes per point, agent-major, then mode, then step; RViz and Foxglove draw it as it is. The
layout is described in docs/messages.md. The first 64 bytes stay fixed; fields are only appended.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.conversions import finite, positive, stamp_to_ns
from msg_adapters.inputs.object_cloud import KEY_FIELDS
from msg_adapters.types import Types
from msg_adapters.wire.cloud import cloud_to_records, records_to_cloud, require_fields
from msg_adapters.wire.cloud_bytes import cloud_from_cdr
from mtpgo_core.errors import MessageError
from mtpgo_core.prediction.output_assembly import heaviest_modes
from mtpgo_core.schema import Float64Array, Prediction

_FLOATS = ("x", "y", "z", "t", "weight", "vx", "vy", "yaw", "cov_xx", "cov_xy", "cov_yy")
_FIELDS = (
    *((name, "<f4") for name in _FLOATS),
    *((name, "<u4") for name in KEY_FIELDS),
    *((name, "<u1") for name in ("class", "mode", "step", "source")),
)
_LATER_FIELDS = (
    ("sigma_factor_50", "<f4"),
    ("calibration", "<u1"),
    ("x_rest", "<f4"),
    ("y_rest", "<f4"),
    ("length", "<f4"),
    ("width", "<f4"),
)
"""Fields after those of the first 64 bytes; clouds recorded before they existed lack them."""

_PADDING = 3
"""Bytes after ``calibration``, so that floats are aligned."""


def _layout() -> np.dtype[Any]:
    names, formats = zip(*_FIELDS, *_LATER_FIELDS, strict=True)
    sizes = [np.dtype(kind).itemsize for kind in formats]
    sizes[names.index("calibration")] += _PADDING
    offsets = np.cumsum([0, *sizes]).tolist()
    return np.dtype(
        {
            "names": list(names),
            "formats": list(formats),
            "offsets": offsets[:-1],
            "itemsize": offsets[-1],
        }
    )


POINT = _layout()
"""One point. Lengths m, times s, angles rad; vectors along the axes of the header's frame.

``x`` is float32 because RViz draws no other; ``x + x_rest``, added in float64, is exact to less
than a micrometre also at UTM coordinates, where float32 alone has steps of 0.5 m.
"""

REQUIRED_FIELDS = tuple(name for name, _ in _FIELDS)

MAX_COUNT = 256
"""Most modes, and most steps: each is counted in a byte."""

LATEST_S, SOONEST_S = 1e4, 1e-3
"""The last step of every prediction is between these times (s). Chosen far around every horizon:
floats that are read in the wrong byte order are not."""

_WEIGHT_SLACK = 1e-3
"""A weight above 1 by no more than this is rounding; chosen."""

_FREE_CELLS, _CELLS_PER_POINT = 1 << 20, 16
"""A cloud with gaps is arranged into at most so many agents x modes x steps, or so many for each
of its points if that is more. Chosen: 80 MB; a few points must not claim gigabytes."""


def prediction_to_pointcloud2(
    prediction: Prediction, types: Types, *, max_modes: int | None = None
) -> Any:
    """Return the prediction as a cloud of ``n * modes * steps`` points.

    Args:
        prediction: what to publish; stamp and frame go into the header.
        types: source of message classes.
        max_modes: the heaviest modes to keep, renormalised; None keeps all.

    Raises:
        MessageError: more modes or steps than a byte counts.
    """
    weight, modes = heaviest_modes(prediction, max_modes)
    n, steps = len(prediction), len(prediction.time_s)
    if modes > MAX_COUNT or steps > MAX_COUNT:
        raise MessageError(
            f"prediction has {modes} modes and {steps} steps, expected at most {MAX_COUNT} each"
        )
    points = np.zeros((n, modes, steps), dtype=POINT)
    mean = prediction.mean[:, :modes]
    covariance = prediction.covariance[:, :modes]
    size = np.where(prediction.size > 0.0, prediction.size, 0.0)  # the cloud's unknown size
    columns = {
        "x": mean[..., 0],
        "y": mean[..., 1],
        "z": _per_agent(np.nan_to_num(prediction.z)),
        "t": prediction.time_s,
        "weight": weight[:, :, None],
        "vx": mean[..., 2],
        "vy": mean[..., 3],
        "yaw": prediction.yaw[:, :modes],
        "cov_xx": covariance[..., 0, 0],
        "cov_xy": covariance[..., 0, 1],
        "cov_yy": covariance[..., 1, 1],
        "class": _per_agent(prediction.agent_class),
        "mode": np.arange(modes)[:, None],
        "step": np.arange(steps),
        "source": _per_agent(prediction.source),
        "sigma_factor_50": prediction.sigma_factor_50.reshape(n, 1, steps),
        "calibration": _per_agent(prediction.calibration),
        "length": _per_agent(size[:, 0]),
        "width": _per_agent(size[:, 1]),
    }
    columns |= {name: _per_agent(prediction.key[:, i]) for i, name in enumerate(KEY_FIELDS)}
    for name, values in columns.items():
        points[name] = values
    for axis, name in enumerate(("x", "y")):
        points[name + "_rest"] = mean[..., axis] - points[name]
    dense = bool(np.isfinite(mean).all() and np.isfinite(covariance).all())
    return records_to_cloud(
        points.reshape(-1),
        types,
        stamp_ns=prediction.stamp_ns,
        frame_id=prediction.frame_id,
        is_dense=dense,
    )


def prediction_from_pointcloud2(message: Any) -> Prediction:
    """Return the prediction in a canonical cloud as arrays.

    Points may have any order and some may be missing (a filtered cloud); what is missing is NaN,
    and a mode that is missing has weight zero. A size that is unknown, or that an older cloud
    lacks, is NaN. State and yaw at the stamp are not in the cloud and are NaN. Fields are found by
    name; the data may have either byte order.

    Args:
        message: ``sensor_msgs/PointCloud2`` of rclpy, rosbags or mcap-ros2-support.

    Returns:
        :class:`~mtpgo_core.schema.Prediction`, in the frame of the message's header: positions in
        m, velocities in m/s, angles in rad, covariances in m^2, times in s after the stamp.
        Agents are in the order of their first points.

    Raises:
        MessageError: the cloud does not have the layout of predictions, or contradicts itself.
    """
    records = cloud_to_records(message)
    require_fields(records, REQUIRED_FIELDS, "predictions")
    _check_types(records.dtype)
    with np.errstate(invalid="ignore"):  # signalling NaN
        return _prediction(message, records)


def _prediction(message: Any, records: NDArray[Any]) -> Prediction:
    """Return the prediction of points whose fields are those of predictions."""
    grid, present, first = _grid(records)
    n = len(grid)

    def column(*names: str) -> Float64Array:
        values = np.stack([grid[name] for name in names], axis=-1).astype(np.float64)
        values[~present] = np.nan
        return values

    mean = column("x", "y", "vx", "vy")
    if {"x_rest", "y_rest"} <= set(records.dtype.names or ()):
        mean[..., :2] += column("x_rest", "y_rest")
    xx, xy, yy = np.moveaxis(column("cov_xx", "cov_xy", "cov_yy"), -1, 0)
    weight = np.where(present, grid["weight"], 0.0).astype(np.float64).max(axis=2, initial=0.0)
    times = np.where(present, grid["t"], -np.inf).max(axis=(0, 1), initial=-np.inf)
    _check_plausible(records, times[np.isfinite(times)], bool(message.is_bigendian))
    return Prediction(
        stamp_ns=stamp_to_ns(message.header.stamp),
        frame_id=str(message.header.frame_id),
        key=np.stack([first[name] for name in KEY_FIELDS], axis=-1)
        .astype(np.uint32)
        .reshape(n, 4),
        agent_class=np.ascontiguousarray(first["class"]),
        z=finite(first["z"]),
        size=_size(first),
        initial=np.full((n, 4), np.nan),
        initial_yaw=np.full(n, np.nan),
        time_s=np.where(np.isfinite(times), times, np.nan).astype(np.float64),
        weight=weight,
        mean=mean,
        yaw=column("yaw")[..., 0],
        covariance=np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2),
        source=np.ascontiguousarray(first["source"]),
        **_later_fields(grid, first),
    )


def _size(first: NDArray[Any]) -> Float64Array:
    """Return [n, 2] length and width of the agents' first points (m), NaN where unknown."""
    if not {"length", "width"} <= set(first.dtype.names or ()):
        return np.full((len(first), 2), np.nan)
    return positive(np.stack([first["length"], first["width"]], axis=-1).astype(np.float64))


def prediction_from_cdr(data: bytes | bytearray | memoryview) -> Prediction:
    """Return the prediction in a serialised cloud; neither rclpy nor rosbags is needed.

    Args:
        data: CDR bytes with their encoding header, as a subscription with ``raw=True`` or a bag
            gives them.

    Raises:
        MessageError: the bytes are no cloud or end too early, or see
            :func:`prediction_from_pointcloud2`.
    """
    return prediction_from_pointcloud2(cloud_from_cdr(data))


def _check_types(layout: np.dtype[Any]) -> None:
    """Check the types of the fields of predictions; floats may have either size.

    Raises:
        MessageError: a field has another type.
    """
    for name, expected in (*_FIELDS, *_LATER_FIELDS):
        if name not in (layout.names or ()):
            continue
        kind = layout.fields[name][0]  # type: ignore[index]
        wanted = np.dtype(expected)
        if kind.kind != wanted.kind or (wanted.kind == "u" and kind.itemsize != wanted.itemsize):
            raise MessageError(
                f"point cloud field {name!r} is {kind.name}, expected {wanted.name}, so it holds"
                " no predictions"
            )


def _check_plausible(records: NDArray[Any], times: Float64Array, big_endian: bool) -> None:
    """Check times and weights, which tell whether the bytes are read as they were written.

    Args:
        records: [points] as read.
        times: [steps] time of each step that has a point (s).
        big_endian: what the message says of its byte order.

    Raises:
        MessageError: they are not those of predictions.
    """
    if not len(records):
        return
    weight = records["weight"]
    rising = bool((np.diff(times) > 0.0).all()) and bool(np.isfinite(records["t"]).all())
    if (
        rising
        and times[0] >= 0.0
        and SOONEST_S <= times[-1] <= LATEST_S
        and bool(((weight >= 0.0) & (weight <= 1.0 + _WEIGHT_SLACK)).all())
    ):
        return
    raise MessageError(
        f"point cloud has times from {times.min(initial=np.inf):g} to"
        f" {times.max(initial=-np.inf):g} s and weights from {weight.min():g} to {weight.max():g},"
        " expected times that rise from step to step and weights between 0 and 1; are its data"
        f" really {'big' if big_endian else 'little'}-endian, as it says?"
    )


def _later_fields(grid: NDArray[Any], first: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return fields that older clouds lack; what those were served with is the default."""
    names = grid.dtype.names or ()
    if not {"sigma_factor_50", "calibration"} <= set(names) or not grid.size:
        return {}
    factor = grid["sigma_factor_50"].max(axis=1).astype(np.float64)  # 0 where a point is missing
    return {
        "sigma_factor_50": np.where(factor > 0.0, factor, 1.0),
        "calibration": np.ascontiguousarray(first["calibration"]),
    }


def _per_agent(values: NDArray[Any]) -> NDArray[Any]:
    return values[:, None, None]


def _grid(records: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_], NDArray[Any]]:
    """Arrange points by agent, mode and step.

    Returns:
        [n, M, H] records, agents in the order of their first points; [n, M, H] whether they are
        present; [n] the first point of every agent.
    """
    if len(records) == 0:
        empty = np.empty((0, 0, 0), dtype=records.dtype)
        return empty, np.empty((0, 0, 0), dtype=bool), records
    key = np.stack([records[name] for name in KEY_FIELDS], axis=-1)
    mode, step = records["mode"].astype(np.intp), records["step"].astype(np.intp)
    modes, steps = int(mode.max()) + 1, int(step.max()) + 1
    if _is_sorted(key, mode, step, modes, steps):
        grid = records.reshape(-1, modes, steps)
        return grid, np.ones(grid.shape, dtype=bool), grid[:, 0, 0]
    _, first, agent = np.unique(key, axis=0, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.intp)
    rank[np.argsort(first)] = np.arange(len(first))
    agent = rank[agent.reshape(-1)]
    check_cells("point cloud", len(records), len(first), modes, steps)
    grid = np.zeros((len(first), modes, steps), dtype=records.dtype)
    present = np.zeros(grid.shape, dtype=bool)
    grid[agent, mode, step] = records
    present[agent, mode, step] = True
    if np.count_nonzero(present) < len(records):
        raise MessageError(
            f"point cloud has {len(records) - np.count_nonzero(present)} points of the same agent,"
            " mode and step as another one, expected one point for each"
        )
    return grid, present, records[np.sort(first)]


def check_cells(message: str, points: int, agents: int, modes: int, steps: int) -> None:
    """Check that few points do not make large arrays.

    Args:
        message: name of the message, for the error.
        points: the points, or poses, that it has.
        agents: length of the arrays' first axis.
        modes: of the second.
        steps: of the third.

    Raises:
        MessageError: there are too few points for such arrays.
    """
    cells = agents * modes * steps
    if cells > max(_FREE_CELLS, _CELLS_PER_POINT * points):
        raise MessageError(
            f"{message} has {points} points of {agents} agents, {modes} modes and"
            f" {steps} steps, expected at least {-(-cells // _CELLS_PER_POINT)} of these {cells}"
        )


def _is_sorted(
    key: NDArray[np.uint32],
    mode: NDArray[np.intp],
    step: NDArray[np.intp],
    modes: int,
    steps: int,
) -> bool:
    """Return whether the points are complete and in the order of our encoder."""
    block = modes * steps
    agents, rest = divmod(len(key), block)
    if rest:
        return False
    place = np.arange(block)
    return (
        np.array_equal(mode, np.tile(place // steps, agents))
        and np.array_equal(step, np.tile(place % steps, agents))
        and bool((key.reshape(agents, block, 4) == key[::block, None]).all())
        and len(np.unique(key[::block], axis=0)) == agents
    )
