# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The files of a bag as one sequence of messages, whole or damaged.

A folder is read with or without ``metadata.yaml``: the kind of a file is detected by its first
bytes, and its topics are read from the file itself. The metadata only add the order of the files
and the expected numbers of messages. A truncated or damaged file is read up to the damage, an
unreadable one is left out; every loss is logged once as a sentence.
"""

from __future__ import annotations

import logging
import re
import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from backports import zstd
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Qos,
)

from msg_adapters.bags.bag_loss import BagLoss, LibraryFile, counted
from msg_adapters.bags.bag_metadata import METADATA, BagMetadata, qos_of, read_metadata
from msg_adapters.bags.lazy_merge import TimedStream, merge_in_time
from msg_adapters.bags.mcap_file import McapFile
from msg_adapters.bags.mcap_records import MAGIC, McapChannel, McapError, McapSchema
from msg_adapters.bags.ros1_file import (
    MAGIC_ROS1,
    Ros1File,
    UnindexedRos1File,
    open_ros1,
)
from msg_adapters.bags.sqlite_file import (
    LARGEST_MESSAGE,
    SqliteFile,
    files_left_beside,
    recovered_copy,
    salvaged_copy,
)
from mtpgo_core.errors import RecordingError, found_names, reason_of

_PACKED = (".zstd", ".zst")
"""Endings that rosbag2 and the program zstd add to the name of a file that they compress."""

SUFFIXES = (
    ".mcap",
    ".db3",
    *(ending + packed for ending in (".mcap", ".db3") for packed in _PACKED),
    ".bag",
    ".bag.active",
)
"""How the names of a bag's files end, in small letters or capitals."""

_SQLITE, _ZSTD = b"SQLite format 3\0", b"\x28\xb5\x2f\xfd"
"""First bytes of an SQLite database and of a Zstandard frame."""

_MCAP = MAGIC.partition(b"\r")[0]
"""First bytes of an MCAP file up to the line end, which a transfer as text changes."""

_GIT_LFS = b"version https://"
"""First bytes of what a repository has in place of a large file that was not fetched."""

_NUMBERED = re.compile(r"(.+)_(\d+)")
"""Name of a file of a split bag, without its suffix: name of the bag and number."""

_DEFAULT_PREFIX = "rosbag2_"
"""Beginning of the name that ``ros2 bag record`` gives a bag."""

_MOST_IDS = 5
"""Identities of topics that a sentence lists; chosen."""

_log = logging.getLogger("mtpgo")
_told: set[str] = set()


def has_bag_suffix(path: Path) -> bool:
    """Return whether a file is named as one of a bag, in small letters or capitals."""
    return path.name.lower().endswith(SUFFIXES)


def begins_as_bag(path: Path) -> bool:
    """Return whether a file begins as one of a bag does, also a compressed one, whatever its name.

    False where it cannot be read.
    """
    try:
        with path.open("rb") as stream:
            begin = stream.read(len(_SQLITE))
    except OSError:
        return False
    return begin.startswith((MAGIC, _SQLITE, MAGIC_ROS1, _ZSTD))


def bag_files(folder: Path) -> list[Path]:
    """Return the files of a folder that are named as a bag's, the numbered ones by number."""

    def order(path: Path) -> tuple[str, int, str]:
        match = _NUMBERED.fullmatch(_stem(path))
        return (match[1], int(match[2]), path.name) if match else (_stem(path), -1, path.name)

    # macOS lays a ._NAME.mcap beside each file.
    shown = (path for path in folder.iterdir() if not path.name.startswith("."))
    found = [path for path in shown if has_bag_suffix(path) and path.is_file()]
    return sorted(without_packed_copies(found), key=order)


def without_packed_copies(paths: Collection[Path]) -> list[Path]:
    """Return paths without the compressed files beside which the files themselves lie.

    The program zstd keeps what it compresses, and so does a recorder that is killed meanwhile.
    """
    there = set(paths)
    return [
        path
        for path in paths
        if not (path.suffix.lower() in _PACKED and path.with_suffix("") in there)
    ]


