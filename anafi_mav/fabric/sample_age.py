"""Age of what a station sends, and the rules for repeated and late samples. No I/O.

Neither side knows the other's clock. Each answered ping encloses the offset between them: the station read its clock
after the gateway sent the ping and before the answer arrived. The narrowest of these intervals counts, and its middle
is the offset. An interval that does not overlap an older one shows that a clock has jumped, as in a computer that
slept; the older one is then dropped.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from anafi_mav.fabric.envelope import Ping, Pong, UpEnvelope, micros
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import ReceivedFrame

INPUT_LIMIT = 0.3
"""s after which setpoints, sticks, targets and gimbal rates are too old: longer than a network takes, shorter than the
0.5 s after which their silence stops the drone."""

LIMIT = 2.0
"""s after which everything is too old: its sender has given it up or sends it again."""

OFFSET_WINDOW = 60.0
"""s that an answered ping counts. Clocks of computers differ by 100 µs in a second at most: 6 ms in this time."""

DRIFT = 0.01
"""s that clocks may drift within that window."""

EARLY_LIMIT = 0.1
"""s that a sample may be sent in the future, beside the uncertainty of the offset."""

MAX_PONGS = 64
"""Answered pings that are remembered: one in a second."""

MAX_REFUSALS = 64
"""Commands refused for their age that are remembered for each station."""

INPUTS = frozenset(
    {
        dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET,
        dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
        dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
        dialect.MAVLINK_MSG_ID_MANUAL_CONTROL,
        dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE,
        dialect.MAVLINK_MSG_ID_FOLLOW_TARGET,
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        dialect.MAVLINK_MSG_ID_MOUNT_CONTROL,
        dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_ATTITUDE,
        dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_PITCHYAW,
        dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_MANUAL_CONTROL,
    }
)
"""Messages that move the drone or its gimbal until the next one arrives."""

TARGETS = frozenset({dialect.MAVLINK_MSG_ID_FOLLOW_TARGET, dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT})
"""Those that name no drone: stations send them to all, whether one follows them or not."""

COMMANDS = (dialect.MAVLink_command_long_message, dialect.MAVLink_command_int_message)
"""Messages that are answered though they are too old."""

REFUSED = (*COMMANDS, dialect.MAVLink_set_mode_message)
"""Messages whose sender is informed that they are too old. SET_MODE has no answer but a text."""


class StopKind(Enum):
    """Kind of a message that stops the flight, which decides how old it may be.

    A person must always be able to stop the drone: an acknowledgement that says "too late" stops nothing.
    """

    IN_PLACE = "Hold, Position, pause, Land, disarm: takes effect at any age"
    HOME = "Return: moves the drone, so it takes effect when its age is unknown, and not when it is known to be old"


@dataclass(frozen=True)
class _Interval:
    """Bounds of the gateway's clock minus the station's, s."""

    low: float
    high: float
    at: float
    """When the answer arrived, s of the gateway's clock."""


class ClockOffset:
    """Offset between the clocks of a gateway and a station."""

    def __init__(self) -> None:
        self._intervals: deque[_Interval] = deque(maxlen=MAX_PONGS)

    def answered(self, ping_sent: float, answered: float, now: float) -> None:
        """Note a ping sent at `ping_sent`, answered at `answered`, back at `now`.

        s; `answered` is of the station's clock.
        """
        newest = _Interval(ping_sent - answered, now - answered, now)
        if newest.high < newest.low:
            return
        while self._intervals and now - self._intervals[0].at > OFFSET_WINDOW:
            self._intervals.popleft()
        overlapping = [
            old for old in self._intervals if old.low - DRIFT <= newest.high and newest.low - DRIFT <= old.high
        ]
        self._intervals = deque([*overlapping, newest], maxlen=MAX_PONGS)

    def age(self, sent: float, now: float) -> float | None:
        """Return how long before `now` a station's time was, s; None while its clock is not known.

        A time in the future shows that a clock has jumped, as in a gateway that was suspended.
        """
        known = [one for one in self._intervals if now - one.at <= OFFSET_WINDOW]
        if not known:
            return None
        best = min(known, key=lambda one: one.high - one.low)
        age = now - (sent + (best.low + best.high) / 2.0)
        return None if age < -((best.high - best.low) / 2.0 + EARLY_LIMIT) else age


