# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Order and colours of models and baselines, the same in all tables and figures of a report."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

Json = dict[str, Any]

MODEL_COLOURS = ("#2a6fbb", "#e07b16", "#1f8a5f", "#8a4fb0", "#b8326b", "#4b5a66")
BASELINE_COLOURS = {"cv": "#c0392b", "ca": "#a9adb1", "ctrv": "#7d8790"}
BASELINE_DASHES: dict[str, Any] = {"ca": (0, (1, 1.3)), "ctrv": (0, (6, 2, 1, 2))}
"""Line styles of baselines that differ from :data:`DASHES`: their greys are alike."""

DASHES: Any = (0, (4, 2))
"""Line style of a baseline."""

PROTOCOL = "all"
"""The protocol of the figures and of the results by group."""


def draw_line(axes: Any, x: ArrayLike, y: ArrayLike, *form: str, **style: Any) -> None:
    """Draw a line, whose single points have a marker: a line through one point is not seen.

    Args:
        axes: of matplotlib.
        x: [n] values, NaN for none.
        y: [n] values, NaN for none.
        form: format of matplotlib.
        style: of the line.
    """
    known = np.isfinite(np.asarray(x, dtype=float)) & np.isfinite(np.asarray(y, dtype=float))
    beside = np.r_[False, known[:-1]] | np.r_[known[1:], False]
    alone = np.flatnonzero(known & ~beside).tolist()
    if alone and "marker" not in style:
        style |= {"marker": "o", "markevery": alone}
    axes.plot(x, y, *form, **style)


def series_names(content: Json, baselines: bool = True) -> list[str]:
    """Return the models, then the baselines, that have results under ``PROTOCOL``."""
    own = [n for n, p in content["models"].items() if PROTOCOL in p]
    models = [name for name in own if name not in content["baselines"]]
    return models + ([name for name in own if name in content["baselines"]] if baselines else [])


def colour(content: Json, name: str) -> str:
    """Return the colour of a model or baseline."""
    if name in content["baselines"]:
        return BASELINE_COLOURS.get(name, "#7d8790")
    models = series_names(content, baselines=False)
    return MODEL_COLOURS[models.index(name) % len(MODEL_COLOURS)]
