# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drawing of one road user with its past, its predictions and its true future."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Ellipse, Polygon

from mtpgo_core.class_size import known_sizes
from mtpgo_core.frames import rotate
from mtpgo_core.schema import Float64Array
from mtpgo_training.evaluation.moments import Moment
from mtpgo_training.reports.drawn_bodies import SHOWN_WEIGHT
from mtpgo_training.reports.local_view import LocalView

PREDICTED, FOCAL, TRUTH, CV = "#2a6fbb", "#e07b16", "#1a1a1a", "#c0392b"
PAST, LANE, BODY, GROUND = "#7d8790", "#c3c7cb", "#dfe4ea", "#f7f7f5"

STEPS_S = (1.0, 2.0, 3.0, 4.0, 5.0)
"""Times ahead at which the ellipses of the road user in focus are drawn (s); chosen."""


def draw_agent(axes: Any, moment: Moment, around: LocalView, agent: int, *, focal: bool) -> None:
    """Draw one road user: body, past, predicted modes, true future.

    Args:
        axes: the panel, in the frame of the road user in focus (m).
        moment: which prediction.
        around: the moment in the frame of the road user in focus.
        agent: row of the road user in the prediction.
        focal: it is the one in focus, drawn in full and with constant velocity.
    """
    prediction = moment.prediction
    z = 10 if focal else 3
    axes.plot(
        *around.past[agent].T,
        color=FOCAL if focal else PAST,
        lw=2.0 if focal else 1.0,
        alpha=0.9 if focal else 0.6,
        zorder=z,
        solid_capstyle="round",
    )
    _draw_modes(axes, moment, around, agent, focal=focal)
    axes.plot(
        *around.future[agent].T,
        color=TRUTH,
        lw=1.6 if focal else 0.8,
        ls=(0, (2.2, 1.4)),
        zorder=z + 4,
        alpha=1.0 if focal else 0.55,
    )
    end = around.future[agent][-1] if len(around.future[agent]) else np.full(2, np.nan)
    axes.plot(
        *end,
        marker="o",
        ms=4.5 if focal else 2.2,
        color=TRUTH,
        zorder=z + 4,
        alpha=1.0 if focal else 0.55,
    )
    if focal:
        straight = around.velocity[agent] * float(prediction.time_s[-1])
        position = around.position[agent]
        axes.plot(
            *np.stack([position, position + straight]).T,
            color=CV,
            lw=1.2,
            ls=(0, (5, 2)),
            zorder=z + 1,
        )
        axes.plot(*(position + straight), marker="x", ms=6, mew=1.6, color=CV, zorder=z + 1)
    _draw_body(axes, moment, around, agent, focal=focal)


def _draw_modes(axes: Any, moment: Moment, around: LocalView, agent: int, *, focal: bool) -> None:
    """Draw modes as lines that fade with their weight, uncertainty as two-sigma ellipses."""
    prediction = moment.prediction
    z = 10 if focal else 3
    heaviest = float(prediction.weight[agent].max())
    start = around.position[agent][None]
    for mode in np.argsort(prediction.weight[agent]).tolist():
        weight = float(prediction.weight[agent, mode])
        if weight < (SHOWN_WEIGHT if focal else 0.15) and weight < heaviest:
            continue
        share = weight / heaviest
        path = np.concatenate([start, around.turn(prediction.mean[agent, mode, :, :2])])
        axes.plot(
            *path.T,
            color=PREDICTED,
            lw=2.2 if focal else 1.3,
            zorder=z + 2,
            alpha=(0.25 + 0.75 * share) * (1.0 if focal else 0.55),
        )
        for time_s in STEPS_S if focal else STEPS_S[-1:]:
            step = int(np.argmin(np.abs(prediction.time_s - time_s)))
            _draw_ellipse(
                axes,
                path[step + 1],
                around.turn_covariance(prediction.covariance[agent, mode, step]),
                alpha=weight * (0.26 if focal else 0.06),
                zorder=z + 1,
            )


def _draw_ellipse(
    axes: Any, centre: Float64Array, covariance: Float64Array, *, alpha: float, zorder: int
) -> None:
    values, vectors = np.linalg.eigh(covariance)
    height, width = 4.0 * np.sqrt(np.maximum(values, 0.0))
    angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    for fill in (True, False):
        axes.add_patch(
            Ellipse(
                tuple(centre),
                width,
                height,
                angle=angle,
                facecolor=PREDICTED,
                fill=fill,
                edgecolor=PREDICTED,
                lw=0.0 if fill else 0.7,
                alpha=alpha if fill else 2.5 * alpha,
                zorder=zorder,
            )
        )


def _draw_body(axes: Any, moment: Moment, around: LocalView, agent: int, *, focal: bool) -> None:
    kind = moment.prediction.agent_class[[agent]]
    ((length, width),) = known_sizes(around.size[[agent]], kind)
    corners = 0.5 * np.array(
        [(length, width), (-length, width), (-length, -width), (length, -width)]
    )
    corners = rotate(corners, around.yaw[agent]) + around.position[agent]
    axes.add_patch(
        Polygon(
            corners,
            closed=True,
            facecolor=FOCAL if focal else BODY,
            edgecolor="#8a4a08" if focal else "#5d6872",
            lw=0.9,
            zorder=20 if focal else 8,
        )
    )