@dataclass
class StationInput:
    """Judges the samples of one station."""

    session: int
    """Of its ground process."""
    offset: ClockOffset = field(default_factory=ClockOffset)
    lost: int = 0
    """Samples that were published and had not arrived when a newer one did."""
    _pings: deque[Ping] = field(default_factory=lambda: deque(maxlen=MAX_PONGS))
    """Sent and not answered."""
    _newest: dict[int, int] = field(default_factory=dict)
    """Number of the newest sample by system."""
    _heard: int = 0
    """System to which the station sent last; 0: none yet."""
    _pinged: int = 0
    """System of the last ping; 0: none yet."""
    _has_answered: bool = False
    _refused: dict[tuple[Any, ...], float] = field(default_factory=dict)
    """When a command was refused for its age, s of the gateway's clock."""

    @property
    def has_answered(self) -> bool:
        """True once it has answered a ping."""
        return self._has_answered

    def hear(self, sysid: int) -> None:
        """Note a sample of the station to a system, whatever its age."""
        self._heard = sysid

    def ping_system(self, held: Collection[int]) -> int:
        """Return the system over whose key the next ping goes; one of `held`.

        A router may give the station only some systems. It has the one to which it sent last; before its first sample,
        each held id is tried in turn until a ping is answered.
        """
        if self._heard in held:
            self._pinged = self._heard
        elif not (self._has_answered and self._pinged in held):
            self._pinged = min((sysid for sysid in held if sysid > self._pinged), default=min(held))
        return self._pinged

    def ping(self, gateway: int, now: float) -> Ping:
        """Return the next ping to the station."""
        ping = Ping(gateway, micros(now))
        self._pings.append(ping)
        return ping

    def pong(self, pong: Pong, sysid: int, now: float) -> bool:
        """Note the answer to a ping over a system's key; False for an unexpected one.

        It was not sent, or has been answered.
        """
        ping = Ping(pong.session, pong.ping_sent)
        if ping not in self._pings:
            return False
        self._pings.remove(ping)
        self._has_answered, self._pinged = True, sysid
        self.offset.answered(pong.ping_sent / 1e6, pong.answered / 1e6, now)
        return True

    def is_next(self, sysid: int, envelope: UpEnvelope) -> bool:
        """Return True for a sample of this session that is newer than all before it.

        Numbers left out since the one before add to `lost`. A station's first sample may have any number: it goes on
        counting when the gateway starts again.
        """
        newest = self._newest.get(sysid)
        if envelope.session != self.session or (newest is not None and envelope.number <= newest):
            return False
        if newest is not None:
            self.lost += envelope.number - newest - 1
        self._newest[sysid] = envelope.number
        return True

    def age(self, envelope: UpEnvelope, now: float) -> float | None:
        """Return the age of a sample, s; None while the station's clock is not known."""
        return self.offset.age(envelope.sent / 1e6, now)

    def is_late(self, received: ReceivedFrame, age: float | None, now: float, stop: StopKind | None = None) -> bool:
        """Return True for a frame that is too old to have an effect.

        `stop`: how it stops the flight, None for what does not. A command that the station sent before it could read
        the refusal of an equal one is a repetition of that attempt, and refused too: otherwise a refused command would
        be carried out a moment later.
        """
        if stop is StopKind.IN_PLACE or (stop is StopKind.HOME and age is None):
            return False
        limit = INPUT_LIMIT if received.id in INPUTS else LIMIT
        is_late = age is None or age > limit
        if not isinstance(received.message, REFUSED):
            return is_late
        attempt = _attempt(received)
        if not is_late:
            assert age is not None
            is_late = now - age <= self._refused.get(attempt, -1.0)
        if is_late:
            self._refused.pop(attempt, None)
            self._refused[attempt] = now
            if len(self._refused) > MAX_REFUSALS:
                del self._refused[next(iter(self._refused))]
        return is_late


def _attempt(received: ReceivedFrame) -> tuple[Any, ...]:
    """Return what is equal in a command and its repetitions: all but its confirmation."""
    message = received.message
    fields = tuple(repr(getattr(message, name)) for name in message.fieldnames if name != "confirmation")
    return (received.id, received.sysid, received.compid, *fields)


def refusal_of(received: ReceivedFrame) -> dialect.MAVLink_command_ack_message | None:
    """Return the answer to a late command; None for another message."""
    message = received.message
    if not isinstance(message, COMMANDS):
        return None
    result = dialect.MAV_RESULT_TEMPORARILY_REJECTED
    return dialect.MAVLink_command_ack_message(message.command, result, 0, 0, received.sysid, received.compid)
