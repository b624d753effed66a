"""A robot's log in an MCAP file as the same table as a CSV file: columns by name, and a row for each instant.

Messages in JSON give a column for each number in them. Of ROS 2, JointState gives angles, speeds and torques of its
joints; all other messages give a column for each number in them too. A wrench's force and a Bool about contact have
hopopt's names. The topic with the joints has the rows. Values of others are interpolated at these times; 0 or 1 is
kept until it changes. Messages as large as pictures are passed over.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.errors import MissingExtraError, ResultError

NANO = 1e-9  # [s]
LARGEST_MESSAGE = 1 << 16  # bytes of a message with numbers of a leg
DEEPEST = 6  # of messages within messages
WIDEST = 64  # numbers of a list that become columns
STATE = (("position", "q_"), ("velocity", "v_"), ("effort", "tau_"))
COMMAND = "command"  # a JointState topic with this in its name says what the drives were asked for
OTHER_NAMES = {"wrench.force.x": "force_x", "wrench.force.z": "force_z", "force.x": "force_x", "force.z": "force_z"}
Row = dict[str, float]


@dataclass(eq=False)
class Topic:
    """What one topic of a log says: at times [s] by the log's clock, numbers by name."""

    name: str
    times: list[float] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)

    @property
    def columns(self) -> list[str]:
        """All names, in the order in which they came."""
        return list(dict.fromkeys(name for row in self.rows for name in row))

    def column(self, name: str) -> np.ndarray:
        """The values of a column; not-a-number in messages without it."""
        return np.array([row.get(name, math.nan) for row in self.rows])

    def at(self, name: str, times: np.ndarray) -> np.ndarray:
        """A column at other times [s] (k,), kept until it changes if it is but 0 and 1, else linear in between."""
        known, order = np.array(self.times), np.argsort(self.times, kind="stable")
        values = self.column(name)[order]
        if np.isin(values, (0.0, 1.0)).all():
            return values[np.maximum(np.searchsorted(known[order], times, side="right") - 1, 0)]
        return np.interp(times, known[order], values)


def mcap_table(file: Path, wanted: Set[str]) -> dict[str, list[float]]:
    """Column -> its values (k), t [s] among them, of an MCAP file; names may have units in brackets, as in CSV files.

    wanted: the columns that count, by the log's names. The topic with most of them has the rows; others that have some
    must have begun, and not ended, at each row.
    Raises MissingExtraError without the libraries of the extra ``mcap``, ResultError for a file that cannot be read, or
    in which no topic has numbers.
    """
    topics = _topics(file)
    count = {topic.name: len(wanted & {_bare(name) for name in topic.columns}) for topic in topics}
    main = max(topics, key=lambda topic: (count[topic.name], len(topic.rows)), default=None)
    if main is None:
        raise ResultError(f"{file}: no topic has numbers in JSON or in messages of ROS 2")
    others = [topic for topic in topics if topic is not main]
    needed = [topic for topic in others if count[topic.name]]
    times = np.array(main.times)
    first = max([times[0], *(min(topic.times) for topic in needed)])
    last = min([times[-1], *(max(topic.times) for topic in needed if not _kept(topic))])
    within = (times >= first - NANO) & (times <= last + NANO)
    if not within.any():
        names = ", ".join(topic.name for topic in (main, *needed))
        raise ResultError(f"{file}: the topics {names} have no time in common: log them by one clock")
    own_time = any(_bare(name) == "t" for name in main.columns)
    table = {} if own_time else {"t": (times - times[0])[within].tolist()}
    table |= {name: main.column(name)[within].tolist() for name in main.columns}
    for topic in (*needed, *(topic for topic in others if topic not in needed)):
        for name in topic.columns:
            free = name if name not in table and _bare(name) != "t" else f"{topic.name}.{name}"
            table[free] = topic.at(name, times[within]).tolist()
    return table


def _bare(name: str) -> str:
    """A column's name without the unit behind it."""
    return name.partition("[")[0].strip()


def _kept(topic: Topic) -> bool:
    """Whether all that a topic says is kept until it changes: it may be silent at the end."""
    return all(np.isin(topic.column(name), (0.0, 1.0)).all() for name in topic.columns)


