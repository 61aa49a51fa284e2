# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The figures of the report, from the content of ``mtpgo evaluate --json``."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mtpgo_core.quality import metrics
from mtpgo_training.atomic_files import replacing
from mtpgo_training.reports.figure_style import STYLE, line_style, new_axes, numbers
from mtpgo_training.reports.honesty.honesty_figures import (
    coverage_figure,
    spread_figure,
    weights_figure,
)
from mtpgo_training.reports.honesty.live_figures import (
    calibration_effect_figure,
    live_coverage_figure,
    live_error_figure,
)
from mtpgo_training.reports.series import PROTOCOL, colour, draw_line, series_names

Json = dict[str, Any]


def draw_figures(content: Json, folder: Path) -> dict[str, Path]:
    """Draw all figures for which there are values; return the PNG files in a folder by name."""
    drawers: dict[str, Callable[[Json], Figure | None]] = {
        "coverage": coverage_figure,
        "spread": spread_figure,
        "weights": weights_figure,
        "horizon": _horizon,
        "reliability": _reliability,
        "nees": _nees,
        "manoeuvres": _manoeuvres,
    }
    paths = save_figures({n: functools.partial(d, content) for n, d in drawers.items()}, folder)
    live, effect = content.get("live", {}), content.get("calibration_effect", {})
    return paths | draw_live_figures(live, effect, folder)


def draw_live_figures(
    live: Mapping[str, Sequence[Json]], effect: Mapping[str, Json], folder: Path
) -> dict[str, Path]:
    """Draw what the node found out itself; return the PNG files in a folder by name.

    Args:
        live: see :func:`live_coverage_figure`.
        effect: see :func:`calibration_effect_figure`.
        folder: where to.
    """
    drawers = {
        "live_coverage": lambda: live_coverage_figure(live),
        "live_error": lambda: live_error_figure(live),
        "calibration_effect": lambda: calibration_effect_figure(effect),
    }
    return save_figures(drawers, folder)


def save_figures(
    drawers: Mapping[str, Callable[[], Figure | None]], folder: Path
) -> dict[str, Path]:
    """Draw figures by name; return the PNG files in a folder of those that there are."""
    paths = {}
    for name, draw in drawers.items():
        with mpl.rc_context(STYLE):
            figure = draw()
            if figure is None:
                continue
            FigureCanvasAgg(figure)
            paths[name] = folder / f"{name}.png"
            with replacing(paths[name]) as temporary:
                figure.savefig(temporary, dpi=150, format="png", facecolor="white")
    return paths


def _horizon(content: Json) -> Figure | None:
    figure, axes = new_axes()
    errors = {
        name: numbers(content["by_horizon"][name][PROTOCOL]["displacement"])
        for name in series_names(content)
    }
    # Constant acceleration may leave the axes at the top, so that the others can be read.
    tops = [float(np.nanmax(error)) for name, error in errors.items() if name != "ca"]
    top = 1.25 * max(tops, default=1.0)
    for name, error in errors.items():
        rows = content["by_horizon"][name][PROTOCOL]
        time, highest = numbers(rows["time_s"]), float(np.nanmax(error))
        style = line_style(content, name)
        if highest > top:
            style["label"] += f" (goes beyond the top, to {highest:.1f} m)"
        draw_line(axes, time, error, **style)
        low, high = numbers(rows["displacement_low"]), numbers(rows["displacement_high"])
        if np.isfinite(low).any() and name not in content["baselines"]:
            axes.fill_between(time, low, high, color=colour(content, name), alpha=0.13, lw=0)
    axes.set(xlim=(0, None), ylim=(0, top))
    axes.set(xlabel="time ahead (s)", ylabel="displacement (m)")
    axes.set_title("Error over the horizon")
    axes.legend(loc="upper left")
    return figure


def _reliability(content: Json) -> Figure | None:
    names = [n for n in series_names(content) if content["reliability"][n].get(PROTOCOL)]
    if not names:
        return None
    figure, axes = new_axes()
    axes.plot([0, 1], [0, 1], color="#8d949a", lw=1.0, zorder=2)
    axes.text(0.47, 0.44, "calibrated", ha="left", va="top", color="#8d949a", fontsize=9)
    for name in names:
        rows = content["reliability"][name][PROTOCOL]
        axes.plot(rows["level"], rows["observed"], **line_style(content, name), marker="o", ms=3)
    axes.set(xlim=(0, 1), ylim=(0, 1), xlabel="level of the ellipse")
    axes.set(ylabel="share of truths inside")
    axes.set_title("Reliability")
    axes.legend(loc="lower right")
    return figure


def _nees(content: Json) -> Figure | None:
    names = [
        name
        for name in series_names(content)
        if any(v is not None for v in content["by_horizon"][name][PROTOCOL]["nees"])
    ]
    if not names:
        return None
    figure, axes = new_axes()
    axes.axhline(metrics.EXPECTED_NEES, color="#8d949a", lw=1.0, zorder=2)
    top = 4.0
    for name in names:
        rows = content["by_horizon"][name][PROTOCOL]
        time, own = numbers(rows["time_s"]), numbers(rows["nees"])
        draw_line(axes, time, own, **line_style(content, name))
        top = max(top, float(np.nanmax(own)))
        if name not in content["baselines"]:
            style = line_style(content, name) | {"ls": ":", "label": f"{name}, whole mixture"}
            mixture = numbers(rows["nees_mixture"])
            draw_line(axes, time, mixture, **style)
            top = max(top, float(np.nanmax(mixture)))
    axes.set(xlim=(0, None), ylim=(0, min(1.1 * top, 20.0)))
    axes.set(xlabel="time ahead (s)", ylabel="NEES")
    axes.set_title("NEES over the horizon (2 where the covariance is right)")
    axes.legend(loc="best")
    return figure


def _manoeuvres(content: Json) -> Figure | None:
    names = [name for name in series_names(content) if name not in ("ca", "ctrv")]
    groups = list(content["by_manoeuvre"][names[0]][PROTOCOL])
    if not groups:
        return None
    figure, axes = new_axes(11.4, 3.4)
    width = 0.8 / len(names)
    for i, name in enumerate(names):
        rows = content["by_manoeuvre"][name][PROTOCOL]
        values = [rows[group]["ade"] if group in rows else np.nan for group in groups]
        place = np.arange(len(groups)) + (i - 0.5 * (len(names) - 1)) * width
        bars = axes.bar(place, values, 0.92 * width, color=colour(content, name), label=name)
        axes.bar_label(bars, fmt="%.2f", fontsize=8, padding=1, color="#5d6872")
    counts = content["by_manoeuvre"][names[0]][PROTOCOL]
    labels = [f"{group.replace('_', ' ')}\n({counts[group]['n']})" for group in groups]
    axes.set_xticks(range(len(groups)), labels)
    axes.set(ylabel="ADE (m)")
    axes.grid(visible=False, axis="x")
    axes.set_title("ADE by manoeuvre (road users seen for the whole horizon)")
    axes.legend(loc="upper left", ncols=len(names))
    axes.margins(y=0.2)
    return figure
