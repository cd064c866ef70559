"""MAVLink service for the parameter protocol: lists, reads, writes and changes.

A changed value is sent to all clients. The parameters are in `parameter_table*`; a channel sees the native ones and
the aliases of its flavour. The list of a flavour is made when the drone first connects and stays the same until another
aircraft has its address. Rules: MAVLink parameter.md, conformance A5, C4, R12, R13.
"""

from __future__ import annotations

import asyncio
import math
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.drone.events import Message
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.component_metadata import to_json
from anafi_mav.services.files import Query, ServedFile
from anafi_mav.services.flavours import FLAVOURS, Flavour, flavour_of
from anafi_mav.services.paced_sender import PacedSender
from anafi_mav.services.parameter.parameter import Parameter
from anafi_mav.services.parameter.parameter_codec import (
    HASH_NAME,
    NO_INDEX,
    ParamType,
    carried,
    hash_check,
    name_of,
    packed_file,
    param_value,
)
from anafi_mav.services.parameter.parameter_metadata import parameter_file
from anafi_mav.services.parameter.parameter_table import NATIVE
from anafi_mav.services.parameter.parameter_table_ardupilot import ARDUPILOT_NAMES
from anafi_mav.services.parameter.parameter_table_fence import FENCE_NATIVE
from anafi_mav.services.parameter.parameter_table_follow import FOLLOW_NATIVE
from anafi_mav.services.parameter.parameter_table_px4 import PX4_NAMES
from anafi_mav.services.service import Host, MessageHandler, Service
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import FlightSettings
from anafi_mav.vehicle.base.refusal import Refused, reason_of
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions

MAX_WRITES = 8
"""Writes under way at once. A drone answers one within tens of milliseconds; several clients load their files."""

MAX_PACKED = 8
"""Different parts of param.pck that are kept: clients ask for the whole, or for a few."""

KEY = "parameters"
"""In the drone's memory: those of the gateway's own settings that are kept, by native name."""

REFUSAL_EVERY = 0.5
"""s between texts to one channel about writes that were refused: one for a user who changes a value, a few for a
program that loads a whole file."""

MAX_WAITING = 512
"""Writes that wait for their turn: a whole list, from two clients. What comes beyond that comes again (1 s later)."""


NATIVE_NAMES: tuple[Parameter, ...] = (*NATIVE, *FENCE_NATIVE, *FOLLOW_NATIVE)
"""Parameters that every client sees, whatever its flavour."""

NAME_TABLES: dict[str, tuple[Parameter, ...]] = {"px4": PX4_NAMES, "ardupilot": ARDUPILOT_NAMES}
"""By `Flavour.parameter_names`."""

KEPT = tuple(parameter for parameter in NATIVE_NAMES if parameter.put is not None)


def parameters_of(flavour: Flavour) -> tuple[Parameter, ...]:
    """Return all parameters for clients of a flavour, sorted by name.

    Which of them a drone has is another matter.
    """
    return tuple(sorted((*NATIVE_NAMES, *NAME_TABLES[flavour.parameter_names]), key=lambda parameter: parameter.name))


_RAW = struct.Struct("<d")

_UNREPORTED = _RAW.pack(math.nan)
"""In place of a value that no client has received: no parameter has it."""


class ParameterWrite(NamedTuple):
    """A PARAM_SET that is to be carried out."""

    inbound: Inbound
    parameter: Parameter
    value: float

    def is_like(self, other: ParameterWrite) -> bool:
        """Return True for a write of the same parameter by the same client."""
        return self.parameter is other.parameter and self.inbound.client == other.inbound.client


class ParameterTable(NamedTuple):
    """Parameters in the sequence of their list, and what follows from them."""

    parameters: Sequence[Parameter]
    places: Mapping[str, int]
    """Place of each by its name."""
    polled: Sequence[int]
    """Places of the gateway's own settings."""
    updated_by: Mapping[type[Message], Sequence[int]]
    """Places of those that an event may change."""


_known_tables: dict[tuple[int, ...], ParameterTable] = {}
"""By the identities of the parameters: drones with the same ones share it."""


