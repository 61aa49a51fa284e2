# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of honesty: coverage and spread over the horizon, reliability of the mode weights."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mtpgo_training.reports.figure_style import line_style, new_axes, numbers
from mtpgo_training.reports.series import PROTOCOL, draw_line, series_names

Json = dict[str, Any]

NOMINAL = "#8d949a"
"""Colour of what a calibrated prediction would give."""

_MOTION = "moving"

_LEAST_MARGIN = 0.05
"""Least margin around shares; chosen: of one value its surroundings are seen."""


def coverage_figure(content: Json) -> Figure | None:
    """Draw the 90 % coverage of moving road users over the horizon, None without any."""
    found = _moving(content)
    found = {n: v for n, v in found.items() if any(x is not None for x in v["ellipse_90"])}
    if not found:
        return None
    figure, axes = new_axes()
    axes.axhline(0.9, color=NOMINAL, lw=1.0, zorder=2)
    lowest = 0.9
    for name, values in found.items():
        style = line_style(content, name) | {"marker": "o", "ms": 4}
        ellipse = numbers(values["ellipse_90"])
        draw_line(axes, values["time_s"], ellipse, **style)
        lowest = min(lowest, float(np.nanmin(ellipse)))
        if name not in content["baselines"]:
            style |= {"ls": ":", "label": f"{name}, mixture"}
            draw_line(axes, values["time_s"], numbers(values["region_90"]), **style)
    axes.set(ylim=(max(0.0, min(0.5, lowest - 0.05)), 1.01), xlim=(0, None))
    axes.set(xlabel="time ahead (s)", ylabel="share of truths inside")
    axes.set_title("Coverage of 90 %, moving road users")
    axes.legend(loc="lower left")
    return figure


def spread_figure(content: Json) -> Figure | None:
    """Draw sigma and RMSE of moving road users over the horizon, None without any."""
    found = _moving(content)
    found = {n: v for n, v in found.items() if any(x is not None for x in v["spread"]["sigma"])}
    if not found:
        return None
    figure, axes = new_axes()
    for name, values in found.items():
        spread = values["spread"]
        style = line_style(content, name) | {"ls": "-", "label": f"{name}, RMSE"}
        draw_line(axes, spread["time_s"], numbers(spread["rmse"]), **style)
        style |= {"ls": ":", "label": f"{name}, sigma"}
        draw_line(axes, spread["time_s"], numbers(spread["sigma"]), **style)
    axes.set(xlim=(0, None), ylim=(0, None), xlabel="time ahead (s)", ylabel="distance (m)")
    axes.set_title("Expected and real error, moving road users")
    axes.legend(loc="upper left")
    return figure


def weights_figure(content: Json) -> Figure | None:
    """Draw the reliability of the mode weights of moving road users, None without any."""
    found = _moving(content)
    found = {n: v for n, v in found.items() if sum(v["weights"]["reliability"]["count"])}
    if not found:
        return None
    figure, axes = new_axes()
    axes.plot([0, 1], [0, 1], color=NOMINAL, lw=1.0, zorder=2)
    drawn = []
    for name, values in found.items():
        bins = values["weights"]["reliability"]
        weight, nearest = numbers(bins["weight"]), numbers(bins["nearest"])
        known = np.isfinite(weight)
        draw_line(axes, weight[known], nearest[known], **line_style(content, name))
        area = 12.0 + 160.0 * numbers(bins["count"]) / max(bins["count"])
        colour = line_style(content, name)["color"]
        axes.scatter(weight[known], nearest[known], s=area[known], color=colour, zorder=5)
        drawn += [weight[known], nearest[known]]
    limits = _limits(np.concatenate(drawn))
    axes.set(xlim=limits, ylim=limits, xlabel="weight of a mode")
    axes.set(ylabel="share in which it is the nearest")
    axes.set_title("Reliability of weights, moving road users")
    axes.scatter([], [], s=60.0, color=NOMINAL, label="area: number of modes")
    axes.legend(loc="upper left")
    return figure


def _limits(shares: np.ndarray) -> tuple[float, float]:
    """Return limits for both axes of shares: weights of many modes are all small."""
    low, high = float(shares.min()), float(shares.max())
    margin = max(_LEAST_MARGIN, 0.2 * (high - low))
    return max(0.0, low - margin), min(1.0, high + margin)


def _moving(content: Json) -> dict[str, Json]:
    """Return the values of moving road users by model and baseline."""
    own = content.get("honesty", {})
    found = {}
    for name in series_names(content):
        values = own.get(name, {}).get(PROTOCOL, {}).get("by_motion", {}).get(_MOTION)
        if values is not None:
            found[name] = values
    return found
