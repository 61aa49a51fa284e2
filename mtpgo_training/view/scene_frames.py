# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A scene drawn frame by frame with matplotlib, for animations."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mtpgo_core.class_size import known_sizes
from mtpgo_core.frames import rotate
from mtpgo_core.quality.metrics import average
from mtpgo_core.schema import Float64Array, Source
from mtpgo_training.reports.drawn_bodies import class_colours, shown_modes
from mtpgo_training.view.ellipse_rings import ellipse_rings
from mtpgo_training.view.view_colours import FALLBACK_COLOUR, GROUND, LANE, ROAD, TEXT
from mtpgo_training.view.view_scene import (
    PAST_S,
    STALE_S,
    SeenPrediction,
    TrackWays,
    ViewScene,
    drawn_yaws,
    ellipse_indices,
    positions_together,
    shown_frames,
)

MARGIN_M, LEAST_M = 8.0, 60.0
"""Margin around the road users, and least width of the picture (m); chosen."""

LOWEST, HIGHEST = 0.42, 0.62
"""Limits of the height of the picture relative to its width; chosen."""

_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
_DPI = 100


class ScenePainter:
    """Draws the instants of a scene.

    Args:
        scene: what is drawn.
        width: of the picture (pixels).

    Attributes:
        times_s: of the frames, at most one in a tenth of a second (s).
    """

    def __init__(self, scene: ViewScene, width: int) -> None:
        self._scene, recording = scene, scene.recording
        self._frames = shown_frames(scene)
        self.times_s = [scene.since_start_s(recording.stamp_ns(int(f))) for f in self._frames]
        together = positions_together(recording.position)
        self._angle = _turn(recording.position[together])
        self._ways = TrackWays(scene)
        self._position = rotate(recording.position, -self._angle)
        self._yaw = drawn_yaws(recording) - self._angle
        self._size = known_sizes(recording.size, recording.agent_class)
        self._colour = np.array([to_rgba(c) for c in class_colours(recording.agent_class)])
        self._stamps = np.array([p.prediction.stamp_ns for p in scene.predictions], dtype=np.int64)
        lower, upper = _window(self._position[together])
        span = upper - lower
        height = int(width * span[1] / span[0]) // 2 * 2  # films need even numbers
        self._figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=GROUND)
        self._canvas = FigureCanvasAgg(self._figure)
        axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), aspect="equal")
        axes.set_axis_off()
        pixel_m = span[0] / width
        # Without lanes, the ways of all road users show where the road is.
        ground = [rotate(line, -self._angle) for line in recording.lanes or self._ways.all()]
        road_points = 1.0 if recording.lanes else 3.0 / pixel_m * 72 / _DPI
        axes.add_collection(
            LineCollection(
                ground,
                colors=LANE if recording.lanes else ROAD,
                linewidths=road_points,
                capstyle="round",
                zorder=1,
            )
        )
        self._ellipses: Any = axes.add_collection(PolyCollection([], linewidths=0.5, zorder=2))
        self._past: Any = axes.add_collection(LineCollection([], linewidths=1.2, zorder=3))
        self._modes: Any = axes.add_collection(LineCollection([], capstyle="round", zorder=4))
        self._truth: Any = axes.add_collection(
            LineCollection(
                [], colors=TEXT, alpha=0.6, linewidths=0.9, linestyles=[(0, (2.5, 2))], zorder=5
            )
        )
        self._bodies: Any = axes.add_collection(
            PolyCollection([], edgecolors=GROUND, linewidths=0.6, zorder=6)
        )
        style: dict[str, Any] = {
            "transform": axes.transAxes,
            "fontsize": 9,
            "color": TEXT,
            "va": "top",
            "zorder": 7,
        }
        left = f"{scene.name}, model {scene.model}" if scene.model else scene.name
        axes.text(0.012, 0.975, left, **style)
        self._text = axes.text(0.988, 0.975, "", ha="right", **style)
        self._draw_scale(axes, lower, span)

    def pictures(self) -> Iterator[NDArray[np.uint8]]:
        """Yield [height, width, 3] the frames, one after the other."""
        with mpl.rc_context({"font.family": "DejaVu Sans"}):
            for number, frame in enumerate(self._frames.tolist()):
                self._update(frame, self.times_s[number])
                self._canvas.draw()
                yield np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _draw_scale(self, axes: Any, lower: Float64Array, span: Float64Array) -> None:
        length = 10.0 if span[0] < 130.0 else 20.0 if span[0] < 300.0 else 50.0
        x, y = lower[0] + 0.988 * span[0] - length, lower[1] + 0.014 * span[0]
        axes.plot([x, x + length], [y, y], color=TEXT, lw=1.8, solid_capstyle="butt")
        axes.text(
            x + length / 2,
            y + 0.005 * span[0],
            f"{length:.0f} m",
            ha="center",
            va="bottom",
            fontsize=8,
            color=TEXT,
        )

    def _update(self, frame: int, time_s: float) -> None:
        recording = self._scene.recording
        first, last = np.searchsorted(recording.frame, [frame, frame + 1])
        rows = np.arange(first, last)
        track = recording.track[rows]
        self._draw_bodies(rows, track)
        ahead_s = self._scene.horizon_s or 5.0
        self._past.set_segments([self._way(t, time_s - PAST_S, time_s) for t in track.tolist()])
        self._past.set_color(self._colour[track] * (1.0, 1.0, 1.0, 0.5))
        self._truth.set_segments([self._way(t, time_s, time_s + ahead_s) for t in track.tolist()])
        self._draw_modes(rows, track, recording.stamp_ns(frame))
        self._text.set_text(f"{time_s:4.1f} s" + self._error(recording.stamp_ns(frame)))

    def _draw_bodies(self, rows: NDArray[np.int64], track: NDArray[np.int64]) -> None:
        turned = rotate(_CORNERS * self._size[track][:, None], self._yaw[rows][:, None])
        self._bodies.set_verts(turned + self._position[rows][:, None])
        self._bodies.set_facecolor(self._colour[track])

    def _way(self, track: int, from_s: float, to_s: float) -> Float64Array:
        """Return [k, 2] where a track was between two times, in the axes of the picture."""
        return rotate(self._ways.between(track, from_s, to_s), -self._angle)

    def _latest(self, stamp_ns: int) -> SeenPrediction | None:
        place = int(np.searchsorted(self._stamps, stamp_ns, side="right")) - 1
        if place < 0 or stamp_ns - self._stamps[place] > STALE_S * 1e9:
            return None
        return self._scene.predictions[place]

    def _draw_modes(
        self, rows: NDArray[np.int64], track: NDArray[np.int64], stamp_ns: int
    ) -> None:
        seen = self._latest(stamp_ns)
        segments: list[Float64Array] = []
        colours: list[Float64Array] = []
        widths: list[float] = []
        rings: list[Float64Array] = []
        faces: list[Float64Array] = []
        if seen is not None:
            p, age_s = seen.prediction, (stamp_ns - seen.prediction.stamp_ns) * 1e-9
            later = p.time_s > age_s
            place = dict(zip(track.tolist(), self._position[rows], strict=True))
            for agent in np.flatnonzero(np.isin(seen.track, track)).tolist():
                colour = self._colour[seen.track[agent]]
                if p.source[agent] != Source.MODEL:
                    colour = np.array(to_rgba(FALLBACK_COLOUR))
                heaviest = float(p.weight[agent].max())
                order = np.argsort(p.weight[agent])
                for mode in order[shown_modes(p.weight[agent, order])].tolist():
                    share = float(p.weight[agent, mode]) / heaviest
                    path = rotate(p.mean[agent, mode, later, :2], -self._angle)
                    segments.append(np.concatenate([place[seen.track[agent]][None], path]))
                    colours.append(colour * (1.0, 1.0, 1.0, 0.08 + 0.82 * share**1.5))
                    widths.append(0.7 + 0.9 * share)
                    if share == 1.0:
                        steps = [k for k in ellipse_indices(p.time_s).tolist() if later[k]]
                        found = ellipse_rings(p, agent, mode, np.array(steps, dtype=np.int64))
                        rings += [rotate(ring, -self._angle) for ring in found]
                        faces += [colour] * (len(rings) - len(faces))
        self._modes.set(segments=segments, colors=colours, linewidths=widths or [1.0])
        self._ellipses.set_verts(rings)
        face = np.array(faces).reshape(-1, 4)
        self._ellipses.set_facecolor(face * (1.0, 1.0, 1.0, 0.1))
        self._ellipses.set_edgecolor(face * (1.0, 1.0, 1.0, 0.4))

    def _error(self, stamp_ns: int) -> str:
        """Return the error of the predictions of one horizon ago as text."""
        seen = self._latest(stamp_ns - round(1e9 * self._scene.horizon_s))
        if seen is None or not np.isfinite(seen.final_m).any():
            return ""
        horizon_s = self._scene.horizon_s
        return (
            f" | error of the predictions of {horizon_s:.0f} s ago {average(seen.final_m):.1f} m"
        )


def _turn(position: Float64Array) -> float:
    """Return the direction of the longest extent of all positions (rad), 0 without a clear one."""
    spread = np.cov(position[np.isfinite(position).all(axis=1)].T)
    if spread.ndim < 2 or not np.isfinite(spread).all():
        return 0.0
    value, vector = np.linalg.eigh(spread)
    if value[0] > 0.5 * value[1]:
        return 0.0
    angle = float(np.arctan2(vector[1, 1], vector[0, 1]))
    return (angle + np.pi / 2.0) % np.pi - np.pi / 2.0


def _window(position: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return the corners of the picture (m)."""
    lower, upper = np.nanquantile(position, [0.01, 0.99], axis=0)
    middle, span = (lower + upper) / 2.0, upper - lower + 2.0 * MARGIN_M
    width = max(LEAST_M, float(span[0]), float(span[1]) / HIGHEST)
    height = float(np.clip(span[1], LOWEST * width, HIGHEST * width))
    half = np.array([width, height]) / 2.0
    return middle - half, middle + half