def _table_of(parameters: Sequence[Parameter]) -> ParameterTable:
    """Return the table of these parameters."""
    key = tuple(map(id, parameters))
    if key not in _known_tables:
        updated_by: dict[type[Message], list[int]] = {}
        for place, parameter in enumerate(parameters):
            for event in parameter.updates:
                updated_by.setdefault(event, []).append(place)
        places = {parameter.name: place for place, parameter in enumerate(parameters)}
        polled = [place for place, parameter in enumerate(parameters) if parameter.polled]
        _known_tables[key] = ParameterTable(parameters, places, polled, updated_by)
    return _known_tables[key]


class ParameterList:
    """The parameters of one vehicle as one flavour lists them."""

    def __init__(self, host: Host, flavour: Flavour) -> None:
        self._host = host
        self._flavour = flavour
        self.table = _table_of([one for one in parameters_of(flavour) if one.present(host.drone)])
        self.parameters, self.index = self.table.parameters, self.table.places
        self._announced = bytearray(b"".join(map(self._raw, self.parameters)))
        """The values that were last reported to all clients."""
        self.changes: Counter[int] = Counter()
        """How often each was reported to all clients, by its place."""
        self.version = 0
        """How often any of them has changed."""

    def __len__(self) -> int:
        return len(self.parameters)

    def message(self, index: int) -> dialect.MAVLink_message:
        """PARAM_VALUE of one."""
        parameter = self.parameters[index]
        return param_value(
            parameter.name,
            parameter.value(self._host),
            parameter.kind,
            count=len(self),
            index=index,
            bytewise=self._flavour.bytewise,
        )

    def values(self) -> list[tuple[str, float, ParamType]]:
        """Return name, value and type of all, in the sequence of the list."""
        return [(one.name, one.value(self._host), one.kind) for one in self.parameters]

    def hash_message(self) -> dialect.MAVLink_message:
        """PARAM_VALUE of the hash over all that do not change by themselves."""
        lasting = [(one.name, one.value(self._host), one.kind) for one in self.parameters if not one.volatile]
        return param_value(
            HASH_NAME, hash_check(lasting), ParamType.UINT32, count=len(self), index=NO_INDEX, bytewise=True
        )

    def changed(self, candidates: Iterable[int]) -> list[int]:
        """Return the candidates whose value differs from the last reported one.

        From now on they count as reported.
        """
        found = []
        for index in candidates:
            raw, place = self._raw(self.parameters[index]), slice(index * _RAW.size, (index + 1) * _RAW.size)
            if raw != self._announced[place]:
                self._announced[place] = raw
                self.changes[index] += 1
                self.version += 1
                found.append(index)
        return found

    def follow(self, before: ParameterList) -> None:
        """Count as reported what the list of another aircraft has reported: the rest has changed."""
        self.version = before.version + 1
        for place, parameter in enumerate(self.parameters):
            known = before.index.get(parameter.name)
            raw = _UNREPORTED if known is None else before._announced[known * _RAW.size : (known + 1) * _RAW.size]
            self._announced[place * _RAW.size : (place + 1) * _RAW.size] = raw

    def _raw(self, parameter: Parameter) -> bytes:
        """Bytes, so that NaN is equal to NaN."""
        return _RAW.pack(parameter.value(self._host))


class ParameterService(Service):
    """PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET of one vehicle, on component 1."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._lists: dict[str, ParameterList] = {}
        """By name of the flavour; empty until the drone has connected for the first time."""
        self._serial: str | None = None
        """Serial number of the drone whose parameters these are."""
        self._own: list[Callable[[Host], float]] = []
        """Functions that read the gateway's own settings, each once."""
        self._own_packer = struct.Struct("")
        self._seen = b""
        """Their values at the last look."""
        self._sender = PacedSender(host)
        self._refused_at: dict[Channel, float] = {}
        """When a text was last sent about a refused write."""
        self._waiting: list[ParameterWrite] = []
        self._under_way: list[ParameterWrite] = []
        self._writers: set[asyncio.Task[None]] = set()
        self._restored = -1
        """Generation of the stored data that the settings are from."""
        self._locks: dict[str, asyncio.Lock] = {}
        """One for each value, by its native name: two writes of it are carried out in their order."""
        self._storing = asyncio.Lock()
        """Held while changed settings are stored, until every client has been notified of them."""
        self._packed_files: dict[str, tuple[int, dict[str, bytes]]] = {}
        """By name of the flavour: param.pck by its query, and how often the values had changed when it was made."""

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._request_list,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._request_read,
            dialect.MAVLINK_MSG_ID_PARAM_SET: self._set,
        }

    def files(self) -> Mapping[str, ServedFile]:
        return {
            "/parameter.json": ServedFile(self._described, metadata=dialect.COMP_METADATA_TYPE_PARAMETER),
            "/@PARAM/param.pck": ServedFile(self._packed, packed=True),
        }

    def list_of(self, flavour: Flavour) -> ParameterList:
        """The parameters that clients of a flavour see. Once the drone has connected."""
        return self._lists[flavour.name]

    def link_up(self) -> None:
        is_other = self.host.drone.identity.serial != self._serial
        if is_other:
            self._serial = self.host.drone.identity.serial
            self.host.vehicle.settings = FlightSettings()  # speeds and hand launch were set for another aircraft
        self._restore()
        is_first = not self._lists
        if is_other:
            self._make_lists()
        if is_first:
            return  # the new lists hold the values of now
        for name, listed in self._lists.items():
            self._tell(name, listed.changed(range(len(listed))))

    def _make_lists(self) -> None:
        """List the parameters that this aircraft has.

        Models differ, and each aircraft has the same address in its Wi-Fi.
        """
        before = self._lists
        self._lists = {flavour.name: ParameterList(self.host, flavour) for flavour in FLAVOURS.values()}
        for name, listed in before.items():
            self._lists[name].follow(listed)
        polled = (listed.parameters[place] for listed in self._lists.values() for place in listed.table.polled)
        self._own = list({one.name: one.read for one in polled if not one.derived}.values())
        self._own_packer = struct.Struct(f"<{len(self._own)}d")

    def link_down(self) -> None:
        self._sender.clear()
        self._waiting.clear()  # the writers end with the host's tasks

    def channel_closed(self, channel: Channel) -> None:
        self._sender.closed(channel)
        self._refused_at.pop(channel, None)

    def subscriptions(self) -> Subscriptions:
        events = {event for listed in self._lists.values() for event in listed.table.updated_by}
        return dict.fromkeys(events, self._on_value)

    def _on_value(self, message: Message, now: float) -> None:
        for name, listed in self._lists.items():
            self._tell(name, listed.changed(listed.table.updated_by.get(type(message), ())))

    def tick(self, now: float) -> float:
        if not self._storing.locked() and self._own_values() != self._seen:
            self.host.spawn(self._settle())
        return NEVER

    # What outlives the gateway.

    def _restore(self) -> None:
        """Restore the stored settings of this drone, and defaults for those absent or invalid."""
        if self.host.memory.generation == self._restored:
            return
        self._restored = self.host.memory.generation
        found = self.host.memory.settings.get(KEY)
        kept = found if isinstance(found, dict) else {}
        for parameter in KEPT:
            assert parameter.put is not None
            assert parameter.default is not None
            value = kept.get(parameter.name)
            if not isinstance(value, int | float) or not parameter.accepts(self.host, value):
                value = parameter.default
            parameter.put(self.host, value)

    async def _keep(self) -> None:
        """Store the gateway's own settings, so that they hold when it comes back."""
        now = {one.name: one.value(self.host) for one in KEPT}
        settings = self.host.memory.settings
        if now != settings.get(KEY, {one.name: one.default for one in KEPT}):
            settings[KEY] = now
            if (problem := await self.host.memory.save()) is not None:
                self.host.warn_throttled(problem)

    # Files.

    def _described(self, flavour: Flavour, query: Query) -> bytes:
        return to_json(parameter_file(self._lists[flavour.name].parameters, self.host))

    def _packed(self, flavour: Flavour, query: Query) -> bytes | None:
        """ArduPilot's file of all values, or of `count` from `start` on.

        PX4's clients do not look for it, and MAVProxy takes its integers for floats.
        """
        if query.keys() - {"start", "count", "withdefaults"}:
            return None
        numbers = {name: text for name, text in query.items() if text.isascii() and text.isdigit() and len(text) < 6}
        if numbers.keys() != query.keys():
            return None
        listed = self._lists[flavour.name]
        version, made = self._packed_files.get(flavour.name, (-1, {}))
        if version != listed.version:
            made = {}
            self._packed_files[flavour.name] = (listed.version, made)
        key = f"{numbers.get('start', '')}+{numbers.get('count', '')}"
        if key not in made:
            if len(made) >= MAX_PACKED:
                made.clear()
            count = int(numbers.get("count", "0")) or None
            made[key] = packed_file(listed.values(), int(numbers.get("start", "0")), count)
        return made[key]

    def denials(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_PARAM_SET: self._deny}

    # Reading.

    def _request_list(self, inbound: Inbound) -> None:
        """Send the list by the paced sender; PX4's clients get the hash before it.

        A client that has the whole list in its cache stops the list when it has received the hash.
        """
        flavour = flavour_of(inbound.channel)
        listed = self._lists[flavour.name]

        def messages() -> Iterator[dialect.MAVLink_message]:
            if flavour.bytewise:
                yield listed.hash_message()
            for index in range(len(listed)):
                yield listed.message(index)

        self._sender.start(inbound.channel, inbound.client, messages())

    def _request_read(self, inbound: Inbound) -> None:
        if self._storing.locked():  # a value that is read has to be one that is stored
            self.host.spawn(self._read_when_stored(inbound))
        else:
            self._read(inbound)

    async def _read_when_stored(self, inbound: Inbound) -> None:
        async with self._storing:
            self._read(inbound)

    def _read(self, inbound: Inbound) -> None:
        message = inbound.message
        flavour = flavour_of(inbound.channel)
        listed = self._lists[flavour.name]
        name = name_of(message.param_id)
        index = message.param_index if message.param_index >= 0 else listed.index.get(name, -1)
        if message.param_index < 0 and name == HASH_NAME and flavour.bytewise:
            self.host.send(listed.hash_message(), inbound.channel)
        elif 0 <= index < len(listed):
            self.host.send(listed.message(index), inbound.channel)
        else:
            self._error(inbound, dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST)

    # Writing.

    def _set(self, inbound: Inbound) -> None:
        message = inbound.message
        flavour = flavour_of(inbound.channel)
        name = name_of(message.param_id)
        if name == HASH_NAME and flavour.bytewise:
            self._sender.stop(inbound.channel, inbound.client)
            return
        listed = self._lists[flavour.name]
        index = listed.index.get(name)
        if index is None:
            self._error(inbound, dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST)
            return
        parameter = listed.parameters[index]
        # ArduPilot's clients do not know the types: ArduPilot itself looks at the name alone.
        if flavour.bytewise and message.param_type != parameter.kind.mav:
            self._refuse(inbound, dialect.MAV_PARAM_ERROR_TYPE_MISMATCH, texts.WRONG_TYPE)
            return
        value = carried(message.param_value, parameter.kind, bytewise=flavour.bytewise)
        if parameter.write is None:
            if parameter.kind.is_same(value, parameter.value(self.host)):
                self._answer(inbound)
            else:
                self._refuse(inbound, dialect.MAV_PARAM_ERROR_READ_ONLY, texts.READ_ONLY)
            return
        if not parameter.accepts(self.host, value):
            self._refuse(inbound, dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE, texts.OUT_OF_RANGE)
            return
        self._queue(ParameterWrite(inbound, parameter, value))

    def _queue(self, write: ParameterWrite) -> None:
        """Write when it is its turn.

        What a client repeats while it still waits replaces the old one. What it repeats of a write under way will be
        answered by that: written once more, it would undo what another client has set since.
        """
        for place, waiting in enumerate(self._waiting):
            if waiting.is_like(write):
                self._waiting[place] = write
                return
        newest = next((one for one in reversed(self._under_way) if one.is_like(write)), None)
        if newest is not None and newest.value == write.value:
            return
        if len(self._waiting) < MAX_WAITING:
            self._waiting.append(write)
        if len(self._writers) < MAX_WRITES:
            writer = self.host.spawn(self._work())
            self._writers.add(writer)
            writer.add_done_callback(self._writers.discard)

    async def _work(self) -> None:
        """Carry out writes for as long as there are any."""
        while self._waiting:
            write = self._waiting.pop(0)
            self._under_way.append(write)
            try:
                await self._write(*write)
            finally:
                self._under_way.remove(write)

    async def _write(self, inbound: Inbound, parameter: Parameter, value: float) -> None:
        assert parameter.write is not None
        listed = self._lists[flavour_of(inbound.channel).name]
        index = listed.index[parameter.name]
        before = listed.changes[index]
        lock = self._locks.setdefault(parameter.native or parameter.name, asyncio.Lock())
        async with lock:
            if self.host.change_objection(inbound) is not None:  # another station has become the operator meanwhile
                self._deny(inbound)
                return
            try:
                await parameter.write(self.host, value)
            except AnafiMavError as error:
                if isinstance(error, Refused) and error.lasting:  # the value, not the moment
                    self._refuse(inbound, dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE, error.reason)
                    return
                self.host.text(
                    Severity.WARNING,
                    texts.PARAMETER_NOT_SET.fill(name=parameter.name, reason=reason_of(error)),
                    inbound.channel,
                )
        await self._settle()
        if listed.changes[index] == before:  # otherwise every client was notified, this one too
            self._answer(inbound)

    # Telling.

    def _own_values(self) -> bytes:
        """Bytes, so that NaN is equal to NaN."""
        host = self.host
        return self._own_packer.pack(*[read(host) for read in self._own])

    async def _settle(self) -> None:
        """Store the gateway's own settings that have changed, then notify every client of them.

        In this order: what a client has read back must hold also when the gateway is killed in the next instant.
        """
        async with self._storing:
            while (now := self._own_values()) != self._seen:
                self._seen = now
                await self._keep()  # meanwhile at most as many change as there are writers: each waits for us
            for name, listed in self._lists.items():
                self._tell(name, listed.changed(listed.table.polled))

    def _tell(self, name: str, indices: list[int]) -> None:
        """PARAM_VALUE of these to every channel of a flavour."""
        if not indices:
            return
        channels = [channel for channel in self.host.channels if flavour_of(channel).name == name]
        if channels:
            for index in indices:
                self.host.send(self._lists[name].message(index), channels)

    def _answer(self, inbound: Inbound) -> None:
        """Send the value in effect to the client of the request."""
        listed = self._lists[flavour_of(inbound.channel).name]
        self.host.send(listed.message(listed.index[name_of(inbound.message.param_id)]), inbound.channel)

    def _refuse(self, inbound: Inbound, error: int, why: OperatorText) -> None:
        """Refuse a write: send PARAM_ERROR, the value in effect and a text to the sender.

        QGroundControl 4 does not know PARAM_ERROR.
        """
        self._error(inbound, error)
        self._answer(inbound)
        now, channel = self.host.clock.monotonic(), inbound.channel
        if channel.is_open and now - self._refused_at.get(channel, -math.inf) >= REFUSAL_EVERY:
            self._refused_at[channel] = now
            text = texts.PARAMETER_NOT_SET.fill(name=name_of(inbound.message.param_id), reason=why)
            self.host.text(Severity.WARNING, text, channel)

    def _deny(self, inbound: Inbound) -> None:
        """Send the error and the value in effect: the endpoint does not permit the write."""
        self._error(inbound, dialect.MAV_PARAM_ERROR_PERMISSION_DENIED)
        if name_of(inbound.message.param_id) in self._lists[flavour_of(inbound.channel).name].index:
            self._answer(inbound)

    def _error(self, inbound: Inbound, error: int) -> None:
        message: Any = inbound.message
        self.host.send(
            dialect.MAVLink_param_error_message(
                inbound.sysid,
                inbound.compid,
                name_of(message.param_id).encode(),
                getattr(message, "param_index", -1),
                error,
            ),
            inbound.channel,
        )
