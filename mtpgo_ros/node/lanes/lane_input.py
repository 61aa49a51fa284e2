# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines for a model that uses them, from a file or a topic. No ROS in here.

The lines keep their own frame. The model gets them as seen from the frame of the observations,
which is known from the first observation on; TF may connect the two and is asked again each
second.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable

from mtpgo_core.errors import FrameError, MtpgoError
from mtpgo_core.frames import Pose2
from mtpgo_core.maps.lane_file import read_lane_file
from mtpgo_core.scene.lane_fit import LaneFit
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import TrackedStates
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

LOOK_EVERY_S = 1.0
"""Time between two looks at the frames and at whether the lines fit the traffic (s); chosen."""

PoseIn = Callable[[str, str], Pose2]
"""Returns the present pose of the second frame in the first; raises FrameError without one."""

_NONE = LaneMap(())
_TOPIC = "lane_markings"

_TOPIC_WANTED = ("", "", "", "", "")
"""What determines the lines where they come from the topic."""


def _given(parameters: PredictorParameters) -> tuple[str, ...]:
    """Return what determines the lines of the file, nothing without one.

    Besides the parameters it is when the file was changed and how long it is, so that a file that
    is set once more after a change is read once more.
    """
    if not parameters.lane_file:
        return _TOPIC_WANTED
    try:
        found = os.stat(parameters.lane_file)
        state = f"{found.st_mtime_ns} {found.st_size}"
    except (OSError, ValueError):  # reading it says why
        state = ""
    return (
        parameters.lane_file,
        parameters.lane_projection,
        parameters.lane_origin,
        parameters.lane_offset,
        state,
    )


def no_pose(lane_frame: str, frame_id: str) -> Pose2:
    """Raise the error of a node without TF."""
    raise FrameError(
        f"TF has no transform from {frame_id!r} to {lane_frame!r}: tf2_ros is not installed"
    )


