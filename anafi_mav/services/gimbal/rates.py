"""A rate of the gimbal over time: how long it goes on, and what ends it. No I/O.

The drone turns with a rate until its next target or the end of the range. So the end has to be commanded:

- a rate by message (GIMBAL_MANAGER_SET_ATTITUDE and others) ends when none has arrived for a second and a bit;
- a rate by command goes on, as MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW says, until its sender's heartbeats stop, if it sends
  any. MAVSDK's example sends one rate and waits five seconds.

A zero rate, an angle, the end of an axis' range, and another client's control end both.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Mapping

from anafi_mav.drone import Aim
from anafi_mav.drone.events import Axis
from anafi_mav.services.gimbal.control import ClientId, Heartbeats

MESSAGE_SILENCE = 1.2
"""s without a rate by message. MAVProxy's gimbal module sends one a second, and each a little late: after exactly one
second the gimbal would stop and start again with each of them."""

COMMAND_SILENCE = 3.0
"""s without heartbeats of a client whose rate by command is in force."""


class RateState(enum.Enum):
    STILL = "no rate is in force"
    BY_MESSAGE = "a rate by message is in force"
    BY_COMMAND = "a rate by command is in force"


class RateEvent(enum.Enum):
    MESSAGE = "a rate by message"
    COMMAND = "a rate by command"
    TARGET = "an angle, or a zero rate on every axis"
    SILENCE = "no further message, or no heartbeats of the sender"
    LIMIT = "the last axis that turns is at the end of its range"
    CONTROL = "its sender releases control, or another client or the mission takes it"


TRANSITIONS: dict[RateState, dict[RateEvent, RateState]] = {
    RateState.STILL: {
        RateEvent.MESSAGE: RateState.BY_MESSAGE,
        RateEvent.COMMAND: RateState.BY_COMMAND,
        RateEvent.TARGET: RateState.STILL,
        RateEvent.CONTROL: RateState.STILL,
    },
    RateState.BY_MESSAGE: {
        RateEvent.MESSAGE: RateState.BY_MESSAGE,
        RateEvent.COMMAND: RateState.BY_COMMAND,
        RateEvent.TARGET: RateState.STILL,
        RateEvent.SILENCE: RateState.STILL,
        RateEvent.LIMIT: RateState.STILL,
        RateEvent.CONTROL: RateState.STILL,
    },
    RateState.BY_COMMAND: {
        RateEvent.MESSAGE: RateState.BY_MESSAGE,
        RateEvent.COMMAND: RateState.BY_COMMAND,
        RateEvent.TARGET: RateState.STILL,
        RateEvent.SILENCE: RateState.STILL,
        RateEvent.LIMIT: RateState.STILL,
        RateEvent.CONTROL: RateState.STILL,
    },
}
"""A missing pair cannot occur: without a rate nothing falls silent or reaches a limit."""


class GimbalRates:
    """The rates in force of one gimbal."""

    def __init__(self, heartbeats: Heartbeats) -> None:
        self.state = RateState.STILL
        self.rates: Mapping[Axis, Aim] = {}
        """deg/s of each axis that is turned, also of those that the rate in force holds (0)."""
        self.client: ClientId | None = None
        """Sender of the rates in force."""
        self._heartbeats = heartbeats
        self._at = -math.inf
        """When the rate in force arrived last."""

    @property
    def turns(self) -> bool:
        """True while a rate is in force."""
        return self.state is not RateState.STILL

    @property
    def is_by_command(self) -> bool:
        """True while a rate by command is in force."""
        return self.state is RateState.BY_COMMAND

    def take(self, client: ClientId, rates: Mapping[Axis, Aim], now: float, *, by_message: bool) -> None:
        """Put rates (deg/s) in force instead of earlier ones; zeros alone end those."""
        if all(aim.value == 0.0 for aim in rates.values()):
            self._enter(RateEvent.TARGET)
            return
        self._enter(RateEvent.MESSAGE if by_message else RateEvent.COMMAND)
        self.rates, self.client, self._at = dict(rates), client, now

    def replace_by_angles(self) -> None:
        """End the rates: an angle was commanded."""
        self._enter(RateEvent.TARGET)

    def end(self) -> bool:
        """End the rates; True when that stops the gimbal."""
        if self.client is None:
            return False
        self._enter(RateEvent.CONTROL)
        return True

    def expire(self, now: float) -> bool:
        """End the rates whose sender is silent; True when that stops the gimbal."""
        if self.state is RateState.STILL or self.client is None:
            return False
        if self.state is RateState.BY_MESSAGE:
            silent = now - self._at >= MESSAGE_SILENCE
        else:
            heard = self._heartbeats.last(self.client)
            silent = heard is not None and now - max(heard, self._at) >= COMMAND_SILENCE
        if silent:
            self._enter(RateEvent.SILENCE)
        return silent

    def limit(self, at_end: Iterable[Axis]) -> bool:
        """Drop axes at the end of their range; True when that was the last one that turned."""
        if self.state is RateState.STILL:
            return False
        ended = frozenset(at_end)
        self.rates = {axis: Aim(0.0, aim.frame) if axis in ended else aim for axis, aim in self.rates.items()}
        if any(aim.value != 0.0 for aim in self.rates.values()):
            return False
        self._enter(RateEvent.LIMIT)
        return True

    def add_stall(self, seconds: float) -> None:
        """Leave out a time in which the host could not receive heartbeats.

        Rates by message end nevertheless.
        """
        if self.state is RateState.BY_COMMAND:
            self._at += seconds

    def _enter(self, event: RateEvent) -> None:
        self.state = TRANSITIONS[self.state][event]
        if self.state is RateState.STILL:
            self.rates, self.client = {}, None
