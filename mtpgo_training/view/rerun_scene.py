# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A scene in the viewer of rerun: road users, modes, ellipses, truth and errors over time.

Positions are relative to the first road user seen, because the viewer draws in float32.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import rerun as rr

from mtpgo_core.class_size import known_sizes
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.quality.metrics import average
from mtpgo_core.schema import AgentClass, Float64Array, Prediction, Source, TrackedStates
from mtpgo_training.atomic_files import replacing
from mtpgo_training.reports.drawn_bodies import CLASS_COLOURS, class_colours, shown_modes
from mtpgo_training.view.ellipse_rings import ellipse_rings
from mtpgo_training.view.rerun_blueprint import PAST, legend, scene_blueprint
from mtpgo_training.view.view_colours import FALLBACK_COLOUR, LANE, TEXT, colour_bytes, faded
from mtpgo_training.view.view_scene import (
    STALE_S,
    SeenPrediction,
    TrackWays,
    ViewScene,
    ellipse_indices,
    identity_texts,
    positions_together,
)

APPLICATION = "mtpgo view"
HEIGHT_M = 1.5
"""Height of a drawn box (m)."""

MODE, TRUTH, LINE, DOT = 1.3, 0.7, 0.6, 1.0
"""Half the width of the heaviest mode, of what happened and of other lines, and radius of a past
position: in points on the screen, as a pedestrian has other metres than a motorway."""

DASH_M = 1.0
"""Least length of a dash, and of the gap behind it (m); chosen: a pedestrian's way has some."""

CURVES = (CLASS_COLOURS[AgentClass.VAN], CLASS_COLOURS[AgentClass.TRUCK])
"""Colours of the curves of errors; chosen: those that are seen on the viewer's dark ground."""

_TIMELINE = "time"


