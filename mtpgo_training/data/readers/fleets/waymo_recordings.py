# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Waymo Open Motion: scenarios of 9 s (or 20 s) at 10 Hz in TFRecord files.

A TFRecord file is a chain of records: length (8 bytes), its check sum (4), content, its check sum
(4). The check sums are CRC-32C, masked. Each content is a message ``Scenario`` of protocol
buffers, of which the fields below are read. Positions are metres with y up in a frame of the
scenario's own; the recording vehicle is the track with the number of ``sdc_track_index``.
"""

from __future__ import annotations

import functools
import hashlib
import re
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mtpgo_core.class_map import ClassMap
from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.readers.drone_files import select_names
from mtpgo_training.data.readers.file_groups import grouped_files
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.track_rows import TableSource, recording_of_rows, with_ego
from mtpgo_training.data.recording import Recording

_HEAD = struct.Struct("<QI")
"""Length of a record's content, and its check sum."""

_CHECKSUM = struct.Struct("<I")

_FILES = re.compile(r"(?P<name>.*tfrecord.*)", re.IGNORECASE)

MESSAGES: dict[str, dict[str, tuple[int, str]]] = {
    "Scenario": {
        "timestamps_seconds": (1, "repeated double"),
        "tracks": (2, "repeated Track"),
        "scenario_id": (5, "string"),
        "sdc_track_index": (6, "int32"),
    },
    "Track": {
        "id": (1, "int32"),
        "object_type": (2, "int32"),
        "states": (3, "repeated ObjectState"),
    },
    "ObjectState": {
        "center_x": (2, "double"),
        "center_y": (3, "double"),
        "length": (5, "float"),
        "width": (6, "float"),
        "heading": (8, "float"),
        "velocity_x": (9, "float"),
        "velocity_y": (10, "float"),
        "valid": (11, "bool"),
    },
}
"""Messages -> fields that are read -> number and type on the wire; an enumeration is an int32."""