def is_unfinished_bag(folder: Path) -> bool:
    """Return whether a folder without ``metadata.yaml`` is a bag, as a killed recorder leaves it.

    It is if all its bag files are named after it or as ``ros2 bag record`` does by default;
    otherwise it is a folder of bags.
    """
    if not folder.is_dir() or (folder / METADATA).is_file():
        return False
    names = {_bag_name(path) for path in bag_files(folder)}
    return len(names) == 1 and (
        names == {folder.resolve().name} or next(iter(names)).startswith(_DEFAULT_PREFIX)
    )


def _stem(path: Path) -> str:
    return re.sub(r"\.(mcap|db3)(\.zstd?)?$", "", path.name, flags=re.IGNORECASE)


def _bag_name(path: Path) -> str:
    match = _NUMBERED.fullmatch(_stem(path))
    return match[1] if match else _stem(path)


def _with_missing(files: Sequence[Path]) -> list[Path]:
    """Return the files of a bag, and those that their numbers tell to be missing between them.

    The first ones may be missing on purpose, as recorders delete them where space is short; and
    numbers far from each other are times, which count nothing.
    """
    matches = [_NUMBERED.fullmatch(_stem(file)) for file in files]
    number = {int(match[2]): file for match, file in zip(matches, files, strict=True) if match}
    if len(number) < len(files) or max(number) - min(number) >= 2 * len(files):
        return list(files)
    suffix = files[0].name.removeprefix(_stem(files[0]))
    return [
        number.get(n) or files[0].with_name(f"{_bag_name(files[0])}_{n}{suffix}")
        for n in range(min(number), max(number) + 1)
    ]


def mcap_connection(
    number: int, channel: McapChannel, schema: McapSchema | None, count: int, owner: object
) -> Connection:
    """Return a channel of an MCAP file as rosbags describes it.

    Args:
        number: of the channel.
        channel: topic, encoding and QoS.
        schema: type and definition, None where the file has none.
        count: messages of the channel.
        owner: what the channel is read from.
    """
    definition = MessageDefinition(MessageDefinitionFormat.NONE, "")
    if schema is not None and schema.encoding in _DEFINITIONS and schema.text:
        definition = MessageDefinition(_DEFINITIONS[schema.encoding], schema.text)
    return Connection(
        id=number,
        topic=channel.topic,
        msgtype=_full_name(schema.name) if schema else "",
        msgdef=definition,
        digest="",
        msgcount=count,
        ext=ConnectionExtRosbag2(
            channel.encoding, qos_of(channel.metadata.get("offered_qos_profiles"))
        ),
        owner=owner,
    )


class _McapStorage:
    """An MCAP file with connections as rosbags describes them."""

    def __init__(self, path: Path) -> None:
        self.file = McapFile(path)
        self.start_ns, self.end_ns = self.file.start_ns, self.file.end_ns
        self.connections = {
            number: mcap_connection(
                number,
                channel,
                self.file.schemas.get(channel.schema_id),
                self.file.counts[number],
                self.file,
            )
            for number, channel in self.file.channels.items()
        }

    def messages(
        self, numbers: Collection[int], start_ns: int | None, stop_ns: int | None
    ) -> Iterator[tuple[int, int, bytes]]:
        return self.file.messages(numbers, start_ns, stop_ns)

    def loss(self) -> BagLoss | None:
        return self.file.loss()

    def close(self) -> None:
        self.file.close()


_DEFINITIONS = {
    "ros2msg": MessageDefinitionFormat.MSG,
    "ros1msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL,
    "omgidl": MessageDefinitionFormat.IDL,
}
"""Encoding of a schema -> rosbags' name for it; definitions in other languages are left out."""


def _full_name(message_type: str) -> str:
    """Return a type as ROS 2 writes it; ROS 1 leaves out its folder."""
    package, slash, rest = message_type.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else message_type


