# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of the scores that the node has of its own predictions, and of what it corrected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mtpgo_core.quality.metrics import MOVING_COVERAGE_KEY, TIMES_S
from mtpgo_training.reports.figure_style import new_axes, numbers
from mtpgo_training.reports.honesty.honesty_figures import NOMINAL
from mtpgo_training.reports.honesty.live_scores import longest_window
from mtpgo_training.reports.series import BASELINE_COLOURS, DASHES, MODEL_COLOURS, draw_line

Json = dict[str, Any]

_MOVING = "_moving"


def live_coverage_figure(live: Mapping[str, Sequence[Json]]) -> Figure | None:
    """Draw the node's coverage of 90 and 50 % over the time ahead, None without any.

    Args:
        live: by bag, rows with ``group``, ``time_s`` and the scores; moving groups are shown.
    """
    lines = _lines(live, "coverage_90")
    if not lines:
        return None
    figure, axes = new_axes()
    for level in (0.9, 0.5):
        axes.axhline(level, color=NOMINAL, lw=1.0, zorder=2)
    for i, (name, values) in enumerate(lines.items()):
        style = {"color": MODEL_COLOURS[i % len(MODEL_COLOURS)], "marker": "o", "ms": 4}
        draw_line(axes, TIMES_S, values, label=name, lw=2.2, **style)
        inner = _lines(live, "coverage_50").get(name)
        if inner is not None:
            draw_line(axes, TIMES_S, inner, label="_", ls=":", **style)
    axes.set(xlim=(0, None), ylim=(0, 1.01), xlabel="time ahead (s)")
    axes.set(ylabel="share of truths inside")
    axes.set_title("Live, moving: in the 90 % (solid), 50 % ellipse (dotted)")
    axes.legend(loc="lower left")
    return figure


def live_error_figure(live: Mapping[str, Sequence[Json]]) -> Figure | None:
    """Draw the node's ADE over the time ahead beside constant velocity's, None without any.

    Args:
        live: see :func:`live_coverage_figure`.
    """
    lines, constant = _lines(live, "ade"), _lines(live, "cv_ade")
    if not lines:
        return None
    figure, axes = new_axes()
    for i, (name, values) in enumerate(lines.items()):
        style = {"color": MODEL_COLOURS[i % len(MODEL_COLOURS)], "marker": "o", "ms": 4}
        draw_line(axes, TIMES_S, values, label=name, lw=2.2, **style)
        if name in constant:
            draw_line(axes, TIMES_S, constant[name], label="_", ls=DASHES, **style)
    axes.plot([], [], color=BASELINE_COLOURS["ca"], ls=DASHES, label="constant velocity")
    axes.set(xlim=(0, None), ylim=(0, None), xlabel="time ahead (s)", ylabel="ADE (m)")
    axes.set_title("Live: error of moving road users up to a time")
    axes.legend(loc="upper left")
    return figure


def calibration_effect_figure(effect: Mapping[str, Json]) -> Figure | None:
    """Draw the 90 % coverage of moving road users with each calibration, None without two.

    Args:
        effect: see :func:`~.live_scores.calibration_effect_table`.
    """
    keys = [MOVING_COVERAGE_KEY.format(time_s) for time_s in TIMES_S]
    found = {name: numbers([scores.get(key) for key in keys]) for name, scores in effect.items()}
    found = {name: values for name, values in found.items() if np.isfinite(values).any()}
    if len(found) < 2:
        return None
    figure, axes = new_axes()
    axes.axhline(0.9, color=NOMINAL, lw=1.0, zorder=2)
    lowest = 0.9
    for i, (name, values) in enumerate(found.items()):
        colour = MODEL_COLOURS[i % len(MODEL_COLOURS)]
        draw_line(axes, TIMES_S, values, label=name, color=colour, lw=2.2, marker="o", ms=4)
        lowest = min(lowest, float(np.nanmin(values)))
    axes.set(xlim=(0, None), ylim=(max(0.0, min(0.5, lowest - 0.05)), 1.01))
    axes.set(xlabel="time ahead (s)", ylabel="share of truths inside")
    axes.set_title("Moving road users in the 90 % ellipse")
    axes.legend(loc="lower left")
    return figure


def _lines(live: Mapping[str, Sequence[Json]], score: str) -> dict[str, np.ndarray]:
    """Return [times] values of a score by bag and moving group, those with any."""
    found = {}
    for bag, rows in live.items():
        own = {(row["group"], row["time_s"]): row[score] for row in longest_window(rows)}
        for group in dict.fromkeys(group for group, _ in own if group.endswith(_MOVING)):
            values = numbers([own.get((group, time_s)) for time_s in TIMES_S])
            if np.isfinite(values).any():
                kind = group.removesuffix(_MOVING).replace("_", "-")
                found[f"{kind}, {bag}" if len(live) > 1 else kind] = values
    return found
