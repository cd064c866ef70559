"""Recordings of client sessions: their text form, and how two of them are compared.

A recording is a list of lines: virtual time, recipient, name of the message, and all its fields. Two recordings are
equal when every recipient gets the same messages of each type in the same order, each within one step of the simulator
and with the same whole numbers and texts. The order of messages of different types is held by their times alone.
"""

from __future__ import annotations

import json
import math
import re
import zlib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

STEP = 1 / 60
"""s: the simulator's step, and how far the times of a message may be apart."""

SLACK = 1e-3
"""s more, for what the clock of recordings adds to each timer and for times in whole milliseconds."""

DROPPED = {
    (
        "ardrone3.Piloting.PCMD",
        "timestampAndSeqNum",
    ): "a counter and a clock in one; the order and time of lines say it",
    ("COMPONENT_METADATA", "file_crc"): "the file itself is recorded, without its texts",
    ("COMPONENT_INFORMATION", "general_metadata_file_crc"): "the file itself is recorded, without its texts",
    ("ONBOARD_COMPUTER_STATUS", "ram_usage"): "of the machine",
    ("ONBOARD_COMPUTER_STATUS", "ram_total"): "of the machine",
    ("ONBOARD_COMPUTER_STATUS", "storage_usage"): "of the machine",
    ("ONBOARD_COMPUTER_STATUS", "storage_total"): "of the machine",
}
"""Fields that are not recorded, and why."""

TIMES = {
    "time_boot_ms": 1e-3,
    "event_time_boot_ms": 1e-3,
    "breach_time": 1e-3,
    "timestamp": 1e-3,
    "time_usec": 1e-6,
    "time_unix_usec": 1e-6,
    "arming_time_utc": 1e-6,
    "takeoff_time_utc": 1e-6,
    "tc1": 1e-9,
}
"""Fields that hold a time of sending, and their unit in s: they may differ as much as the time of the line."""

RELATIVE, ABSOLUTE = 2e-7, 1e-6
"""How far two numbers with a fraction may be apart: what control loops integrate follows the microseconds of the clock,
and the last bit of a single-precision float follows that."""

EXACT = ("latitude", "longitude")
"""Fields in deg, of which that much would be 0.1 m."""

REPEATED = ("MISSION_CURRENT",)
"""Messages of which identical ones in a row count as one."""

FILES = "FILE_TRANSFER_PROTOCOL"
"""Sizes and counts of these follow the texts in the files: not compared when texts may differ."""


@dataclass(frozen=True)
class Line:
    """One message."""

    at: float
    """s of virtual time since the session began."""
    recipient: str
    name: str
    fields: Mapping[str, Any]

    def __str__(self) -> str:
        return "\t".join((f"{self.at:.6f}", self.recipient, self.name, json.dumps(self.fields, ensure_ascii=False)))

    @classmethod
    def read(cls, text: str) -> Line:
        """Return the line of its text form."""
        at, recipient, name, fields = text.rstrip("\n").split("\t", 3)
        return cls(float(at), recipient, name, json.loads(fields))


def write(path: Path, lines: Iterable[Line]) -> None:
    """Write a recording, a line each."""
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def read(path: Path) -> list[Line]:
    """Return the lines of a recording."""
    return [Line.read(text) for text in path.read_text(encoding="utf-8").split("\n") if text]


