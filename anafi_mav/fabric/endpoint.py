"""The gateway's `zenoh://` endpoint: a channel for each station, and one for all readers."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from anafi_mav import texts
from anafi_mav.clock import Clock
from anafi_mav.fabric.arrivals import (
    Arrival,
    FabricSample,
    LinkChange,
    ReadersChange,
    StateQuery,
    TokenChange,
    TokensListed,
)
from anafi_mav.fabric.claims import ClaimStep, SystemClaims
from anafi_mav.fabric.connection import FabricConnection
from anafi_mav.fabric.envelope import MAX_SAMPLE, Pong, UpEnvelope, sender_of
from anafi_mav.fabric.keys import KeyKind, session_of
from anafi_mav.fabric.sample_age import INPUTS, REFUSED, TARGETS, StationInput, StopKind, refusal_of
from anafi_mav.fabric.station_places import MAX_WAITING, StationPlaces
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.base import Endpoint, EndpointUrl, Outbox, Sink, shaped_channel
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import ReceivedFrame
from anafi_mav.mavlink.node import Inbound
from anafi_mav.mavlink.peer_table import REPLACEABLE, PlaceLog
from anafi_mav.mavlink.router import targets
from anafi_mav.units import counted

logger = logging.getLogger(__name__)

STATE_EVERY = 1.0
"""s between two states of a system, between two pings of a station, and between looks at refused system ids."""

FIRST_PINGS = 0.2
"""s between pings until the first is answered: a station's frames are dropped until then."""

UNANSWERED_PINGS, UNANSWERED_FOR = 10, 10.0
"""Pings, and s since the first of them, without an answer or a sample: the station is lost, whatever its token says.
zenoh closes a silent link after as many seconds, but not over a link where the end of a token was lost."""

LIST_LIMIT = 15.0
"""s for a link to the router and a list of the tokens there."""

REPORT_EVERY = 10.0
"""s between two texts about late frames to one station."""

ALL = "*"


class FabricSystems(Protocol):
    """The gateway's systems, as far as the endpoint has to know them."""

    def sysids(self) -> Iterable[int]:
        """Return the system ids of the gateway's drones."""

    def state(self, sysid: int, session: str) -> bytes | None:
        """Return the state of a system as JSON; None while there is none."""

    def is_on_ground(self, sysid: int) -> bool:
        """Return True while the drone is known to stand."""

    def stop_kind(self, sysid: int, inbound: Inbound) -> StopKind | None:
        """Return how a command or SET_MODE to a system stops its flight; None for one that does not."""

    def uses_target(self, sysid: int, inbound: Inbound) -> bool:
        """Return True while a system follows this target or looks at it; the message names none."""

    def is_started(self) -> bool:
        """Return True once drones are connected to; before, an id is looked up and not claimed."""

    def report_id(self, sysid: int, *, is_taken: bool) -> bool:
        """Report to clients that another gateway has this system id, or has it no longer.

        Returns False before the start.
        """


@dataclass
class _Lane:
    """One channel and its samples, which hold frames of one system each."""

    channel: Channel
    outboxes: dict[int, Outbox]

    def flush(self) -> None:
        for outbox in self.outboxes.values():
            outbox.flush()


@dataclass
class _Station:
    """A station on the fabric."""

    lane: _Lane
    input: StationInput
    heard: float
    """Time of its last sample, or of getting its place."""
    pinged: float = 0.0
    unanswered: int = 0
    """Pings since its last sample or answer."""
    waiting_since: float = 0.0
    """Time of the first of these."""
    reported: float = -math.inf
    """Time of the last text about a late frame."""


