# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A picture of what is in recordings: where road users go, how many, how fast, what they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from mtpgo_core.schema import AgentClass, Float64Array
from mtpgo_training.atomic_files import replacing
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.summary.data_summary import DataSummary
from mtpgo_training.data.summary.track_steps import TrackSteps
from mtpgo_training.reports.drawn_bodies import CLASS_COLOURS, class_colours
from mtpgo_training.reports.figure_style import STYLE
from mtpgo_training.reports.series import draw_line

MOST_SEGMENTS = 40_000
"""Segments of tracks in the map; chosen, so that the picture is drawn in seconds."""

_SPEEDS_KEPT = 200_000

_BAR = "#2a6fbb"

_LEAST_ROWS = 5
"""Rows for which a panel of bars has room at least; chosen."""


@dataclass
class PictureData:
    """What the picture shows and a summary does not keep.

    Attributes:
        name: recording whose tracks are on the map, the first one.
        segments: [n, 2, 2] parts of its tracks (m).
        colours: [n] their colours.
        speeds: of each recording, speeds of moving road users (m/s).
    """

    name: str = ""
    segments: Float64Array = field(default_factory=lambda: np.zeros((0, 2, 2)))
    colours: list[str] = field(default_factory=list)
    speeds: list[Float64Array] = field(default_factory=list)

    def add(self, recording: Recording) -> None:
        """Take what the picture needs from a recording."""
        steps = TrackSteps.of(recording)
        speed = steps.speed_mps[(steps.speed_mps > 0.5) & (steps.speed_mps < 100.0)]
        if sum(map(len, self.speeds)) < _SPEEDS_KEPT:
            self.speeds.append(speed[:: max(1, len(speed) // 20_000)])
        if self.name:
            return
        self.name = recording.name
        close = np.flatnonzero((steps.dt_s <= 1.0) & (steps.distance_m > 0.0))
        close = close[:: max(1, -(-len(close) // MOST_SEGMENTS))]
        ends = recording.position[np.stack([steps.before[close], steps.after[close]], axis=1)]
        self.segments = ends
        self.colours = class_colours(recording.agent_class[steps.track[close]])

    def merge(self, other: PictureData) -> None:
        """Take in what the picture needs from later recordings."""
        if sum(map(len, self.speeds)) < _SPEEDS_KEPT:
            self.speeds += other.speeds
        if not self.name:
            self.name, self.segments, self.colours = other.name, other.segments, other.colours


def draw_data(summary: DataSummary, data: PictureData, path: Path) -> None:
    """Draw a PNG.

    Args:
        summary: of all recordings.
        data: tracks and speeds.
        path: the file.

    Raises:
        ConfigurationError: it cannot be written.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(11.0, 7.5), layout="constrained")
        panels = figure.subplot_mosaic([["map", "map", "time"], ["map", "map", "speed"],
                                        ["class", "manoeuvre", "defect"]])  # fmt: skip
        _map(panels["map"], data)
        _time(panels["time"], summary)
        panels["speed"].hist(np.concatenate([*data.speeds, np.zeros(0)]), bins=40, color=_BAR)
        panels["speed"].set(
            title="speed of moving road users", xlabel="speed (m/s)", ylabel="steps"
        )
        colours = [CLASS_COLOURS[AgentClass[name.upper()]] for name in summary.classes]
        _bars(
            panels["class"],
            "road users by class, track colours",
            summary.classes,
            colours,
            whole=True,
        )
        shares = {n.replace("_", " "): 100 * v for n, v in summary.manoeuvres.items()}
        _bars(panels["manoeuvre"], "over the next 5 s (%)", shares)
        defects = {item.kind: item.count for item in summary.defects}
        _bars(panels["defect"], "defects", defects, whole=True)
        with replacing(path) as temporary:
            figure.savefig(temporary, format="png", dpi=110)


def _map(axes: Any, data: PictureData) -> None:
    axes.add_collection(
        LineCollection(list(data.segments), colors=data.colours, linewidths=0.6, alpha=0.6)
    )
    axes.autoscale()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(title=f"tracks of recording {data.name}", xlabel="x (m)", ylabel="y (m)")


def _time(axes: Any, summary: DataSummary) -> None:
    for recording in summary.recordings[:12]:
        time, count = recording.agents_over_time.T
        draw_line(axes, time, count, lw=1.2)
    axes.set(title="road users at a time", xlabel="time (s)", ylabel="road users")
    axes.set_ylim(bottom=0.0)


def _bars(
    axes: Any,
    title: str,
    values: Mapping[str, float],
    colours: Sequence[str] = (_BAR,),
    *,
    whole: bool = False,
) -> None:
    """Draw bars by name, of whole numbers only if ``whole``."""
    names: Sequence[str] = list(values)
    axes.set(title=title)
    if not names:
        axes.text(0.0, 0.9, "none", transform=axes.transAxes)
        axes.set_axis_off()
        return
    axes.barh(names, [values[name] for name in names], color=colours)
    if whole:
        axes.locator_params(axis="x", integer=True)
    # From the top; few bars are not wider than many.
    axes.set_ylim(max(len(names), _LEAST_ROWS) - 0.5, -0.5)