def kept(name: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a message that are recorded."""
    return {key: value for key, value in fields.items() if (name, key) not in DROPPED}


def file_transfer(payload: bytes) -> dict[str, Any]:
    """Return the header of an FTP payload, and a checksum of its data."""
    size = payload[4]
    return {
        "seq": int.from_bytes(payload[:2], "little"),
        "session": payload[2],
        "opcode": payload[3],
        "size": size,
        "req_opcode": payload[5],
        "burst_complete": payload[6],
        "offset": int.from_bytes(payload[8:12], "little"),
        "crc": zlib.crc32(payload[12 : 12 + size]),
    }


class Texts:
    """Table of texts that have changed: old and new one, each with `{placeholders}` for what is filled in.

    A placeholder of both stands for the same words; one of a single side stands for any words.
    """

    _PLACEHOLDER = re.compile(r"\{(\w*)[^{}]*\}")

    def __init__(self, pairs: Sequence[tuple[str, str]] = ()) -> None:
        self._pairs = [(old, new) for old, new in pairs if old != new]

    def __bool__(self) -> bool:
        return bool(self._pairs)

    @classmethod
    def read(cls, path: Path) -> Texts:
        """Return the table of a file: a line per text, old and new separated by a tab, `#` for comments."""
        rows = [row for row in path.read_text(encoding="utf-8").splitlines() if row and not row.startswith("#")]
        return cls([(old, new) for old, _, new in (row.partition("\t") for row in rows)])

    def same(self, old: str, new: str) -> bool:
        """True when the new text is the old one, or what the table makes of it."""
        if old == new:
            return True
        return any(self._changed(before, after, old, new) for before, after in self._pairs)

    def _changed(self, before: str, after: str, old: str, new: str) -> bool:
        found = re.fullmatch(self._pattern(before, {}), old, re.DOTALL)
        return found is not None and re.fullmatch(self._pattern(after, found.groupdict()), new, re.DOTALL) is not None

    @classmethod
    def _pattern(cls, template: str, values: Mapping[str, str]) -> str:
        pattern, position, named = "", 0, set(values)
        for place in cls._PLACEHOLDER.finditer(template):
            pattern += re.escape(template[position : place.start()])
            position, name = place.end(), place[1]
            if name in values:
                pattern += re.escape(values[name])
            elif name and not name.isdigit() and name not in named:
                pattern += f"(?P<{name}>.*?)"
                named.add(name)
            else:
                pattern += ".*?"
        return pattern + re.escape(template[position:])


@dataclass(frozen=True)
class Difference:
    """What differs at one message: the lines of both recordings, None where there is no such line."""

    kind: str
    """missing, extra, fields or time."""
    old: Line | None
    new: Line | None

    @property
    def at(self) -> float:
        """s of virtual time."""
        line = self.old or self.new
        assert line is not None
        return line.at


def compare(
    old: Sequence[Line], new: Sequence[Line], *, step: float = STEP, texts: Texts | None = None
) -> list[Difference]:
    """Return all differences of two recordings in the order of their times."""
    rules = _Rules(step + SLACK, texts or Texts())
    before, after = rules.streams(old), rules.streams(new)
    found = [
        difference
        for key in before.keys() | after.keys()
        for difference in rules.differences(before.get(key, []), after.get(key, []))
    ]
    return sorted(found, key=lambda difference: (difference.at, str(difference)))


class _Rules:
    """When two lines are the same."""

    def __init__(self, apart: float, texts: Texts) -> None:
        self._apart = apart
        self._texts = texts

    def streams(self, lines: Iterable[Line]) -> dict[tuple[str, str], list[Line]]:
        """Return the lines by recipient and name, repeated ones only once."""
        streams: dict[tuple[str, str], list[Line]] = defaultdict(list)
        for line in lines:
            if line.name == FILES and self._texts:
                continue
            stream = streams[line.recipient, line.name]
            if line.name in REPEATED and stream and stream[-1].fields == line.fields:
                continue
            stream.append(line)
        return streams

    def differences(self, old: Sequence[Line], new: Sequence[Line]) -> Iterable[Difference]:
        """Yield what differs in one stream; after a message that one side lacks the comparison goes on behind it."""
        i = j = 0
        while i < len(old) and j < len(new):
            kind = self._kind(old[i], new[j])
            if kind == "":
                i, j = i + 1, j + 1
            elif i + 1 < len(old) and not self._kind(old[i + 1], new[j]):
                yield Difference("missing", old[i], None)
                i += 1
            elif j + 1 < len(new) and not self._kind(old[i], new[j + 1]):
                yield Difference("extra", None, new[j])
                j += 1
            else:
                yield Difference(kind, old[i], new[j])
                i, j = i + 1, j + 1
        yield from (Difference("missing", line, None) for line in old[i:])
        yield from (Difference("extra", None, line) for line in new[j:])

    def _kind(self, old: Line, new: Line) -> str:
        """Return "fields" or "time", or an empty text when both lines are the same."""
        if old.fields.keys() != new.fields.keys():
            return "fields"
        if not all(self._same(key, old.fields[key], new.fields[key]) for key in old.fields):
            return "fields"
        return "" if abs(old.at - new.at) <= self._apart else "time"

    def _same(self, key: str, old: Any, new: Any) -> bool:
        if old == new or (old != old and new != new):
            return True
        if isinstance(old, str) and isinstance(new, str):
            return self._same_text(old, new)
        if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
            return all(self._same("", a, b) for a, b in zip(old, new, strict=True))
        if key in TIMES and isinstance(old, int | float) and isinstance(new, int | float):
            return abs(old - new) * TIMES[key] <= self._apart
        if isinstance(old, float) and isinstance(new, float) and key not in EXACT:
            return math.isclose(old, new, rel_tol=RELATIVE, abs_tol=ABSOLUTE)
        return False

    def _same_text(self, old: str, new: str) -> bool:
        return bool(self._texts) and self._texts.same(old, new)


def joined(messages: Iterable[tuple[float, Mapping[str, Any]]]) -> Iterable[tuple[float, dict[str, Any]]]:
    """Yield STATUSTEXTs whole, at the time of their last chunk: into how many they are cut follows from the text."""
    parts: dict[int, str] = {}
    for at, fields in messages:
        number, text = fields["id"], fields["text"]
        if number:
            text = parts.pop(number, "") + text
            if len(fields["text"]) == 50:
                parts[number] = text
                continue
        yield at, {key: text if key == "text" else value for key, value in fields.items() if key not in _CHUNK}


_CHUNK = ("id", "chunk_seq")

PROMPT = "anafi> "
"""Ends what the shell prints after a line."""


def printed(messages: Iterable[tuple[float, Mapping[str, Any]]]) -> Iterable[tuple[float, dict[str, Any]]]:
    """Yield what SERIAL_CONTROLs print up to each prompt, at the time of its last piece."""
    text, at = "", 0.0
    for at, fields in messages:
        text += bytes(fields["data"][: fields["count"]]).decode(errors="replace")
        if text.endswith(PROMPT):
            yield at, {"device": fields["device"], "flags": fields["flags"], "text": text}
            text = ""
    if text:
        yield at, {"text": text}


def shown(difference: Difference, old: Sequence[Line], new: Sequence[Line], context: int = 4) -> str:
    """Return a difference as text, with the last lines of both recordings before it."""
    rows = [f"{difference.kind} at {difference.at:.3f} s"]
    for sign, one, lines in (("-", difference.old, old), ("+", difference.new, new)):
        at = difference.at if one is None else one.at
        before = [line for line in lines if line.at <= at and line is not one]
        rows += [f"    {_short(line)}" for line in before[-context:]]
        if one is not None:
            rows.append(f"  {sign} {_short(one, 600)}")
    if difference.old is not None and difference.new is not None:
        changed = [
            f"{key}: {difference.old.fields.get(key)!r} -> {difference.new.fields.get(key)!r}"
            for key in {**difference.old.fields, **difference.new.fields}
            if repr(difference.old.fields.get(key)) != repr(difference.new.fields.get(key))
        ]
        rows.append("  fields that differ: " + "; ".join(changed))
    return "\n".join(rows)


def _short(line: Line, length: int = 160) -> str:
    text = str(line).replace("\t", " ")
    return text if len(text) <= length else text[:length] + " …"


def rebased(lines: Iterable[Line], start: float) -> list[Line]:
    """Return the lines in the order of their times, counted from a start."""
    return sorted((replace(line, at=line.at - start) for line in lines), key=lambda line: line.at)
