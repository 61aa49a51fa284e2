# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions for the tests of the node risk."""

import dataclasses

import numpy as np

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import Prediction

START = 1_700_000_000_000_000_000
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"


def prediction(x=(3.0, 40.0), **changes):
    """Return cars that stand on the x axis, named 1, 2, ..."""
    n = len(x)
    mean = np.zeros((n, 1, 2, 4))
    mean[..., 0] = np.array(x)[:, None, None]
    made = Prediction(
        stamp_ns=START,
        frame_id="map",
        key=keys_from_integers(range(1, n + 1)),
        agent_class=np.ones(n, np.uint8),
        z=np.zeros(n),
        size=np.tile([4.0, 2.0], (n, 1)),
        initial=np.full((n, 4), np.nan),
        initial_yaw=np.zeros(n),
        time_s=np.array([1.0, 2.0]),
        weight=np.ones((n, 1)),
        mean=mean,
        yaw=np.zeros((n, 1, 2)),
        covariance=np.tile(np.eye(2), (n, 1, 2, 1, 1)),
        source=np.zeros(n, np.uint8),
    )
    return dataclasses.replace(made, **changes)