class LaneInput:
    """Holds the lane lines and places them into the frame of the observations; thread-safe.

    Args:
        place: gives lines in the observations' frame to the model.
        clock: monotonic time (s).

    Attributes:
        pose_in: asks TF.
        on_read: called with a sentence, and whether it is an error, when a file was read while
            the node runs.
    """

    def __init__(
        self, place: Callable[[LaneMap], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.pose_in: PoseIn = no_pose
        self.on_read: Callable[[str, bool], None] = lambda sentence, is_error: None
        self._place, self._clock = place, clock
        self._lock = threading.Lock()
        self._wanted: tuple[str, ...] = _TOPIC_WANTED
        self._used: tuple[str, ...] = _TOPIC_WANTED  # of which the lines are, see _given
        self._file_frame = ""  # of the lines of the wanted file
        self._reader: threading.Thread | None = None
        self._lines, self._lane_frame, self._called = _NONE, "", ""
        self._placed: LaneMap | None = None
        self._frame_id: str | None = None
        self._problem = self._not_read = ""
        self._fit = LaneFit()
        self._looked_s = float("-inf")

    @property
    def from_topic(self) -> bool:
        """Whether the lines come from the topic, for want of a file."""
        return not self._wanted[0]

    def read(self, parameters: PredictorParameters) -> str:
        """Read the file of the parameters if they name one, and return what was read.

        Raises:
            ConfigurationError: the file cannot be used.
        """
        self._wanted, self._file_frame = _given(parameters), parameters.lane_frame
        if not parameters.lane_file:
            return ""
        found = read_lane_file(parameters.lane_file, parameters.lane_options)
        lanes = LaneMap(found.lines)
        self._take(lanes, None, parameters.lane_file, self._wanted)
        return found.sentence

    def configure(self, parameters: PredictorParameters) -> None:
        """Read another file, or one that has changed, in a thread of its own.

        The lines stay until that has succeeded.
        """
        wanted = _given(parameters)
        with self._lock:
            # A file that is deleted after it was read is still in use.
            same = self._wanted == wanted or (*self._wanted[:-1], "") == wanted
            self._wanted = self._wanted if same else wanted
            self._file_frame = parameters.lane_frame
            if same:
                # Earlier lines, while the file is read or where it cannot be, keep their frame.
                of_file = parameters.lane_file and self._used == self._wanted
                if of_file and self._lane_frame != parameters.lane_frame:
                    self._lane_frame, self._looked_s = parameters.lane_frame, float("-inf")
                return
        if not parameters.lane_file:
            self._take(_NONE, "", "", _TOPIC_WANTED)
            return
        self._reader = threading.Thread(
            target=self._read_again, args=(parameters, wanted), name="lane file", daemon=True
        )
        self._reader.start()

    def _read_again(self, parameters: PredictorParameters, wanted: tuple[str, ...]) -> None:
        try:
            found = read_lane_file(parameters.lane_file, parameters.lane_options)
            lanes = LaneMap(found.lines)
        except MtpgoError as error:
            sentence, lanes = f"lane_file is not used: {error}", None
        except Exception as error:  # Whatever a file contains, the node keeps running.
            sentence, lanes = f"lane_file is not used: {type(error).__name__}: {error}", None
        else:
            sentence = f"lane file: {found.sentence}"
        if lanes is not None:
            used = self._take(lanes, None, parameters.lane_file, wanted)
        else:
            with self._lock:
                used = self._wanted == wanted
                if used:
                    self._not_read = sentence
        if used:
            self.on_read(sentence, lanes is None)

    def take_markings(self, lanes: LaneMap, frame_id: str) -> None:
        """Use the lines of a message on the topic ``lane_markings``, unless a file is wanted."""
        self._take(lanes, frame_id, _TOPIC, _TOPIC_WANTED)

    def refuse_markings(self, sentence: str) -> None:
        """Note that a message on that topic is not used: earlier lines stay."""
        with self._lock:
            self._not_read = sentence

    def continue_with(self, other: LaneInput) -> None:
        """Use the lines of another input, none if it has none."""
        self._wanted, self._file_frame = other._wanted, other._file_frame
        self._take(other._lines, other._lane_frame, other._called, other._wanted)

    def _take(
        self, lanes: LaneMap, lane_frame: str | None, called: str, wanted: tuple[str, ...]
    ) -> bool:
        """Use lines; return false if others are wanted by now, as after a slow reading.

        Args:
            lanes: the lines.
            lane_frame: their frame; None for that of the wanted file, which may change meanwhile.
            called: where they come from.
            wanted: of which they are, see :func:`_given`.
        """
        with self._lock:
            if self._wanted != wanted:
                return False
            self._used = wanted
            lane_frame = self._file_frame if lane_frame is None else lane_frame
            self._lines, self._lane_frame, self._called = lanes, lane_frame, called
            self._placed, self._problem, self._not_read = None, "", ""
            self._fit, self._looked_s = LaneFit(), float("-inf")
            if not called:
                self._place(_NONE)
            elif not lane_frame or lane_frame == self._frame_id:
                self._put(lanes)
            return True

    def observe(self, states: TrackedStates) -> None:
        """Place the lines into the frame of an observation, and compare them with it."""
        now_s = self._clock()
        with self._lock:
            if not len(states):
                return
            if not self._called:
                self._frame_id = states.frame_id
                return
            if states.frame_id == self._frame_id and now_s - self._looked_s < LOOK_EVERY_S:
                return
            if states.frame_id != self._frame_id:
                self._fit = LaneFit()
            self._frame_id, self._looked_s = states.frame_id, now_s
            try:
                self._put(self._seen_from(states.frame_id))
                self._problem = ""
            except FrameError as error:
                if self._placed is not None:
                    self._placed = None
                    self._place(_NONE)
                self._problem = f"{self._called}: {error}"
                return
            assert self._placed is not None
            self._fit.look(self._placed, states.position, states.velocity, states.agent_class)

    def _seen_from(self, frame_id: str) -> LaneMap:
        if not self._lane_frame or self._lane_frame == frame_id:
            return self._lines
        return self._lines.seen_from(self.pose_in(self._lane_frame, frame_id))

    def _put(self, lanes: LaneMap) -> None:
        if lanes is not self._placed:
            self._placed = lanes
            self._place(lanes)

    def limitations(self) -> list[str]:
        """Return why the model has no lines, or not the right ones."""
        found = [self._not_read] if self._not_read else []
        if not self._called:
            if not self._wanted[0] and not found:
                found.append("the model wants lanes, but nothing has come on lane_markings")
            elif not found:
                found.append(f"{self._wanted[0]} is being read")
        elif self._problem:
            found.append(f"the lanes are not used: {self._problem}")
        elif not len(self._lines):
            found.append(f"there is no lane line in {self._called}")
        elif self._fit.problem:
            where = "lane_projection, lane_origin, lane_offset or lane_frame"
            what = "frame of lane_markings" if self._called == _TOPIC else where
            found.append(f"{self._called}: {self._fit.problem}, expected another {what}")
        return found

    def values(self) -> dict[str, str]:
        """Return values for the diagnostics."""
        if not self._called:
            return {}
        return {"lanes": self._called, "lane_segments": str(len(self._lines)), **self._fit.values}