class _SqliteStorage(LibraryFile):
    """An SQLite file, read by rosbags up to where it breaks.

    Args:
        path: the file.
        problem: why it is a copy of what could be read of another one, empty if it is not.
    """

    def __init__(self, path: Path, problem: str = "") -> None:
        reader = SqliteFile(path)
        reader.open()
        about = reader.metadata
        super().__init__(path, reader, about.start_time, about.end_time - 1)
        self.connections = {c.id: c for c in reader.connections}
        read_s = (self.end_ns - self.start_ns) * 1e-9
        if problem:
            self._loss = BagLoss(path, f"is damaged ({problem})", about.message_count, read_s)
        self._without_topic: BagLoss | None = None
        if reader.without_topic:
            ids = found_names([*map(str, reader.without_topic)], _MOST_IDS)
            reason = f"has messages of topics that its table of topics does not have ({ids})"
            lost = sum(reader.without_topic.values())
            self._without_topic = BagLoss(
                path, reason, about.message_count, read_s, lost, exact=True
            )

    def loss(self) -> BagLoss | None:
        """Return what is lost as far as it is known by now, None if nothing is."""
        loss, other = super().loss(), self._without_topic
        if loss is None or other is None:
            return loss or other
        messages = None if loss.messages is None else loss.messages + (other.messages or 0)
        return replace(loss, reason=f"{loss.reason} and {other.reason}", messages=messages)


_Storage = _McapStorage | _SqliteStorage | Ros1File | UnindexedRos1File