def waymo_units(
    directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    """Return the TFRecord files below a directory; each holds several scenarios.

    Args:
        directory: a directory with files whose name has ``tfrecord`` in it, or one such file.
        names: names of the files wanted.
        options: the class map.

    Raises:
        RecordingError: there are none.
    """
    found = grouped_files(directory, _FILES, "Waymo's .tfrecord files of scenarios")
    classes = options.classes_or("waymo")
    return [
        Unit(name, "waymo", (path,), functools.partial(_read, name, path, classes))
        for name in select_names(list(found), names, directory)
        for path in found[name].values()
    ]


@functools.cache
def scenario_message() -> Any:
    """Return the class of the message ``Scenario``, with the fields of ``MESSAGES``."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    proto = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(
        name="mtpgo/waymo_scenario.proto", package="mtpgo.waymo", syntax="proto2"
    )
    for message, fields in MESSAGES.items():
        description = file.message_type.add(name=message)
        for name, (number, text) in fields.items():
            repeated, _, kind = text.rpartition(" ")
            field = description.field.add(name=name, number=number)
            field.label = proto.LABEL_REPEATED if repeated else proto.LABEL_OPTIONAL
            if kind in MESSAGES:
                field.type, field.type_name = proto.TYPE_MESSAGE, f".mtpgo.waymo.{kind}"
            else:
                field.type = getattr(proto, f"TYPE_{kind.upper()}")
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("mtpgo.waymo.Scenario"))


def _read(name: str, path: Path, classes: ClassMap) -> Iterator[Recording]:
    from google.protobuf.message import DecodeError

    seen: set[str] = set()
    for number, content in _records(path):
        scenario = scenario_message()()
        where = f"{path}, record {number}"
        try:
            scenario.ParseFromString(content)
        except (DecodeError, RuntimeError, UnicodeDecodeError) as error:
            raise RecordingError(f"{where} is no scenario of Waymo: {error}") from error
        if isinstance(scenario.scenario_id, bytes):  # as protobuf gives a damaged text
            raise RecordingError(
                f"{where} is no scenario of Waymo: its scenario_id is not text in UTF-8"
            )
        if not scenario.tracks or not scenario.timestamps_seconds:
            raise RecordingError(
                f"{where} has no tracks or no times, expected a scenario of Waymo"
            )
        identity = scenario.scenario_id or str(number)
        source = TableSource(
            name=f"{name}-{identity}",
            layout="waymo",
            files=(path,),
            # Of the scenario alone: the same ones are also in Waymo's files of interactions.
            sha256=hashlib.sha256(content).hexdigest(),
            classes=classes,
            location=identity,
            unit="state",
        )
        table = _rows(scenario, where)
        if not len(table):
            remark(f"{where}: no state of the scenario {identity} is valid")
            continue
        if identity in seen:
            raise RecordingError(f"{where}: the scenario {identity} is there a second time")
        seen.add(identity)
        recording = recording_of_rows(table, source)
        ego = scenario.sdc_track_index
        if scenario.HasField("sdc_track_index") and 0 <= ego < len(scenario.tracks):
            recording = with_ego(recording, str(scenario.tracks[ego].id))
        yield recording
    if not seen:
        raise RecordingError(f"{path} has no scenario with a valid state")


def _rows(scenario: Any, where: str) -> pd.DataFrame:
    """Return the valid states of a scenario."""
    times = np.array(scenario.timestamps_seconds, dtype=np.float64)
    columns: dict[str, list[Any]] = {
        name: [] for name in ("track", "class", "time_s", "x", "y", "yaw", "vx", "vy", "length")
    }
    columns["width"], columns["line"] = [], []
    for track in scenario.tracks:
        if len(track.states) > len(times):
            raise RecordingError(
                f"{where}, track {track.id}: {len(track.states)} states for {len(times)} times"
            )
        for i, state in enumerate(track.states):
            if not state.valid:
                continue
            row = (
                track.id,
                track.object_type,
                times[i],
                state.center_x,
                state.center_y,
                state.heading,
                state.velocity_x,
                state.velocity_y,
                state.length,
                state.width,
                i + 1,
            )
            for column, value in zip(columns.values(), row, strict=True):
                column.append(value)
    table = pd.DataFrame(columns)
    if len(table) and not np.isfinite(table[["time_s", "x", "y"]].to_numpy(np.float64)).all():
        raise RecordingError(f"{where}: a time or position is not finite")
    return table


def _records(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield number and content of the records of a TFRecord file, without damaged contents.

    Raises:
        RecordingError: the file cannot be read, ends within a record, or the length of a record
            is damaged, so that the next one cannot be found.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as stream:
            number = 0
            while head := stream.read(_HEAD.size):
                number += 1
                length, checksum = _HEAD.unpack(head) if len(head) == _HEAD.size else (size, 0)
                if length + _CHECKSUM.size > size - stream.tell():
                    raise RecordingError(
                        f"{path} ends within record {number}, expected a TFRecord file: it is "
                        "truncated or of another kind"
                    )
                if checksum != masked_crc32c(head[:8]):
                    raise RecordingError(
                        f"{path}, record {number}: its length and the check sum of that differ, "
                        "expected a TFRecord file: it is damaged or of another kind"
                    )
                content = stream.read(length)
                (checksum,) = _CHECKSUM.unpack(stream.read(_CHECKSUM.size))
                if checksum == masked_crc32c(content):
                    yield number, content
                else:
                    remark(
                        f"{path}, record {number}: its check sum is wrong, so the content is "
                        "damaged and left out"
                    )
            if not number:
                raise RecordingError(f"{path} is empty, expected a TFRecord file")
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error


def masked_crc32c(content: bytes) -> int:
    """Return the check sum of a TFRecord file for some bytes.

    Source: TensorFlow's description of the format (TFRecord and tf.train.Example, "TFRecords
    format details").
    """
    from google_crc32c import value

    crc = value(content)
    return ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF
