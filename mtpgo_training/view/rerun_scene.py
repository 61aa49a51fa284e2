# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A scene in the viewer of rerun: road users, modes, ellipses, truth and errors over time.

Positions are relative to the first road user seen, because the viewer draws in float32.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from mtpgo_core.class_size import known_sizes
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.quality.metrics import average
from mtpgo_core.schema import Float64Array, Prediction, Source, TrackedStates
from mtpgo_training.atomic_files import replacing
from mtpgo_training.reports.drawn_bodies import class_colours, shown_modes
from mtpgo_training.view.ellipse_rings import ellipse_rings
from mtpgo_training.view.view_colours import FALLBACK_COLOUR, colour_bytes
from mtpgo_training.view.view_scene import TrackWays, ViewScene, ellipse_indices, identity_texts

APPLICATION = "mtpgo view"
HEIGHT_M = 1.5
"""Height of a drawn box (m)."""

_TIMELINE = "time"


class RerunScene:
    """Logs what is seen, to a new viewer or to be written to a file.

    Rerun does not write the file itself: its calls never return once its writer has met a full
    disk.

    Args:
        name: of the bag or topic.
        viewer: open a viewer.

    Raises:
        ConfigurationError: the viewer cannot be started.
    """

    def __init__(self, name: str, *, viewer: bool) -> None:
        self._stream = rr.RecordingStream(f"{APPLICATION}: {name}")
        self._origin: Float64Array | None = None
        blueprint = rrb.Blueprint(
            rrb.Vertical(
                rrb.Spatial3DView(origin="scene", name=name),
                rrb.TimeSeriesView(origin="errors", name="errors (m)"),
                row_shares=[4, 1],
            )
        )
        self._encoded: rr.BinaryStream | None = None
        if not viewer:
            self._encoded = rr.binary_stream(self._stream)
            self._stream.send_blueprint(blueprint)
        else:
            try:
                self._stream.spawn(default_blueprint=blueprint)
            except (RuntimeError, OSError) as error:
                raise ConfigurationError(
                    f"the viewer of rerun cannot be started: {error}"
                ) from error
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

    def log_lanes(self, lanes: tuple[Float64Array, ...]) -> None:
        """Show lane markings: [k, 2] points each (m)."""
        lines = [self._placed(line) for line in lanes if len(line) > 1]
        strips = rr.LineStrips3D(lines, colors=[[150, 155, 160]], radii=[0.06])
        self._stream.log("scene/lanes", strips, static=True)

    def log_states(self, time_s: float, states: TrackedStates, names: list[str]) -> None:
        """Show road users.

        Args:
            time_s: on the time line (s).
            states: what was observed.
            names: [n] their identities as text.
        """
        size = known_sizes(states.size, states.agent_class)
        course = np.arctan2(states.velocity[:, 1], states.velocity[:, 0])
        yaw = np.nan_to_num(np.where(np.isfinite(states.yaw), states.yaw, course))
        centre = self._placed(states.position)
        centre[:, 2] = HEIGHT_M / 2.0
        half = np.concatenate([size, np.full((len(states), 1), HEIGHT_M)], axis=1) / 2.0
        turned = np.zeros((len(states), 4))
        turned[:, 2], turned[:, 3] = np.sin(yaw / 2.0), np.cos(yaw / 2.0)
        self._at(time_s)
        self._stream.log(
            "scene/road_users",
            rr.Boxes3D(
                centers=centre,
                half_sizes=half,
                quaternions=turned,
                colors=[colour_bytes(colour) for colour in class_colours(states.agent_class)],
                labels=names,
                show_labels=False,
                fill_mode="solid",
            ),
        )

    def log_prediction(self, time_s: float, prediction: Prediction) -> None:
        """Show modes and ellipses; the lighter, the less likely."""
        strips: list[Float64Array] = []
        rings: list[Float64Array] = []
        colours: list[list[int]] = []
        ring_colours: list[list[int]] = []
        steps = ellipse_indices(prediction.time_s)
        own = class_colours(prediction.agent_class)
        for agent in range(len(prediction)):
            model = prediction.source[agent] == Source.MODEL
            colour = colour_bytes(own[agent] if model else FALLBACK_COLOUR)
            strongest = float(prediction.weight[agent].max())
            for mode in np.flatnonzero(shown_modes(prediction.weight[agent])).tolist():
                share = float(prediction.weight[agent, mode]) / strongest
                path = self._placed(prediction.mean[agent, mode, :, :2])
                strips.append(path[np.isfinite(path).all(axis=1)])
                colours.append([*colour, round(40 + 215 * share)])
                if share == 1.0:
                    found = ellipse_rings(prediction, agent, mode, steps)
                    rings += [self._placed(np.concatenate([ring, ring[:1]])) for ring in found]
                    ring_colours += [[*colour, 120]] * len(found)
        self._at(time_s)
        self._stream.log(
            "scene/predictions/modes", rr.LineStrips3D(strips, colors=colours, radii=[0.12])
        )
        self._stream.log(
            "scene/predictions/ellipses",
            rr.LineStrips3D(rings, colors=ring_colours, radii=[0.05]),
        )

    def log_truth(self, time_s: float, ways: list[Float64Array]) -> None:
        """Show what happened next: [k, 2] points of each road user (m)."""
        self._at(time_s)
        lines = [self._placed(way) for way in ways if len(way) > 1]
        strips = rr.LineStrips3D(lines, colors=[[250, 250, 250, 160]], radii=[0.05])
        self._stream.log("scene/what_happened", strips)

    def log_error(self, time_s: float, name: str, value: float) -> None:
        """Add a value to a curve (m); what is not known is left out."""
        if np.isfinite(value):
            self._at(time_s)
            self._stream.log(f"errors/{name}", rr.Scalars([value]))

    def _at(self, time_s: float) -> None:
        self._stream.set_time(_TIMELINE, duration=time_s)

    def _placed(self, points: Float64Array) -> Float64Array:
        """[k, 3] points relative to the origin (m)."""
        known = points[np.isfinite(points).all(axis=1)]
        if self._origin is None and len(known):
            self._origin = np.round(known[0])
        origin = np.zeros(2) if self._origin is None else self._origin
        return np.concatenate([points - origin, np.zeros((len(points), 1))], axis=1)


def log_scene(scene: ViewScene, path: Path | None) -> None:
    """Show a scene in a new viewer, or write it to a file.

    Args:
        scene: what is shown.
        path: the file, None to open a viewer.

    Raises:
        ConfigurationError: the file cannot be written, or the viewer not started.
    """
    if path is None:
        _logged(scene, RerunScene(scene.name, viewer=True))
        return
    content = _logged(scene, RerunScene(scene.name, viewer=False))
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def _logged(scene: ViewScene, target: RerunScene) -> bytes:
    """Log a scene; return what :meth:`RerunScene.close` does."""
    recording = scene.recording
    names = identity_texts(recording.key)
    if recording.lanes:
        target.log_lanes(recording.lanes)
    for states in recording.states():
        rows = recording.find_tracks(states.key)
        time_s = scene.since_start_s(states.stamp_ns)
        target.log_states(time_s, states, [names[row] for row in rows.tolist()])
    ways = TrackWays(scene)
    for seen in scene.predictions:
        time_s = scene.since_start_s(seen.prediction.stamp_ns)
        target.log_prediction(time_s, seen.prediction)
        until_s = time_s + scene.horizon_s
        tracks = seen.track[seen.track >= 0].tolist()
        target.log_truth(time_s, [ways.between(t, time_s, until_s) for t in tracks])
        target.log_error(until_s, "ade", average(seen.ade_m))
        target.log_error(until_s, "final", average(seen.final_m))
    return target.close()
