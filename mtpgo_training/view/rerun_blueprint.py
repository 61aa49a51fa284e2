# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the viewer of rerun shows first: panels, point of view, and what the colours mean."""

from __future__ import annotations

from collections.abc import Collection

import rerun as rr
import rerun.blueprint as rrb

from mtpgo_core.schema import AgentClass, Float64Array
from mtpgo_training.view.view_colours import GROUND, ROAD, colour_bytes
from mtpgo_training.view.view_scene import ELLIPSE_LEVEL, ELLIPSE_TIMES_S, PAST_S

PAST = "scene/past"
"""Entity of the positions of road users, of which the viewer shows the last ``PAST_S``."""

COLOUR_NAMES = {
    AgentClass.CAR: "blue",
    AgentClass.VAN: "light blue",
    AgentClass.TRUCK: "orange",
    AgentClass.BUS: "purple",
    AgentClass.TRAILER: "brown",
    AgentClass.MOTORCYCLE: "dark green",
    AgentClass.BICYCLE: "light green",
    AgentClass.PEDESTRIAN: "pink",
    AgentClass.ANIMAL: "ochre",
    AgentClass.UNKNOWN: "black",
}
"""Names of the colours of classes."""

LEAST_M = 30.0
"""Least width of what is shown (m); chosen: a few road users near each other in their place."""

_AWAY, _ABOVE = 0.25, 0.68
"""Place of the eye, to the south of what is shown and above it, relative to its width; chosen: all
of it is in the view, and seen almost from above."""


def scene_blueprint(name: str, position: Float64Array, scored: bool) -> rrb.Blueprint:
    """Return panels with what is to be seen from above.

    Args:
        name: of the bag or topic.
        position: [k, 3] of road users, relative to the origin (m), one at least.
        scored: there are errors over time.
    """
    lower, upper = position[:, :2].min(axis=0), position[:, :2].max(axis=0)
    middle = (lower + upper) / 2.0
    # The view is wider than high.
    width = max(LEAST_M, float((upper - lower)[0]), 1.6 * float((upper - lower)[1]))
    since = rrb.TimeRangeBoundary.cursor_relative(seconds=-PAST_S)
    until = rrb.TimeRangeBoundary.cursor_relative(seconds=0.0)
    ranges = rrb.VisibleTimeRanges(rrb.VisibleTimeRange("time", start=since, end=until))
    seen = rrb.Spatial3DView(
        origin="scene",
        name=name,
        background=rrb.Background(color=colour_bytes(GROUND)),
        line_grid=rrb.LineGrid3D(spacing=10.0, color=colour_bytes(ROAD), stroke_width=1.0),
        eye_controls=rrb.EyeControls3D(
            position=(middle[0], middle[1] - _AWAY * width, _ABOVE * width),
            look_target=(middle[0], middle[1], 0.0),
            eye_up=(0.0, 0.0, 1.0),
        ),
        overrides={PAST: ranges},
    )
    meaning = rrb.TextDocumentView(origin="legend", name="what is shown")
    errors = rrb.TimeSeriesView(origin="errors", name="errors of predictions (m)")
    below = rrb.Horizontal(errors, meaning, column_shares=[5, 2]) if scored else meaning
    return rrb.Blueprint(
        rrb.Vertical(seen, below, row_shares=[3 if scored else 5, 1]),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="time"),
    )


def legend(kinds: Collection[AgentClass], scored: bool) -> rr.TextDocument:
    """Return what colours and lines mean, in words: the viewer has no text in any colour.

    Args:
        kinds: the classes that are shown.
        scored: what happened is shown, too.
    """
    colours = [f"**{COLOUR_NAMES[kind]}**: {kind.name.lower()}" for kind in sorted(kinds)]
    times = " and ".join(", ".join(f"{t:g}" for t in ELLIPSE_TIMES_S).rsplit(", ", 1))
    rows = [
        *colours,
        "**grey**: predicted at constant velocity",
        "**lines**: modes, the thicker the likelier",
        f"**ellipses**: {100 * ELLIPSE_LEVEL:.0f} % of the truth after {times} s",
        *(["**dashed**: what happened"] if scored else []),
        f"**dots**: the last {PAST_S:g} s",
    ]
    text = "\n".join(f"- {row}" for row in rows)
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