class FabricEndpoint(Endpoint):
    """Puts the gateway's systems on a zenoh network.

    A station is a channel from the beginning of its liveliness token to its end.
    """

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock, systems: FabricSystems) -> None:
        super().__init__(url, sink, clock)
        self._systems = systems
        self._connection = FabricConnection(url, self.counters, self._arrived)
        shown = url.options.system_ids
        wanted = [sysid for sysid in systems.sysids() if shown is None or sysid in shown]
        self.claims = SystemClaims(self._connection.session_text, wanted)
        self._is_listed = False
        """True while all tokens that exist are known, as far as the router has named them."""
        self._first_look: asyncio.Task[None] | None = None
        """Looks at the router's tokens before the first claim."""
        self._stations: dict[str, _Station] = {}
        self._places = StationPlaces(url.options.max_clients)
        self._place_log = PlaceLog(logger, self.url)
        self._silent: set[str] = set()
        """Stations that were lost by their silence, and whose tokens have not ended; `MAX_WAITING` at most."""
        self._readers: set[int] = set()
        """Systems whose frames to all have a reader."""
        self._open_lane: _Lane | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._stated = -STATE_EVERY
        self._states: dict[int, bytes] = {}
        """The newest published state of each system, which queries get."""
        self._listed = asyncio.Event()
        """Set once all tokens have been reported."""
        self._reported: set[int] = set()
        """Refused ids that clients know of."""

    async def open(self) -> None:
        connection = self._connection
        await connection.open()
        session, keys = connection.zenoh, connection.keys
        session.watch_tokens(keys.drone_token(ALL, ALL))
        session.watch_tokens(keys.station_token(ALL))
        session.declare_token(keys.gateway_token(connection.session_text))
        self._timer = asyncio.get_running_loop().call_later(FIRST_PINGS, self._tick)

    async def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._end_first_look()
        for station in tuple(self._stations):
            self._drop(station)
        self._close_lane()
        await self._connection.close()

    def describe(self) -> str:
        if not self._connection.is_up:
            return f"{self.url}: not connected ({self._connection.problem}), retrying"
        count = len(self._stations)
        kept_off = "".join(
            f", system {sysid} is another gateway's{', too' if sysid in self.claims.held else ''}"
            for sysid in sorted(self.claims.taken)
        )
        lost = sum(station.input.lost for station in self._stations.values())
        lost_on_the_way = f", {lost} of their samples lost" if lost else ""
        return f"{self.url}: connected, {counted(count, 'station')}{lost_on_the_way}{kept_off}"

    async def problems(self) -> list[str]:
        listed = asyncio.ensure_future(self._listed.wait())
        try:
            await asyncio.wait({listed}, timeout=LIST_LIMIT)
        finally:
            listed.cancel()
        if not self._connection.is_up:
            return [f"{self.url}: no router within {LIST_LIMIT:.0f} s ({self._connection.problem})"]
        is_named = self.parsed.options.listen or await self._see_all_tokens()
        found = [
            f"{self.url}: system {sysid} is held by gateway {holder}: give each drone an id of its own"
            for sysid, holder in sorted(self.claims.refused.items())
        ]
        if not is_named:
            found.append(f"{self.url}: the router does not name all system ids that are held: check again")
        return found

    async def _see_all_tokens(self) -> bool:
        """Note all tokens that the router knows; return False when it named no complete list."""
        keys, session = self._connection.keys, self._connection.zenoh
        own = keys.gateway_token(self._connection.session_text)
        look = partial(session.proven_tokens, keys.everything, own)
        tokens = await asyncio.get_running_loop().run_in_executor(None, look)
        for key in map(keys.parse, tokens):
            if key is not None and key.kind is KeyKind.DRONE:
                self.claims.token(key.sysid, key.owner, is_alive=True)
        self._claim()
        return bool(tokens)

    # What the fabric reports.

    def _arrived(self, arrival: Arrival) -> None:
        if isinstance(arrival, FabricSample):
            self._sample(arrival)
        elif isinstance(arrival, TokenChange):
            self._token(arrival)
        elif isinstance(arrival, ReadersChange):
            self._read(arrival)
        elif isinstance(arrival, StateQuery):
            self._answer(arrival)
        elif isinstance(arrival, TokensListed):
            self._begin_claims()
        elif isinstance(arrival, LinkChange):
            self._linked(arrival)

    def _linked(self, change: LinkChange) -> None:
        if change.is_up:
            logger.log(logging.WARNING if self.counters["reopened"] else logging.INFO, "%s: connected", self.url)
            self._connection.zenoh.list_tokens(
                self._connection.keys.drone_token(ALL, ALL), self._connection.keys.station_token(ALL)
            )
        else:
            logger.warning("%s: %s", self.url, change.problem)
            self.counters["reopened"] += 1
            self._end_first_look()
            self._is_listed = False

    def _begin_claims(self) -> None:
        """Claim from now on, and the first time only after a look that finds all tokens.

        The list that zenoh gives a new session can lack the token of a gateway that has had an id for long. Of two
        claims that seem simultaneous the lower session id wins, so a newcomer that did not see it could take the id.
        """
        if not self._connection.is_up:
            return  # a list of before: another follows the next link
        if self.claims.is_settled or self.parsed.options.listen:
            self._allow_claims()
        elif self._first_look is None:
            self._first_look = asyncio.get_running_loop().create_task(self._look_first())

    async def _look_first(self) -> None:
        if not await self._see_all_tokens():
            logger.warning("%s: the router does not name all system ids that are held", self.url)
        self._first_look = None
        self._allow_claims()

    def _end_first_look(self) -> None:
        if self._first_look is not None:
            self._first_look.cancel()
            self._first_look = None

    def _allow_claims(self) -> None:
        self._is_listed = True
        self._listed.set()
        self._claim()

    def _token(self, change: TokenChange) -> None:
        key = self._connection.keys.parse(change.key)
        if key is None:
            self.counters["unknown_keys"] += 1
        elif key.kind is KeyKind.DRONE:
            self.claims.token(key.sysid, key.owner, is_alive=change.is_alive)
            self._claim()
        elif key.kind is KeyKind.STATION:
            if not change.is_alive:
                self._silent.discard(key.owner)
                self._leave(key.owner)
            elif key.owner not in self._silent and not self._places.is_known(key.owner):
                if self._places.arrive(key.owner):
                    self._add(key.owner)
                else:
                    self.counters["refused_peers"] += 1
                    now = self._clock.monotonic()
                    self._place_log.warn("refused", f"station {key.owner} waits: all places are taken", now)

    def _claim(self) -> None:
        keys, session = self._connection.keys, self._connection.zenoh
        can_hold = self._is_listed and self._systems.is_started()
        now = self._clock.monotonic()
        for change in self.claims.decide(now, is_listed=can_hold, can_claim=self._systems.is_on_ground):
            sysid, token = change.sysid, keys.drone_token(change.sysid, self._connection.session_text)
            if change.step is ClaimStep.HOLD:
                session.subscribe(keys.up(sysid, "**"))
                session.answer_queries(keys.state(sysid))
                session.publish_on(keys.down(sysid))
                session.declare_token(token)  # last: stations publish to `up` as soon as they see it
                continue
            also = ", too" if change.step is ClaimStep.CLASH else ""
            logger.critical("%s: system %d is held by gateway %s%s", self.url, sysid, change.holder, also)
            if change.step is ClaimStep.RELEASE:
                for key in (token, keys.up(sysid, "**"), keys.state(sysid), keys.down(sysid)):
                    session.end(key)

    def _add(self, station: str) -> None:
        keys = self._connection.keys
        lane = self._lane(f"{self.url} from {station}", lambda sysid: keys.down(sysid, station))
        lane.channel.ends_with_station = lane.channel.has_ages = True
        self._stations[station] = _Station(lane, StationInput(session_of(station)), self._clock.monotonic())
        self._ping(station)
        self._sink.opened(lane.channel)

    def _leave(self, station: str) -> None:
        """Lose a station, and give its place to one that waits."""
        self._drop(station)
        self._follow(self._places.leave(station))

    def _follow(self, station: str | None) -> None:
        """Serve a station that has got the place of another one."""
        if station is not None:
            logger.info("%s: station %s has a place now", self.url, station)
            self._add(station)

    def _make_room(self, now: float) -> None:
        """Give the places of silent stations to those that wait.

        A silent one waits then, and is not lost.
        """
        silent = sorted(self._stations, key=lambda name: self._stations[name].heard) if self._places.has_waiting else []
        for name in silent:
            station = self._stations[name]
            if now - station.heard < REPLACEABLE or not self._places.has_waiting:
                return
            self.counters["evicted_peers"] += 1
            self._place_log.warn("replaced", f"station {name} gives way, silent for {now - station.heard:.0f} s", now)
            station.lane.channel.ends_with_station = False
            self._drop(name)
            self._follow(self._places.give_way(name))

    def _drop(self, station: str) -> None:
        gone = self._stations.pop(station, None)
        if gone is not None:
            gone.lane.flush()
            gone.lane.channel.close()
            self._sink.closed(gone.lane.channel)

    def _read(self, change: ReadersChange) -> None:
        key = self._connection.keys.parse(change.key)
        if key is None:
            return
        if change.has_readers:
            self._readers.add(key.sysid)
        else:
            self._readers.discard(key.sysid)
        if self._readers and self._open_lane is None:
            self._open_lane = self._lane(self.url, self._connection.keys.down)
            self._sink.opened(self._open_lane.channel)
        elif not self._readers:
            self._close_lane()

    def _close_lane(self) -> None:
        lane, self._open_lane = self._open_lane, None
        if lane is not None:
            lane.channel.close()
            self._sink.closed(lane.channel)

    def _lane(self, name: str, key_of: Callable[[int], str]) -> _Lane:
        outboxes: dict[int, Outbox] = {}

        def write(raw: bytes) -> None:
            sysid = sender_of(raw)
            if sysid not in self.claims.held:
                self.counters["foreign_frames"] += 1  # systems behind other endpoints are not this gateway's to publish
                return
            outbox = outboxes.get(sysid)
            if outbox is None:
                key = key_of(sysid)
                outbox = outboxes[sysid] = Outbox(lambda data: self._connection.publish(key, data), MAX_SAMPLE)
            outbox.add(raw)

        channel = shaped_channel(name, write, self.parsed.options, datagrams=True)
        self._protect(channel)
        return _Lane(channel, outboxes)

    def _sample(self, sample: FabricSample) -> None:
        key = self._connection.keys.parse(sample.key)
        if key is not None and key.owner in self._silent:
            self._silent.discard(key.owner)
            self._token(TokenChange(self._connection.keys.station_token(key.owner), is_alive=True))
        station = None if key is None else self._stations.get(key.owner)
        if key is None or station is None or key.sysid not in self.claims.held:
            self.counters["unknown_keys"] += 1
            return
        token = self._connection.keys.station_token(key.owner)
        self._connection.zenoh.note_heard(token, is_in_use=key.kind is KeyKind.UP)
        station.unanswered = 0
        now = self._clock.monotonic()
        if key.kind is KeyKind.PONG:
            self._pong(station, key.sysid, sample, now)
        elif key.kind is KeyKind.UP:
            self._frames(station, key.sysid, sample, now)

    def _pong(self, station: _Station, sysid: int, sample: FabricSample, now: float) -> None:
        pong = Pong.decode(sample.payload)
        if pong is None or not station.input.pong(pong, sysid, now):
            station.lane.channel.counters["bad_envelopes"] += 1

    def _frames(self, station: _Station, sysid: int, sample: FabricSample, now: float) -> None:
        channel = station.lane.channel
        envelope = UpEnvelope.decode(sample.attachment)
        if envelope is None or len(sample.payload) > MAX_SAMPLE:
            channel.counters["bad_envelopes"] += 1
            return
        if not station.input.is_next(sysid, envelope):
            channel.counters["repeated_samples"] += 1
            return
        station.heard = now
        channel.counters["lost_samples"] = station.input.lost
        station.input.hear(sysid)
        age = station.input.age(envelope, now)
        accepted = []
        for received in channel.receive(sample.payload):
            if targets(received.message)[0] not in (0, sysid):
                channel.counters["misdirected_frames"] += 1
            elif station.input.is_late(received, age, now, self._stop_kind(channel, sysid, received, now)):
                self._refuse(station, sysid, received, now)
            else:
                accepted.append(received)
        if accepted:
            self._sink.received(channel, accepted, frozenset({sysid}))
        station.lane.flush()

    def _stop_kind(self, channel: Channel, sysid: int, received: ReceivedFrame, now: float) -> StopKind | None:
        if not isinstance(received.message, REFUSED):
            return None
        return self._systems.stop_kind(sysid, _inbound(channel, received, now))

    def _refuse(self, station: _Station, sysid: int, received: ReceivedFrame, now: float) -> None:
        """Count a late frame; answer a command, and send a text about commands and inputs."""
        channel, answer = station.lane.channel, refusal_of(received)
        is_command = isinstance(received.message, REFUSED)
        channel.counters["late_frames"] += 1
        if is_command:
            channel.counters["late_commands"] += 1
        if answer is not None:
            compid = targets(received.message)[1] or dialect.MAV_COMP_ID_AUTOPILOT1
            channel.send(answer, sysid, compid, is_answer=True)
        if received.id in INPUTS:
            if received.id in TARGETS and not self._systems.uses_target(sysid, _inbound(channel, received, now)):
                return
            channel.counters["late_inputs"] += 1
        elif not is_command:
            return
        if now - station.reported >= REPORT_EVERY:
            station.reported = now
            text = texts.COMMAND_LATE if is_command else texts.INPUT_LATE
            channel.send(
                dialect.MAVLink_statustext_message(dialect.MAV_SEVERITY_WARNING, text.encode()),
                sysid,
                dialect.MAV_COMP_ID_AUTOPILOT1,
                is_answer=True,
            )

    # What is due by time.

    def _tick(self) -> None:
        try:
            self._act_by_time()
        except Exception:
            logger.exception("%s: a mistake of ours", self.url)
        finally:
            self._timer = asyncio.get_running_loop().call_later(FIRST_PINGS, self._tick)

    def _act_by_time(self) -> None:
        now = self._clock.monotonic()
        self._claim()
        self._make_room(now)
        taken = self.claims.taken
        for sysid in taken ^ self._reported:
            if self._systems.report_id(sysid, is_taken=sysid in taken):
                self._reported ^= {sysid}
        for name in tuple(self._stations):
            self._lose_if_silent(name, now)
        for name in tuple(self._stations):
            self._ping_if_due(name, now)
        if now - self._stated >= STATE_EVERY and self._connection.is_up:
            self._stated = now
            for sysid in sorted(self.claims.held):
                state = self._systems.state(sysid, self._connection.session_text)
                if state is not None:
                    self._states[sysid] = state
                    self._connection.publish(self._connection.keys.state(sysid), state)

    def _lose_if_silent(self, name: str, now: float) -> None:
        station = self._stations[name]
        if station.unanswered >= UNANSWERED_PINGS and now - station.waiting_since >= UNANSWERED_FOR:
            self.counters["silent_stations"] += 1
            logger.warning("%s: station %s lost: silent for %.0f s", self.url, name, now - station.waiting_since)
            if len(self._silent) >= MAX_WAITING:
                self._silent.pop()
            self._silent.add(name)
            self._leave(name)

    def _ping_if_due(self, name: str, now: float) -> None:
        station = self._stations[name]
        if now - station.pinged >= (STATE_EVERY if station.input.has_answered else FIRST_PINGS):
            self._ping(name)

    def _ping(self, name: str) -> None:
        if not self.claims.held:
            return
        now = self._clock.monotonic()
        station = self._stations[name]
        station.pinged = now
        if not station.unanswered:
            station.waiting_since = now
        station.unanswered += 1
        key = self._connection.keys.ping(station.input.ping_system(self.claims.held), name)
        self._connection.publish(key, station.input.ping(self._connection.session, now).encode(), is_urgent=True)

    def _answer(self, query: StateQuery) -> None:
        key, session = self._connection.keys.parse(query.key), self._connection.zenoh
        if key is not None and key.sysid in self.claims.held and key.sysid in self._states:
            session.reply(query.query, query.key, self._states[key.sysid])
        session.finish(query.query)


def _inbound(channel: Channel, received: ReceivedFrame, now: float) -> Inbound:
    return Inbound(received.message, received.id, channel, received.sysid, received.compid, now)
