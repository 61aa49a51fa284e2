# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Picture of a few predictions: modes, ellipses, past and true future, over the lanes.

Each panel is turned so that the road user in focus drives to the right, with equal scales.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke

from mtpgo_core.schema import AgentClass, Float64Array
from mtpgo_training.atomic_files import replacing
from mtpgo_training.evaluation.moments import Moment
from mtpgo_training.reports.agent_drawing import (
    BODY,
    CV,
    FOCAL,
    GROUND,
    LANE,
    PREDICTED,
    TRUTH,
    draw_agent,
)
from mtpgo_training.reports.drawn_bodies import SHOWN_WEIGHT
from mtpgo_training.reports.local_view import LocalView, surroundings

LOWEST, HIGHEST = 0.2, 0.46
"""Limits of the height of a panel relative to its width; chosen."""

MIN_WIDTH_M, MARGIN_M, OTHERS_MARGIN_M = 80.0, np.array([12.0, 6.0]), 6.0
"""Least width of a panel, margins (x, y) around the road user in focus and its predictions, and
margin in y around the other road users (m); chosen."""

PATHS = "#9aa3ab"
"""Colour of the paths of all road users, where there is no map."""

PAST_S = 3.0
"""Length of the past that is drawn (s): the history of the models."""


def draw_picture(moments: Sequence[Moment], path: Path) -> None:
    """Draw a panel for each moment, one below the other.

    Args:
        moments: at least one.
        path: the PNG file.
    """
    scenes = [surroundings(moment, PAST_S) for moment in moments]
    windows = [_window(m, around) for m, around in zip(moments, scenes, strict=True)]
    spans = [upper - lower for lower, upper in windows]
    width_in, gap_in, foot_in = 11.0, 0.34, 0.7
    panels_in = [width_in * float(span[1] / span[0]) for span in spans]
    height_in = sum(panels_in) + len(moments) * gap_in + foot_in
    top_in = height_in
    with mpl.rc_context({"font.size": 10, "font.family": "DejaVu Sans"}):
        figure = Figure(figsize=(width_in, height_in), facecolor="white")
        FigureCanvasAgg(figure)
        for moment, around, window, panel_in in zip(
            moments, scenes, windows, panels_in, strict=True
        ):
            top_in -= gap_in + panel_in
            axes = figure.add_axes((0.0, top_in / height_in, 1.0, panel_in / height_in))
            _draw_moment(axes, moment, around, *window)
        figure.legend(
            handles=_legend(scenes),
            loc="lower center",
            ncols=4,
            frameon=False,
            bbox_to_anchor=(0.5, 0.0),
            handlelength=1.8,
            columnspacing=1.4,
        )
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=150, format="png")


def _draw_moment(
    axes: Any, moment: Moment, around: LocalView, lower: Float64Array, upper: Float64Array
) -> None:
    _draw_ground(axes, around)
    order = np.argsort(np.arange(len(moment.prediction)) == moment.agent, kind="stable")
    for agent in order.tolist():
        draw_agent(axes, moment, around, agent, focal=agent == moment.agent)
    axes.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), aspect="equal")
    axes.set(xticks=[], yticks=[], facecolor=GROUND)
    for spine in axes.spines.values():
        spine.set_color("#d5d8da")
    _draw_scale(axes, lower, upper)
    axes.set_title(_title(moment, around), loc="left", fontsize=10, pad=5, x=0.006)


def _window(moment: Moment, around: LocalView) -> tuple[Float64Array, Float64Array]:
    """Return the corners of a panel (m) with the focal road user and those next to its path."""
    prediction, agent = moment.prediction, moment.agent
    shown = prediction.weight[agent] >= SHOWN_WEIGHT
    points = np.concatenate(
        [
            around.turn(prediction.mean[agent, shown, :, :2]).reshape(-1, 2),
            around.past[agent],
            around.future[agent],
            np.array([[0.0, 0.0], around.velocity[agent] * float(prediction.time_s[-1])]),
        ]
    )
    points = points[np.isfinite(points).all(axis=1)]
    lower, upper = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    width = max(MIN_WIDTH_M, upper[0] - lower[0], (upper[1] - lower[1]) / HIGHEST)
    middle = (lower[0] + upper[0]) / 2.0
    left, right = middle - width / 2.0, middle + width / 2.0

    x, y = around.position.T
    others = y[(x > left) & (x < right) & (np.abs(y) < HIGHEST * width / 2.0)]
    bottom = min(lower[1], float(others.min(initial=0.0)) - OTHERS_MARGIN_M)
    top = max(upper[1], float(others.max(initial=0.0)) + OTHERS_MARGIN_M)
    height = float(np.clip(top - bottom, LOWEST * width, HIGHEST * width))
    middle = float(np.clip((bottom + top) / 2.0, upper[1] - height / 2.0, lower[1] + height / 2.0))
    return np.array([left, middle - height / 2.0]), np.array([right, middle + height / 2.0])