class RerunScene:
    """Logs what is seen, to a new viewer or to be written to a file.

    Rerun does not write the file itself: its calls never return once its writer has met a full
    disk.

    Args:
        name: of the bag or topic.
        viewer: open a viewer.
        scored: errors over time will be logged.

    Raises:
        ConfigurationError: the viewer cannot be started.
    """

    def __init__(self, name: str, *, viewer: bool, scored: bool) -> None:
        # Rerun takes no slashes, which topics have.
        self._stream = rr.RecordingStream(f"{APPLICATION}: {name.strip('/').replace('/', ' ')}")
        self._name, self._scored = name, scored
        self._origin: Float64Array | None = None
        self._looks = False
        self._classes: set[AgentClass] = set()
        self._predicted_s: float | None = None
        self._known_s: dict[str, float] = {}  # time of the last value of each curve
        self._encoded: rr.BinaryStream | None = None
        if not viewer:
            self._encoded = rr.binary_stream(self._stream)
        else:
            try:
                self._stream.spawn(hide_welcome_screen=True)
            except (RuntimeError, OSError) as error:
                raise ConfigurationError(
                    f"the viewer of rerun cannot be started: {error}"
                ) from error
        self._stream.send_recording_name(name)
        self._stream.log("scene", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def close(self) -> bytes:
        """Send what is left; return the content of the file, nothing with a viewer.

        Raises:
            ConfigurationError: not all of it could be encoded or sent.
        """
        try:
            if self._encoded is None:
                self._stream.flush()
                return b""
            # At once: every read ends with an index of its own, and a file has one.
            return self._encoded.read() or b""
        except (RuntimeError, ValueError) as error:
            raise ConfigurationError(
                f"rerun could not write, or send to its viewer, what is shown: {error}"
            ) from error
        finally:
            self._stream.disconnect()

    def look_at(self, position: Float64Array) -> None:
        """Let the viewer show the place of most of [k, 2] positions (m), from above."""
        known = position[np.isfinite(position).all(axis=1)]
        if len(known):
            placed = self._placed(known[positions_together(known)])
            self._stream.send_blueprint(scene_blueprint(self._name, placed, self._scored))
            self._looks = True

    def log_lanes(self, lanes: tuple[Float64Array, ...]) -> None:
        """Show lane markings: [k, 2] points each (m)."""
        lines = [self._placed(line) for line in lanes if len(line) > 1]
        strips = rr.LineStrips3D(
            lines, colors=[colour_bytes(LANE)], radii=rr.Radius.ui_points(LINE)
        )
        self._stream.log("scene/lanes", strips, static=True)

    def log_states(self, time_s: float, states: TrackedStates, names: list[str]) -> None:
        """Show road users, and predictions no longer if none came for ``STALE_S``.

        Args:
            time_s: on the time line (s).
            states: what was observed.
            names: [n] their identities as text.
        """
        if not self._looks:
            self.look_at(states.position)
        self._at(time_s)
        if self._predicted_s is not None and time_s - self._predicted_s > STALE_S:
            self._predicted_s = None
            for entity in ("predictions", "what_happened"):
                self._stream.log(f"scene/{entity}", rr.Clear(recursive=True))
        size = known_sizes(states.size, states.agent_class)
        course = np.arctan2(states.velocity[:, 1], states.velocity[:, 0])
        yaw = np.nan_to_num(np.where(np.isfinite(states.yaw), states.yaw, course))
        centre = self._placed(states.position)
        colours = np.array([colour_bytes(c) for c in class_colours(states.agent_class)])
        past = rr.Points3D(
            centre, colors=faded(colours.reshape(-1, 3), 0.5), radii=rr.Radius.ui_points(DOT)
        )
        self._stream.log(PAST, past)
        centre[:, 2] = HEIGHT_M / 2.0
        half = np.concatenate([size, np.full((len(states), 1), HEIGHT_M)], axis=1) / 2.0
        turned = np.zeros((len(states), 4))
        turned[:, 2], turned[:, 3] = np.sin(yaw / 2.0), np.cos(yaw / 2.0)
        kinds = [AgentClass.from_code(code) for code in states.agent_class.tolist()]
        self._show_classes(set(kinds))
        # An entity for each class, whose names and switches the viewer shows.
        for kind in self._classes:
            rows = [row for row, own in enumerate(kinds) if own == kind]
            boxes = rr.Boxes3D(
                centers=centre[rows],
                half_sizes=half[rows],
                quaternions=turned[rows],
                colors=[colour_bytes(CLASS_COLOURS[kind])],
                labels=[f"{names[row]}, {kind.name.lower()}" for row in rows],
                show_labels=False,
                fill_mode="solid",
            )
            self._stream.log(f"scene/road_users/{kind.name.lower()}", boxes)

    def log_prediction(self, time_s: float, prediction: Prediction) -> None:
        """Show modes and ellipses; the lighter and thinner a mode, the less likely it is."""
        if not self._looks:
            self.look_at(prediction.mean[..., :2].reshape(-1, 2))
        strips: list[Float64Array] = []
        rings: list[Float64Array] = []
        shares: list[float] = []
        colours: list[list[int]] = []
        ring_colours: list[list[int]] = []
        steps = ellipse_indices(prediction.time_s)
        own = class_colours(prediction.agent_class)
        for agent in range(len(prediction)):
            model = prediction.source[agent] == Source.MODEL
            colour = colour_bytes(own[agent] if model else FALLBACK_COLOUR)
            heaviest = float(prediction.weight[agent].max())
            for mode in np.flatnonzero(shown_modes(prediction.weight[agent])).tolist():
                share = float(prediction.weight[agent, mode]) / heaviest
                # The likelier, the higher: in front of the others.
                path = self._placed(prediction.mean[agent, mode, :, :2], 0.1 + 0.1 * share)
                strips.append(path[np.isfinite(path).all(axis=1)])
                shares.append(share)
                colours.append(colour)
                if share == 1.0:
                    found = ellipse_rings(prediction, agent, mode, steps)
                    rings += [self._placed(np.concatenate([ring, ring[:1]])) for ring in found]
                    ring_colours += [colour] * len(found)
        share_of = np.array(shares)
        modes = rr.LineStrips3D(
            strips,
            colors=faded(np.array(colours).reshape(-1, 3), 0.2 + 0.8 * share_of),
            radii=rr.Radius.ui_points(MODE * (0.4 + 0.6 * share_of)),
        )
        ellipses = rr.LineStrips3D(
            rings,
            colors=faded(np.array(ring_colours).reshape(-1, 3), 0.6),
            radii=rr.Radius.ui_points(LINE),
        )
        self._at(time_s)
        self._predicted_s = time_s
        self._stream.log("scene/predictions/modes", modes)
        self._stream.log("scene/predictions/ellipses", ellipses)

    def log_truth(self, time_s: float, ways: list[Float64Array]) -> None:
        """Show what happened next, dashed: [k, 2] points of each road user (m)."""
        placed = [self._placed(way, 0.3) for way in ways if len(way) > 1]
        dashes = [dash for way in placed for dash in _dashes(way)]
        strips = rr.LineStrips3D(
            dashes, colors=[colour_bytes(TEXT)], radii=rr.Radius.ui_points(TRUTH)
        )
        self._at(time_s)
        self._stream.log("scene/what_happened", strips)

    def name_errors(self, names: Mapping[str, str]) -> None:
        """Name two curves of errors: name in :meth:`log_error` -> text in the viewer."""
        for (name, text), colour in zip(names.items(), CURVES, strict=True):
            line = rr.SeriesLines(names=[text], colors=[colour_bytes(colour)])
            self._stream.log(f"errors/{name}", line, static=True)

    def log_error(self, time_s: float, name: str, value: float) -> None:
        """Add a value to a curve (m); what is not known is left out.

        A curve does not lead over a time without values: it ends ``STALE_S`` after the last one.
        """
        if not np.isfinite(value):
            return
        ended_s = self._known_s.get(name, time_s) + STALE_S
        if time_s > ended_s:
            self._at(ended_s)
            self._stream.log(f"errors/{name}", rr.Scalars([]))  # which ends a line of rerun
        self._known_s[name] = time_s
        self._at(time_s)
        self._stream.log(f"errors/{name}", rr.Scalars([value]))

    def _show_classes(self, kinds: set[AgentClass]) -> None:
        """Show what the colours mean, if there are other classes than before."""
        if kinds <= self._classes:
            return
        self._classes |= kinds
        self._stream.log("legend", legend(self._classes, self._scored), static=True)

    def _at(self, time_s: float) -> None:
        self._stream.set_time(_TIMELINE, duration=time_s)

    def _placed(self, points: Float64Array, height_m: float = 0.0) -> Float64Array:
        """[k, 3] points relative to the origin (m)."""
        known = points[np.isfinite(points).all(axis=1)]
        if self._origin is None and len(known):
            self._origin = np.round(known[0])
        origin = np.zeros(2) if self._origin is None else self._origin
        return np.concatenate([points - origin, np.full((len(points), 1), height_m)], axis=1)


def log_scene(scene: ViewScene, path: Path | None) -> None:
    """Show a scene in a new viewer, or write it to a file.

    Args:
        scene: what is shown.
        path: the file, None to open a viewer.

    Raises:
        ConfigurationError: the file cannot be written, or the viewer not started.
    """
    if path is None:
        _logged(scene, RerunScene(scene.name, viewer=True, scored=True))
        return
    content = _logged(scene, RerunScene(scene.name, viewer=False, scored=True))
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def _logged(scene: ViewScene, target: RerunScene) -> bytes:
    """Log a scene in the order of time; return what :meth:`RerunScene.close` does."""
    recording = scene.recording
    names = identity_texts(recording.key)
    target.look_at(recording.position)
    target.name_errors({"ade": "ADE", "final": f"error at {scene.horizon_s:.0f} s"})
    if recording.lanes:
        target.log_lanes(recording.lanes)
    ways = TrackWays(scene)
    end_s = scene.since_start_s(recording.span_ns[1])
    later = list(scene.predictions)
    for states in recording.states():
        rows = recording.find_tracks(states.key)
        time_s = scene.since_start_s(states.stamp_ns)
        while later and later[0].prediction.stamp_ns < states.stamp_ns:
            _log_seen(scene, later.pop(0), ways, end_s, target)
        target.log_states(time_s, states, [names[row] for row in rows.tolist()])
    for seen in later:
        _log_seen(scene, seen, ways, end_s, target)
    return target.close()


def _log_seen(
    scene: ViewScene, seen: SeenPrediction, ways: TrackWays, end_s: float, target: RerunScene
) -> None:
    """Log a prediction, what happened, and its errors if they were known before the end."""
    time_s = scene.since_start_s(seen.prediction.stamp_ns)
    until_s = time_s + scene.horizon_s
    target.log_prediction(time_s, seen.prediction)
    tracks = seen.track[seen.track >= 0].tolist()
    target.log_truth(time_s, [ways.between(t, time_s, until_s) for t in tracks])
    if until_s <= end_s + 1e-3:
        target.log_error(until_s, "ade", average(seen.ade_m))
        target.log_error(until_s, "final", average(seen.final_m))


def _dashes(way: Float64Array) -> list[Float64Array]:
    """Return every second piece of [k, 3] a way (m), of ``DASH_M`` on the average or more."""
    mean_m = float(np.linalg.norm(np.diff(way, axis=0), axis=1).mean())
    steps = int(np.clip(np.ceil(DASH_M / max(mean_m, 1e-6)), 1, len(way) - 1))
    return [way[i : i + steps + 1] for i in range(0, len(way) - 1, 2 * steps)]
