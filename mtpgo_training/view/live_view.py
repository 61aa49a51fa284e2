# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A live topic: recorded by the node's own ``record``, and followed while it is.

The offline half does not import ROS; it starts ``record`` as a process, as a user would.
"""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from msg_adapters.bags.live.growing_bag import FollowedMessage, GrowingBag
from msg_adapters.inputs.lane_markers import lanes_from_markers
from msg_adapters.predictions import prediction_from_pointcloud2
from msg_adapters.registry import adapter_for_type
from mtpgo_core.errors import ConfigurationError, MessageError, RecordingError
from mtpgo_core.frames import moves_with_vehicle
from mtpgo_core.maps.lane_lines import LaneLines
from mtpgo_training.data.data_sources import DataSource
from mtpgo_training.data.recording_bag import LANES_TOPIC, OBJECTS_TOPIC, PREDICTIONS_TOPIC
from mtpgo_training.processes.child_process import READY_S, ChildProcess, require_ros
from mtpgo_training.view.scene_outputs import prepare_outputs, write_outputs
from mtpgo_training.view.view_scene import identity_texts
from mtpgo_training.view.view_source import ViewOptions, load_scene

if TYPE_CHECKING:
    from mtpgo_training.view.rerun_scene import RerunScene

CONTEXT = (LANES_TOPIC, "/tf", "/tf_static", "/odometry", "/diagnostics")
"""Topics that are recorded as well: lanes, what lifts objects into a fixed frame, the model."""

LONGEST_S = 600.0
"""Time after which a live view ends if none is given (s); chosen: the recording behind it grows by
some 2 MB/s with 64 road users."""

FIRST_S = 30.0
"""Longest wait for the first message (s); chosen: more than discovery takes on a busy machine."""

POLL_S = 0.2
"""Time between two looks at the recording (s); it is written once a second."""


@dataclasses.dataclass(frozen=True)
class LiveTopics:
    """The topics of a live view.

    Attributes:
        objects: tracked objects.
        predictions: predictions.
    """

    objects: str
    predictions: str


def live_topics(topic: str, objects: str, predictions: str | None) -> LiveTopics:
    """Return the topics of a live view by the one given.

    Args:
        topic: of tracked objects, or of predictions if its name ends so.
        objects: of tracked objects as chosen by ``--topic``, empty for the usual one.
        predictions: of predictions, None for the usual one.
    """
    if topic.endswith("predictions"):
        return LiveTopics(objects or OBJECTS_TOPIC, topic)
    return LiveTopics(topic, predictions or PREDICTIONS_TOPIC)


def view_live(
    topic: str,
    source: DataSource,
    options: ViewOptions,
    outputs: Mapping[str, Path],
    seconds: float | None,
) -> int:
    """Show a live topic and return the exit status.

    Args:
        topic: of tracked objects or predictions.
        source: options of its reading.
        options: what of it is shown.
        outputs: name -> file; an empty path for ``rerun`` is its viewer, live.
        seconds: how long to listen from the first message on (s), None for LONGEST_S with
            the viewer of rerun alone.

    Raises:
        ConfigurationError: no output, or one that needs an end, or ROS is not installed.
        RecordingError: nothing came.
        ProcessError: the recorder failed.
    """
    live = outputs.get("rerun") == Path()
    files = {name: path for name, path in outputs.items() if path != Path()}
    if seconds is None and (files or not live):
        what = f"--{next(iter(files))}" if files else "the page"
        raise ConfigurationError(
            f"{topic} is a live topic and {what} needs an end, expected --seconds N, or --rerun "
            "alone"
        )
    require_ros("a live view")
    prepare_outputs(outputs)
    chosen = live_topics(topic, source.options.bags.topic_of(""), options.predictions_topic)
    with tempfile.TemporaryDirectory(prefix="mtpgo_view_") as folder:
        bag = Path(folder) / f"{topic.strip('/').replace('/', '_')}.mcap"
        with _recording(bag, chosen) as recorder:
            listened_s = seconds or LONGEST_S
            _wait_for_first(bag, chosen, recorder)
            print(f"listening for {listened_s:g} s", flush=True)
            end_s = time.monotonic() + listened_s
            if live:
                _show(bag, chosen, recorder, end_s, source.options.lanes)
            else:
                while time.monotonic() < end_s:
                    recorder.check()
                    time.sleep(POLL_S)
        if files or not live:
            bags = dataclasses.replace(source.options.bags, topic=chosen.objects)
            reading = dataclasses.replace(source.options, bags=bags)
            scene = load_scene(DataSource(bag, "bag", None, reading), options)
            for sentence in write_outputs(scene, files or {"html": Path(f"{scene.name}.html")}):
                print(sentence)
    return 0


@contextmanager
def _recording(bag: Path, topics: LiveTopics) -> Iterator[ChildProcess]:
    """Record the topics while the block runs; at its end, nothing recorded is an error."""
    names = [topics.objects, topics.predictions, *CONTEXT]
    arguments = ["-o", str(bag), "--topics", *names]
    with ChildProcess("record", arguments, bag.parent / "record.log", {}) as recorder:
        recorder.wait_for("ready", READY_S)
        print(f"waiting for {topics.objects} and {topics.predictions}", flush=True)
        yield recorder


def _wait_for_first(bag: Path, topics: LiveTopics, recorder: ChildProcess) -> None:
    """Wait until objects or predictions came.

    Raises:
        RecordingError: nothing came within FIRST_S.
    """
    growing, end_s = GrowingBag(bag), time.monotonic() + FIRST_S
    wanted = (topics.objects, topics.predictions)
    while not any(came.topic in wanted for came in growing.new_messages()):
        if time.monotonic() > end_s:
            raise RecordingError(
                f"nothing came on {topics.objects} or {topics.predictions} within {FIRST_S:g} s, "
                "expected a publisher of one of them"
            )
        recorder.check()
        time.sleep(POLL_S)


def _show(
    bag: Path,
    topics: LiveTopics,
    recorder: ChildProcess,
    end_s: float,
    lanes: LaneLines | None,
) -> None:
    """Show what comes in the viewer of rerun, until a time (s, monotonic) or the user ends it."""
    from mtpgo_training.view.rerun_scene import RerunScene

    target = RerunScene(topics.objects, viewer=True, scored=False)
    shown, growing = LiveScene(target, topics, lanes), GrowingBag(bag)
    try:
        while time.monotonic() < end_s:
            recorder.check()
            for came in growing.new_messages():
                shown.add(came)
            time.sleep(POLL_S)
    except KeyboardInterrupt:
        print("ended by the user", flush=True)
    finally:
        target.close()


class LiveScene:
    """Logs messages as they come.

    Args:
        target: where to, a ``RerunScene``.
        topics: of objects and predictions.
        lanes: those of a file, shown in place of the topic's, None for the topic's.
    """

    def __init__(
        self, target: RerunScene, topics: LiveTopics, lanes: LaneLines | None = None
    ) -> None:
        self._target, self._topics, self._lanes = target, topics, lanes
        self._start_ns: int | None = None
        if lanes is not None:
            target.log_lanes(lanes.lines)

    def add(self, came: FollowedMessage) -> None:
        """Show a message; what cannot be read is left out, as in the node."""
        try:
            if came.topic == self._topics.predictions:
                prediction = prediction_from_pointcloud2(came.message)
                self._target.log_prediction(self._since_s(prediction.stamp_ns), prediction)
            elif came.topic == self._topics.objects:
                adapter = adapter_for_type(came.message_type)
                states = adapter.to_states(came.message, fallback_stamp_ns=came.time_ns)
                if not moves_with_vehicle(states.frame_id):
                    names = identity_texts(states.key)
                    self._target.log_states(self._since_s(states.stamp_ns), states, names)
            elif came.topic == LANES_TOPIC and self._lanes is None:
                self._target.log_lanes(lanes_from_markers(came.message).polylines)
        except MessageError:
            return

    def _since_s(self, stamp_ns: int) -> float:
        if self._start_ns is None:
            self._start_ns = stamp_ns
        return (stamp_ns - self._start_ns) * 1e-9