def _draw_ground(axes: Any, around: LocalView) -> None:
    if around.lanes:
        axes.add_collection(LineCollection(around.lanes, colors=LANE, linewidths=1.1, zorder=1))
    else:
        # Without a map, the paths of all road users of the recording show where the road is.
        axes.add_collection(
            LineCollection(
                around.paths,
                colors=PATHS,
                linewidths=9,
                alpha=0.07,
                zorder=1,
                capstyle="round",
            )
        )


def _draw_scale(axes: Any, lower: Float64Array, upper: Float64Array) -> None:
    width = float(upper[0] - lower[0])
    length = 10.0 if width < 130.0 else 20.0
    x, y = lower[0] + 3.0 / 110.0 * width, lower[1] + 0.025 * width
    # Vehicles may be there: bar and text are read on a ground of their own.
    corner, size = (x - 0.008 * width, y - 0.007 * width), (length + 0.016 * width, 0.031 * width)
    axes.add_patch(Rectangle(corner, *size, facecolor=GROUND, alpha=0.88, lw=0, zorder=29))
    axes.plot([x, x + length], [y, y], color="#444444", lw=2.2, solid_capstyle="butt", zorder=30)
    axes.text(
        x + length / 2,
        y + 0.006 * width,
        f"{length:.0f} m",
        ha="center",
        va="bottom",
        fontsize=8.5,
        color="#444444",
        zorder=30,
        path_effects=[withStroke(linewidth=3.0, foreground=GROUND)],
    )


def _title(moment: Moment, around: LocalView) -> str:
    recording, prediction = moment.recording, moment.prediction
    time_s = (prediction.stamp_ns - recording.span_ns[0]) * 1e-9
    kind = AgentClass.from_code(int(prediction.agent_class[moment.agent])).name.lower()
    track = int(recording.find_tracks(prediction.key[moment.agent][None])[0])
    speed = float(np.linalg.norm(around.velocity[moment.agent]))
    return (
        f"Recording {recording.name}, t = {time_s:.1f} s: {kind} {recording.track_id[track]} at "
        f"{speed * 3.6:.0f} km/h among {len(prediction)} predicted road users"
        + (f"; {moment.note}" if moment.note else "")
    )


def _truth_line(**style: Any) -> Line2D:
    return Line2D([], [], color=TRUTH, ls=(0, (2.2, 1.4)), marker="o", **style)


def _legend(scenes: Sequence[LocalView]) -> list[Any]:
    ground: list[Any] = []
    if any(around.lanes for around in scenes):
        ground.append(Line2D([], [], color=LANE, lw=1.1, label="lanes"))
    if not all(around.lanes for around in scenes):
        ground.append(Patch(facecolor=PATHS, alpha=0.35, label="paths of all, over the recording"))
    return [
        Patch(facecolor=FOCAL, edgecolor="#8a4a08", label="in focus, and its past 3 s"),
        Line2D([], [], color=PREDICTED, lw=2.2, label="predicted modes, by weight"),
        Patch(facecolor=PREDICTED, alpha=0.25, label="2σ (1 ... 5 s)"),
        _truth_line(lw=1.6, ms=4.5, label="what happened"),
        Line2D([], [], color=CV, lw=1.2, ls=(0, (5, 2)), marker="x", label="constant velocity"),
        Patch(facecolor=BODY, edgecolor="#5d6872", label="others"),
        _truth_line(lw=0.8, ms=2.2, alpha=0.55, label="what others did"),
        *ground,
    ]