class StoredBag:
    """The messages of a bag: a rosbag2 folder, or one file of it.

    It has what ``rosbags.rosbag2.Reader`` has: connections and messages that name them. A topic
    has one connection for each type, encoding and definition, however many publishers it had.

    Args:
        path: a folder, or a file.

    Attributes:
        path: the bag.
        connections: topics with their types.
        start_time: log time of the first message (ns).
        end_time: log time behind the last message (ns).
        told: sentences on problems of the bag that were logged so far, also if another instance
            logged them before.

    Raises:
        RecordingError: nothing of it can be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.told: list[str] = []
        self.connections: list[Connection] = []
        self._storages: list[_Storage] = []
        self._files: list[Path] = []
        self._unread: dict[Path, BagLoss] = {}
        self._packed: Counter[int] = Counter()  # messages that stay compressed, by storage
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._about = read_metadata(path) if path.is_dir() else BagMetadata()
        self._order = self._listed() if path.is_dir() else [path]
        try:
            for file in self._order:
                self._open(file)
            if not self._storages:
                raise RecordingError(self._refusal())
        except BaseException:
            self.close()
            raise
        filled = [s for s in self._storages if any(c.msgcount for c in s.connections.values())]
        if not filled and any(loss.messages != 0 for loss in self.losses()):
            refusal = self._refusal()
            self.close()
            raise RecordingError(refusal)
        self.start_time = min((s.start_ns for s in filled), default=0)
        self.end_time = max((s.end_ns for s in filled), default=-1) + 1
        self._numbers = self._connect()
        if self._about.problem and self._storages:
            self.tell(
                f"{path} {self._about.problem}, as when its recorder is killed: its"
                f" {len(self._storages)} file(s) are read without it"
            )
        self._tell_losses()
        self._tell_shortages({c.id for c in self.connections if not c.msgcount})

    def _listed(self) -> list[Path]:
        """Return the files of a folder."""
        if self._about.problem:
            files = bag_files(self.path)
            names = {_bag_name(file) for file in files}
            if not files:
                raise RecordingError(
                    f"{self.path} {self._about.problem} and no file of a bag, expected a rosbag2"
                    " directory"
                )
            if len(names) > 1:
                raise RecordingError(
                    f"{self.path} {self._about.problem} and holds the bags"
                    f" {', '.join(sorted(names))}, expected one of them"
                )
            return _with_missing(files)
        named = [self._present(name) for name in self._about.files]
        if not any(file.is_file() for file in named):
            others = bag_files(self.path)
            if others and len({_bag_name(file) for file in others}) == 1:
                missing = ", ".join(file.name for file in named)
                what = f"{missing}, of which there is none" if missing else "no file"
                self.tell(
                    f"{self.path / METADATA} names {what}:"
                    f" {', '.join(file.name for file in others)} is read instead"
                )
                return others
        stems = {_stem(file) for file in named}
        names = {_bag_name(file) for file in named}
        # A recorder that is killed after a split may have named the files until then only.
        more = [
            file
            for file in bag_files(self.path)
            if _stem(file) not in stems and _bag_name(file) in names
        ]
        if more:
            self.tell(
                f"{self.path / METADATA} does not name {', '.join(file.name for file in more)}:"
                " read as well"
            )
        return [*named, *more]

    def _present(self, name: str) -> Path:
        """Return the present path of a file that the metadata name: it may be (un)compressed."""
        plain = next((name.removesuffix(e) for e in _PACKED if name.endswith(e)), name)
        names = dict.fromkeys((name, plain, *(plain + ending for ending in _PACKED)))
        for other in names:
            if (self.path / other).is_file():
                return self.path / other
        # Cameras and Windows write names in capitals.
        wanted = {other.lower() for other in names}
        alike = [path for path in bag_files(self.path) if path.name.lower() in wanted]
        return alike[0] if alike else self.path / name

    def _open(self, file: Path) -> None:
        try:
            with file.open("rb") as stream:
                begin = stream.read(len(_SQLITE))
            content = self._inflated(file) if begin.startswith(_ZSTD) else file
            if content is not file:
                with content.open("rb") as stream:
                    begin = stream.read(len(_SQLITE))
            if begin.startswith(MAGIC):
                self._storages.append(_McapStorage(content))
            elif begin == _SQLITE:
                self._storages.append(self._sqlite(self._recovered(content)))
            elif begin.startswith(MAGIC_ROS1):
                self._storages.append(open_ros1(content))
            elif begin.startswith(_MCAP):
                raise McapError("it begins as an MCAP file whose line ends were changed")
            elif not begin.strip(b"\0"):
                raise McapError("it is empty" if not begin else "it holds zeros only")
            elif begin == _GIT_LFS:
                raise McapError("it is a pointer of Git LFS, 'git lfs pull' gets the file itself")
            else:
                raise McapError("it begins as no bag of MCAP, SQLite or ROS 1 does")
        except Exception as error:  # A broken file fails the libraries in many ways.
            self._unread[file] = self._whole_loss(file, error)
        else:
            self._files.append(file)

    def _inflated(self, file: Path) -> Path:
        """Return a copy of a compressed file, or of as much of it as there is.

        Raises:
            McapError: nothing of it can be decompressed.
        """
        packed = file.suffix.lower() in _PACKED
        target = self._temporary_folder() / (file.stem if packed else file.name)
        try:
            with zstd.open(file, "rb") as stream, target.open("wb") as out:
                shutil.copyfileobj(stream, out)
        except (EOFError, zstd.ZstdError) as error:
            if not target.stat().st_size:
                raise McapError(
                    "it is compressed by Zstandard, and cut off or damaged before anything of it"
                    " can be decompressed"
                ) from error
        return target

    def _sqlite(self, file: Path) -> _SqliteStorage:
        """Return an SQLite file, or a copy of the readable part of a damaged one.

        Raises:
            sqlite3.Error: nothing can be read.
        """
        try:
            return _SqliteStorage(file)
        except sqlite3.DatabaseError as error:
            copy = salvaged_copy(file, self._temporary_folder())
            if copy is None:
                raise
            return _SqliteStorage(copy, reason_of(error))

    def _recovered(self, file: Path) -> Path:
        """Return an SQLite file, or a copy with what its recorder left beside it."""
        left = files_left_beside(file)
        if not left:
            return file
        names = " and ".join(path.name for path in left)
        try:
            copy = recovered_copy(file, self._temporary_folder())
        except (OSError, sqlite3.Error) as error:
            self.tell(f"{file} was not closed, and {names} cannot be used: {reason_of(error)}")
            return file
        self.tell(
            f"{file} was not closed, as when its recorder is killed: {names} is read as well"
        )
        return copy

    def _temporary_folder(self) -> Path:
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory()
        return Path(self._folder.name)

    def _whole_loss(self, file: Path, error: Exception) -> BagLoss:
        expected = self._about.expected.get(file.name)
        return BagLoss(
            file,
            f"cannot be read ({reason_of(error)})",
            0,
            0.0,
            expected[0] if expected else None,
            expected[2] * 1e-9 if expected else None,
            exact=True,
        )

    def _refusal(self) -> str:
        if not self._order:
            return f"{self.path} names no file in its {METADATA}, expected at least one"
        loss, others = self.losses()[0], len(self._order) - 1
        more = f", nor can the other {others} files of {self.path}" if others else ""
        expected = "a rosbag2 directory, .mcap, .db3 or .bag"
        reason = f"it {loss.reason}"
        if loss.file in self._unread:
            reason = loss.reason.removeprefix("cannot be read (").removesuffix(")")
        return f"{loss.file} cannot be read as a bag ({expected}): {reason}{more}"

    def _connect(self) -> list[dict[int, Connection]]:
        """Merge the connections of all files into ``connections``.

        Returns:
            For each file, the merged connections by the file's own connection numbers.
        """
        united: dict[Any, Connection] = {}
        offered: dict[Any, list[Qos]] = {}
        keys: list[dict[int, Any]] = []
        for storage in self._storages:
            keys.append({})
            for number, connection in storage.connections.items():
                own = _with_clean_names(connection)
                topic = (own.topic, own.msgtype)
                encoding, own_profiles = cast(ConnectionExtRosbag2, own.ext)
                key = (*topic, encoding, own.msgdef)
                keys[-1][number] = key
                profiles = offered.setdefault(key, [])
                for profile in own_profiles or self._about.offered.get(topic, []):
                    if profile not in profiles:
                        profiles.append(profile)
                before = united.get(key)
                united[key] = own._replace(
                    id=before.id if before else len(united) + 1,
                    digest=own.digest or self._about.digests.get(topic, ""),
                    msgcount=own.msgcount + (before.msgcount if before else 0),
                    ext=ConnectionExtRosbag2(encoding, profiles),
                    owner=self,
                )
        self.connections = list(united.values())
        return [{number: united[key] for number, key in of_file.items()} for of_file in keys]

    def __enter__(self) -> StoredBag:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def messages(
        self,
        connections: Collection[Connection] = (),
        start: int | None = None,
        stop: int | None = None,
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, log time (ns) and bytes of messages, ascending in time.

        Args:
            connections: those wanted, all by default.
            start: earliest log time (ns).
            stop: first log time that is left out (ns).
        """
        wanted = {c.id for c in (connections or self.connections)}
        streams = []
        for place, (storage, numbers) in enumerate(
            zip(self._storages, self._numbers, strict=True)
        ):
            own = {number: c for number, c in numbers.items() if c.id in wanted}
            if own:
                streams.append(TimedStream(storage.start_ns, self._named(place, own, start, stop)))
        try:
            for time_ns, connection, data in merge_in_time(streams):
                yield connection, time_ns, data
        finally:
            self._tell_losses()
            self._tell_shortages(wanted)

    def _named(
        self,
        place: int,
        own: dict[int, Connection],
        start: int | None,
        stop: int | None,
    ) -> Iterator[tuple[int, Connection, bytes]]:
        by_message, packed = self._about.by_message, 0
        for time_ns, number, data in self._storages[place].messages(own, start, stop):
            if by_message is not False and data[:4] == _ZSTD:
                try:
                    data = _unpacked(data)
                except (zstd.ZstdError, EOFError):
                    packed += 1
                    self._packed[place] = max(packed, self._packed[place])
                    continue
            yield time_ns, own[number], data

    def losses(self) -> list[BagLoss]:
        """Return the losses that are known so far."""
        found = [self._with_gap(loss) for loss in self._unread.values()]
        for place, (file, storage) in enumerate(zip(self._files, self._storages, strict=True)):
            expected = self._about.expected.get(file.name)
            loss = storage.loss() or self._packed_loss(place) or self._short(place, expected)
            if loss is None:
                continue
            if expected is not None and expected[0] >= loss.read:
                end_ns = expected[1] + expected[2]
                ended_s = max(0, end_ns - storage.end_ns) * 1e-9
                whole_s = expected[2] * 1e-9
                loss = replace(
                    loss,
                    messages=expected[0] - loss.read,
                    # Messages that are missing between others took no time of the file's.
                    seconds=(max(ended_s, loss.seconds or 0.0) if loss.read else whole_s) or None,
                    exact=True,
                )
            found.append(replace(loss, file=file))
        return found

    def _packed_loss(self, place: int) -> BagLoss | None:
        """Return the loss of messages that were compressed one by one and stay so."""
        packed = self._packed[place]
        if not packed:
            return None
        storage = self._storages[place]
        return BagLoss(
            self._files[place],
            "has messages that cannot be decompressed",
            sum(c.msgcount for c in storage.connections.values()) - packed,
            (storage.end_ns - storage.start_ns) * 1e-9,
            packed,
            exact=True,
        )

    def _short(self, place: int, expected: tuple[int, int, int] | None) -> BagLoss | None:
        """Return the loss of a file with fewer messages than the metadata count for it.

        Only where the metadata have no counts by topic; otherwise see :meth:`_tell_shortages`.
        """
        storage = self._storages[place]
        read = sum(c.msgcount for c in storage.connections.values())
        if expected is None or expected[0] <= read or any(self._about.counts.values()):
            return None
        read_s = (storage.end_ns - storage.start_ns) * 1e-9
        reason = f"has fewer messages than {METADATA} counts"
        return BagLoss(self._files[place], reason, read, read_s)

    def _with_gap(self, loss: BagLoss) -> BagLoss:
        """Return the loss of a file with the pause that it leaves between its neighbours."""
        if loss.seconds is not None:
            return loss
        place = self._order.index(loss.file)
        opened = dict(zip(self._files, self._storages, strict=True))
        before = [opened[file] for file in self._order[:place] if file in opened]
        after = [opened[file] for file in self._order[place:] if file in opened]
        if not before or not after:
            return loss
        gap_ns = after[0].start_ns - before[-1].end_ns
        return replace(loss, seconds=max(0, gap_ns) * 1e-9)

    def _tell_losses(self) -> None:
        for loss in self.losses():
            self.tell(loss.sentence())

    def _tell_shortages(self, wanted: Collection[int]) -> None:
        """Log the topics with fewer messages in the files than the metadata count.

        Nothing is logged if the known losses of files account for all missing messages.

        Args:
            wanted: numbers of the connections to report, besides topics without a connection.
        """
        held = Counter[tuple[str, str]]()
        for connection in self.connections:
            held[connection.topic, connection.msgtype] += connection.msgcount
        stated = {
            ("/" + name.lstrip("/"), kind): count
            for (name, kind), count in self._about.counts.items()
        }
        short = {topic: n - held[topic] for topic, n in stated.items() if n > held[topic]}
        explained = [loss.messages for loss in self.losses()]
        if None in explained or sum(short.values()) <= sum(n or 0 for n in explained):
            return
        named = {(c.topic, c.msgtype) for c in self.connections if c.id in wanted}
        for topic, missing in short.items():
            if topic in named or topic not in held:
                self.tell(
                    f"{self.path}, topic {topic[0]}: {counted(missing)} of the"
                    f" {stated[topic]} that {METADATA} counts are missing, as when a recorder is"
                    " killed or a copy ends early"
                )

    def tell(self, sentence: str) -> None:
        """Log a sentence about the bag, once per process, and store it in ``told``."""
        if sentence not in self.told:
            self.told.append(sentence)
        tell_once(sentence)

    def close(self) -> None:
        """Close the files."""
        for storage in self._storages:
            with suppress(Exception):
                storage.close()
        if self._folder is not None:
            self._folder.cleanup()


def _with_clean_names(connection: Connection) -> Connection:
    """Return a connection without line breaks in its names, its topic with a leading slash.

    Names in a damaged file may contain line breaks, which must not appear in log lines; a topic
    may have been recorded without the leading slash.
    """
    topic, message_type = (" ".join(s.split()) for s in (connection.topic, connection.msgtype))
    topic = "/" + topic.lstrip("/") if topic else topic
    return connection._replace(topic=topic, msgtype=message_type)


def _unpacked(data: bytes) -> bytes:
    """Return a message that was compressed by itself.

    Raises:
        zstd.ZstdError: it is damaged.
        EOFError: it is cut off, or larger than a message may be.
    """
    inflater = zstd.ZstdDecompressor()
    content = inflater.decompress(data, LARGEST_MESSAGE)
    if not inflater.eof:
        raise EOFError
    return content


def tell_once(sentence: str) -> None:
    """Log a sentence once per process: many commands open a bag more than once."""
    if sentence not in _told:
        _told.add(sentence)
        _log.warning("%s", sentence)
