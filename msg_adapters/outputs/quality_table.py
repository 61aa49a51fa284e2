# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scores of the node's own predictions as rows of numbers, and their decoder."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.types import Types
from mtpgo_core.errors import MessageError
from mtpgo_core.quality.quality_report import QUALITY_ROW

QUALITY_TABLE_TYPE = "std_msgs/msg/Float64MultiArray"

_DIMENSION = "std_msgs/msg/MultiArrayDimension"
_LAYOUT = "std_msgs/msg/MultiArrayLayout"
_COLUMNS = QUALITY_ROW.names or ()


def quality_to_array(rows: NDArray[Any], types: Types) -> Any:
    """Return rows of ``QUALITY_ROW`` as a ``std_msgs/Float64MultiArray``.

    The label of the second dimension has the names of the columns, separated by commas.
    """
    values = np.stack([rows[name].astype(np.float64) for name in _COLUMNS], axis=-1)
    width = len(_COLUMNS)
    dimensions = [
        types.make(_DIMENSION, label="row", size=len(rows), stride=len(rows) * width),
        types.make(_DIMENSION, label=",".join(_COLUMNS), size=width, stride=width),
    ]
    return types.make(
        QUALITY_TABLE_TYPE,
        layout=types.make(_LAYOUT, dim=dimensions),
        data=types.doubles(values.ravel()),
    )


def quality_from_array(message: Any) -> NDArray[Any]:
    """Return the rows, a structured array of ``QUALITY_ROW``; columns that are missing are NaN.

    Raises:
        MessageError: the message has another layout.
    """
    dimensions = message.layout.dim
    names = dimensions[1].label.split(",") if len(dimensions) == 2 else []
    data = np.asarray(message.data, dtype=np.float64)
    if not all(names) or len(names) != max(1, len(set(names))) or len(data) % len(names):
        raise MessageError(
            f"array of {len(data)} numbers has the dimensions "
            f"{[d.label for d in dimensions]}, expected rows, and columns with their names"
        )
    values = data.reshape(-1, len(names))
    rows = np.zeros(len(values), dtype=QUALITY_ROW)
    for name in _COLUMNS:
        if name in names:
            rows[name] = values[:, names.index(name)]
        elif QUALITY_ROW[name].kind == "f":
            rows[name] = np.nan
    return rows
