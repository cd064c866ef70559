"""What holds for the transport and the codec whatever the air, the messages and their order are.

A run is drawn by Hypothesis, which shrinks one that fails to the least that still fails.
"""

from __future__ import annotations

import heapq
import math
import random
from dataclasses import dataclass
from typing import Any

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import anafi_mav.arsdk.messages as tables
from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import Bits, Blob, Message, MessageId, OpenEnum, Scalar, Text, UnknownMessage, unpacked
from anafi_mav.arsdk.link import handshake
from anafi_mav.arsdk.link.frame import decode_frames, encode_frame
from anafi_mav.arsdk.link.transport import ACK_TIMEOUT, Delivered, ReceivedMessages, Role, Transport, Undelivered
from anafi_mav.arsdk.messages import ardrone3

VERSIONS = [1, 2, 3]

LONGEST_STORY = 400
"""Messages of one run: more than version 1 has sequence numbers, so that they wrap."""

CALM = 60.0
"""s at the end of a run in which no one speaks: every acknowledged message arrives in it, for three datagrams in ten
are lost at most. The chance that a frame needs more than 60 s (400 sendings at 1 - 0.7² each) is nil."""


@dataclass(frozen=True)
class Air:
    """What happens to datagrams. Shares are 0..1, `delay` is the longest one in s."""

    loss: float
    duplicate: float
    delay: float
    join: float
    """Share that is held back and glued in front of the next one: several frames in a datagram."""
    cut: float
    """Share that is cut between its frames: each arrives as a datagram of its own."""


AIRS = st.builds(
    Air,
    loss=st.floats(0.0, 0.3),
    duplicate=st.floats(0.0, 0.5),
    delay=st.sampled_from([0.0, 0.003, 0.03, ACK_TIMEOUT, 0.5, 2.0]),
    join=st.floats(0.0, 0.3),
    cut=st.floats(0.0, 1.0),
)


class Weather:
    """Two transports and the air between them, in virtual time."""

    def __init__(self, version: int, air: Air, seed: int) -> None:
        self.now = 0.0
        self.ends = [Transport(role, version, 0.0, ping_after=1e6) for role in (Role.CONTROLLER, Role.DEVICE)]
        self.heard: list[list[Message | UnknownMessage]] = [[], []]
        self.delivered: list[list[int]] = [[], []]
        self.undelivered: list[list[int]] = [[], []]
        self._version = version
        self._air = air
        self._random = random.Random(seed)
        self._flying: list[tuple[float, int, int, bytes]] = []
        self._held = [b"", b""]
        self._count = 0

    def run(self, until: float) -> None:
        while True:
            for end, transport in enumerate(self.ends):
                for datagram in transport.outgoing(self.now):
                    self._throw(1 - end, datagram)
            times = [deadline for end in self.ends if (deadline := end.deadline()) is not None]
            if self._flying:
                times.append(self._flying[0][0])
            if min(times) > until:
                self.now = until
                return
            self.now = max(self.now, min(times))
            for end, transport in enumerate(self.ends):
                self._collect(end, transport.expire(self.now))
            while self._flying and self._flying[0][0] <= self.now:
                _, _, end, datagram = heapq.heappop(self._flying)
                self._collect(end, self.ends[end].receive(datagram, self.now))

    def _throw(self, end: int, datagram: bytes) -> None:
        chance, air = self._random.random, self._air
        if chance() < air.join:
            self._held[end] += datagram
            return
        datagram, self._held[end] = self._held[end] + datagram, b""
        pieces = [datagram]
        if chance() < air.cut:
            frames, garbage = decode_frames(self._version, datagram)
            assert garbage is None
            pieces = [encode_frame(self._version, *frame) for frame in frames]
        for piece in pieces:
            for _ in range(2 if chance() < air.duplicate else 1):
                if chance() >= air.loss:
                    self._count += 1
                    arrival = self.now + self._random.uniform(0.0, air.delay)
                    heapq.heappush(self._flying, (arrival, self._count, end, piece))

    def _collect(self, end: int, events: list[Any]) -> None:
        for event in events:
            if isinstance(event, ReceivedMessages):
                self.heard[end] += unpacked(event.messages)
            elif isinstance(event, Delivered):
                self.delivered[end].append(event.token)
            elif isinstance(event, Undelivered):
                self.undelivered[end].append(event.token)
            else:
                pytest.fail(f"no such thing on a link that only loses, doubles and delays: {event}")


STEPS = st.lists(
    st.tuples(
        st.sampled_from([0.0, 0.0, 0.001, 0.05, 0.4]),  # s until it is said
        st.sampled_from([0, 0, 4, 300, 996, 1200, 3000]),  # bytes of it
        st.integers(1, 40),  # how often, at once
        st.sampled_from([0, 1]),  # by whom
    ),
    min_size=1,
    max_size=24,
)


