# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions from a bag, one message after the other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msg_adapters.conversions import stamp_to_ns
from msg_adapters.predictions.prediction_cloud import REQUIRED_FIELDS, prediction_from_pointcloud2
from mtpgo_core.errors import MessageError, RecordingError, found_names
from mtpgo_core.schema import Prediction

if TYPE_CHECKING:
    from msg_adapters.bags.bag_reader import DecodingBagReader

_CLOUD = "sensor_msgs/msg/PointCloud2"


class NoPredictionsError(RecordingError):
    """A bag without predictions."""


def predictions_in_bag(
    path: Path | str, topic: str | None = None, *, span_ns: tuple[int, int] | None = None
) -> Iterator[Prediction]:
    """Yield the predictions in a bag in the order in which they were recorded.

    Single messages that cannot be read are left out, with a warning that counts them.

    Args:
        path: a rosbag2 directory, or an ``.mcap``, ``.db3`` or ``.bag`` file; one that is cut off
            is read as far as it goes.
        topic: their topic; by default the one that holds predictions.
        span_ns: first and last stamp of those wanted (ns), None for all.

    Raises:
        NoPredictionsError: it holds no predictions.
        RecordingError: it is not a bag, it is damaged, or none of the messages can be read.
    """
    from msg_adapters.bags.bag_loss import counted
    from msg_adapters.bags.bag_reader import DecodingBagReader
    from msg_adapters.bags.stored_bag import tell_once

    read, refused, problem = 0, 0, ""
    with DecodingBagReader(Path(path)) as reader:
        for connection, _, message in reader.messages(_prediction_topic(reader, topic)):
            try:
                stamp_ns = stamp_to_ns(message.header.stamp)
                if span_ns is not None and not span_ns[0] <= stamp_ns <= span_ns[1]:
                    continue
                prediction = prediction_from_pointcloud2(message)
            except MessageError as error:
                refused += 1
                problem = problem or f"{path}, topic {connection.topic}: {error}"
                continue
            read += 1
            yield prediction
    if refused and not read:
        raise RecordingError(problem)
    if refused:
        tell_once(f"{problem}; {counted(refused)} of the predictions left out")


def _prediction_topic(reader: DecodingBagReader, topic: str | None) -> list[Any]:
    """Return the connections of the topic of predictions."""
    from msg_adapters.bags.bag_definitions import obstacle

    clouds = [
        c for c in reader.connections if c.msgtype == _CLOUD and c.msgcount and not obstacle(c)
    ]
    if topic is not None:
        chosen = [c for c in clouds if c.topic == "/" + topic.lstrip("/")]
        expected = f"a {_CLOUD} on the topic {topic}"
    else:
        names = {c.topic for c in clouds if _holds_predictions(reader, c)}
        if len(names) > 1:
            raise RecordingError(
                f"{reader.path} has predictions on the topics {found_names(sorted(names))}, "
                "expected the choice of one (mtpgo view: --predictions, mtpgo evaluate: --topic)"
            )
        chosen = [c for c in clouds if c.topic in names]
        expected = f"a {_CLOUD} with the fields of predictions, as the node publishes them"
    if not chosen:
        topics = sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})
        raise NoPredictionsError(
            f"{reader.path} has no predictions, it has "
            f"{found_names(topics, none='no topic')}; expected {expected}"
        )
    return chosen


def _holds_predictions(reader: DecodingBagReader, connection: Any) -> bool:
    for _, _, message in reader.messages([connection]):
        return set(REQUIRED_FIELDS) <= {field.name for field in message.fields}
    return False