# ---- messages ---------------------------------------------------------------------------------------------------


def _topics(file: Path) -> list[Topic]:
    """Every topic with what its messages say, in order of time."""
    found = dict[str, Topic]()
    for name, t, row in _messages(file):
        topic = found.setdefault(name, Topic(name))
        topic.times.append(t)
        topic.rows.append(row)
    return list(found.values())


def _messages(file: Path) -> Iterator[tuple[str, float, Row]]:
    """Topic, time [s] since the first message, and numbers of every message that can be read."""
    try:
        make_reader = import_module("mcap.reader").make_reader
        factory = import_module("mcap_ros2.decoder").DecoderFactory()
    except ModuleNotFoundError:
        raise MissingExtraError("the reader of MCAP files", "mcap") from None
    origin = None
    try:
        with file.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                decoded = _decoded(factory, schema, channel, message)
                if decoded is None:
                    continue
                row = _columns(decoded, channel.topic)
                stamp = _stamp(decoded) or message.log_time
                origin = stamp if origin is None else origin
                if row:
                    yield channel.topic, (stamp - origin) * NANO, row
    except FileNotFoundError:
        raise ResultError(f"{file}: there is no such file") from None
    except Exception as error:  # these libraries, and those that decompress, raise what they will at a damaged file
        words = " ".join(str(error).split())[:120] or type(error).__name__
        raise ResultError(f"{file}: it is no whole MCAP file ({words})") from None


def _decoded(factory: Any, schema: Any, channel: Any, message: Any) -> Any:
    """A message as an object with attributes or as a dictionary; None of another encoding, or of a large one."""
    if len(message.data) > LARGEST_MESSAGE:
        return None
    if channel.message_encoding == "json":
        return json.loads(message.data)
    decode: Callable[[bytes], Any] | None = factory.decoder_for(channel.message_encoding, schema)
    return None if decode is None else decode(message.data)


def _part(message: Any, name: str) -> Any:
    """A field of a message; None if it has no such field."""
    return message.get(name) if isinstance(message, Mapping) else getattr(message, name, None)


def _stamp(message: Any) -> int:
    """When a message was made [ns], by its header; zero if it does not say."""
    stamp = _part(_part(message, "header"), "stamp")
    with suppress(TypeError, ValueError):
        return int(_part(stamp, "sec")) * 10**9 + int(_part(stamp, "nanosec") or 0)
    return 0


def _columns(message: Any, topic: str) -> Row:
    """The numbers of a message by the names of hopopt's columns."""
    names = _part(message, "name")
    if isinstance(names, Sequence) and not isinstance(names, str) and _part(message, "position") is not None:
        commands = COMMAND in topic.lower()
        found = Row()
        for part, prefix in (("effort", "command_"),) if commands else STATE:
            values = _part(message, part) or ()
            found |= {f"{prefix}{name}": float(x) for name, x in zip(names, values, strict=False)}
        return found
    found = _flat(message, "", 0)
    if list(found) == ["data"]:  # a Bool or a Float64, known by its topic alone
        last = topic.rstrip("/").rpartition("/")[2]
        return {"contact" if "contact" in last.lower() else last: found["data"]}
    return {OTHER_NAMES.get(name, name): x for name, x in found.items()}


def _flat(value: Any, name: str, depth: int) -> Row:
    """Numbers within a value, by the names that lead to them, with dots in between."""
    if isinstance(value, (bool, int, float)):
        return {name: float(value)}
    if value is None or isinstance(value, (str, bytes)) or depth > DEEPEST:
        return {}
    if isinstance(value, Mapping):
        parts = dict(value)
    elif isinstance(value, Sequence):
        parts = dict(enumerate(value[:WIDEST]))
    else:
        parts = {
            key: getattr(value, key) for key in (*getattr(value, "__slots__", ()), *getattr(value, "__dict__", ()))
        }
    found = Row()
    for key, part in parts.items():
        if key != "header" and not str(key).startswith("_"):
            found |= _flat(part, f"{name}.{key}" if name else str(key), depth + 1)
    return found