@pytest.mark.parametrize("version", VERSIONS)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(data=st.data())
def test_each_acknowledged_message_arrives_exactly_once_and_in_order(version: int, data: st.DataObject) -> None:
    """Any split, up to 30 % loss, doubles and any order of datagrams. A version 1 controller gives a command up after
    five repetitions and says so; what it does not give up arrives like everything else."""
    weather = Weather(version, data.draw(AIRS), data.draw(st.integers(0, 2**32 - 1)))
    said: tuple[dict[int, UnknownMessage], dict[int, UnknownMessage]] = ({}, {})
    count = 0
    for pause, size, times, end in data.draw(STEPS):
        weather.run(weather.now + pause)
        for _ in range(times):
            if count < LONGEST_STORY:
                # Version 2 has no way to send a command longer than a frame.
                payload = bytes(min(size, 1390)) if version == 2 else bytes(size)
                message = UnknownMessage(MessageId(250, 0, count), payload)
                said[end][weather.ends[end].send(message, weather.now)] = message
                count += 1
        weather.ends[end].send(ardrone3.AltitudeChanged(1.0), weather.now)  # unacknowledged, in between
    # A queue is stop-and-wait: each message may need some sendings, one after the other.
    weather.run(weather.now + CALM + len(said[0] | said[1]) * (ACK_TIMEOUT + weather._air.delay) * 8)

    for end in (0, 1):
        given_up = set(weather.undelivered[end])
        assert not given_up or (version == 1 and end == 0)
        heard = [message for message in weather.heard[1 - end] if isinstance(message, UnknownMessage)]
        # Every message is accounted for: delivered, or reported as abandoned.
        assert weather.delivered[end] == [token for token in said[end] if token not in given_up]
        # What arrives does so once and in the order of sending; of what was abandoned no one knows.
        certain = [message for token, message in said[end].items() if token not in given_up]
        lost = {message.id for token, message in said[end].items() if token in given_up}
        assert [message for message in heard if message.id not in lost] == certain
        assert [message.id for message in heard] == sorted({message.id for message in heard})


@pytest.mark.parametrize(("version", "type"), [(1, Role.CONTROLLER), (1, Role.DEVICE), (3, Role.DEVICE)])
def test_late_copy_across_number_wrap_is_no_new_message(version: int, type: Role) -> None:
    """Parrot's receiver takes the copy of a frame from before the wrap for a new one; ours does not."""
    speaker = Transport(type, version, 0.0)
    listener = Transport(Role.DEVICE if type is Role.CONTROLLER else Role.CONTROLLER, version, 0.0)
    old: list[bytes] = []
    heard = 0
    for number in range((0xFF if version == 1 else 0xFFFF) + 30):
        speaker.send(UnknownMessage(MessageId(250, 0, number & 0xFFFF), b""), 0.0)
        (datagram,) = speaker.outgoing(0.0)
        heard += len(listener.receive(datagram, 0.0))
        for answer in listener.outgoing(0.0):
            speaker.receive(answer, 0.0)
        old = [*old[-99:], datagram]
        if number % 50 == 0 or number > 0xFFFF or (version == 1 and number > 0xFF):
            assert [event for late in old for event in listener.receive(late, 0.0)] == []
            listener.outgoing(0.0)
    assert heard == (0xFF if version == 1 else 0xFFFF) + 30


# -- codec

_BITS = {"b": 8, "h": 16, "i": 32, "q": 64}

_INTEGERS = {
    "B": (0, 8),
    "b": (1, 8),
    "H": (0, 16),
    "h": (1, 16),
    "I": (0, 32),
    "i": (1, 32),
    "Q": (0, 64),
    "q": (1, 64),
}


def values(type: Any, python: type) -> st.SearchStrategy[Any]:
    """All that a wire type can carry."""
    if isinstance(type, Text):
        return st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=40)
    if isinstance(type, Blob):
        return st.binary(max_size=60)
    scalar = type.base if isinstance(type, Bits) else type
    assert isinstance(scalar, Scalar)
    if scalar.code == "f":
        return st.floats(width=32)
    if scalar.code == "d":
        return st.floats()
    bits = _BITS[scalar.code.lower()]
    lowest = -(1 << bits - 1) if scalar.code.islower() else 0
    numbers = st.integers(lowest, lowest + (1 << bits) - 1)
    return numbers.map(python) if issubclass(python, OpenEnum) else numbers


def same(left: object, right: object) -> bool:
    if isinstance(left, float) and isinstance(right, float):
        return left == right or (math.isnan(left) and math.isnan(right))
    return left == right


PLAIN = [message for message in wire.declared_messages() if message.ID.project != 133]


def test_the_tables_are_here() -> None:
    assert tables.__doc__
    assert len(PLAIN) > 300


@settings(max_examples=1000, deadline=None)
@given(data=st.data())
def test_message_decodes_to_the_encoded_values(data: st.DataObject) -> None:
    message = data.draw(st.sampled_from(PLAIN))
    arguments = [data.draw(values(type, python)) for _, type, python in wire.wire_fields(message)]
    sent = message(*arguments)
    got = wire.decode(wire.encode(sent))
    assert isinstance(got, message)
    assert all(map(same, msgspec.structs.astuple(sent), msgspec.structs.astuple(got)))


# -- handshake


@settings(max_examples=300, deadline=None)
@given(name=st.text(max_size=60), serial=st.text(max_size=40), port=st.integers(1, 65535), data=st.data())
def test_announcement_is_decoded_in_any_split(name: str, serial: str, port: int, data: st.DataObject) -> None:
    info = handshake.DeviceInfo(0x0914, serial, port, name)
    text = handshake.format_discovery(info)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(text) - 2), max_size=5)))
    for cut in cuts:
        assert handshake.parse_discovery(text[:cut]) is None
    assert handshake.parse_discovery(text) == info
