"""The command protocol: what a COMMAND_LONG or COMMAND_INT says, and when it is executed, repeated or answered.

I/O-free. `CommandDesk` decides; `System` runs the handler and sends the acknowledgements.
Rules: conformance R5-R10, MAVLink command.md.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass

from anafi_mav.mavlink import dialect
from anafi_mav.services.flavours import ARDUPILOT, PX4, Flavour, mode_of_standard
from anafi_mav.services.modes import HOVERING, FlightMode
from anafi_mav.services.right import Extent, Right

RESEND_WINDOW = 3.5
"""s after an action succeeded in which the same one from the same client is a retransmission: MAVSDK resends 3 s after
the last IN_PROGRESS, QGroundControl after 1.2 s, and neither can know that only the acknowledgement was lost (R10)."""

REFUSAL_WINDOW = 1.0
"""s after an action did not succeed in which the same one gets the same answer. Short: the reason may be gone."""

MAX_CLIENTS = 64
"""Clients whose newest action is remembered; there are a handful, and an address is easily made up."""

PROGRESS_AFTER, PROGRESS_EVERY = 0.3, 0.8
"""s until the first IN_PROGRESS and between them: MAVSDK resends at 0.5 s, every client gives up after 1-3 s (R9)."""

MODE_PROGRESS_AFTER = 2.5
"""s until the first IN_PROGRESS of a DO_SET_MODE. DEVIATION: R9 wants one a second of every command. MAVSDK 4.1 takes
one for the end of start_mission, pause_mission and arm, which fail then and crash when the real end comes
(mission_raw_impl.cpp start_mission; action_impl.cpp waits for the end, but for the mode that it sets before arming). It
gives up 2 s after it has sent it, the others later."""

_MODE_COMMANDS = (dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_CMD_DO_SET_STANDARD_MODE)
_STOPPING_MODES = (*HOVERING, FlightMode.LAND)
_LAPSING = (FlightMode.OFFBOARD, FlightMode.FOLLOW, FlightMode.MISSION)
_STOPPING = (
    dialect.MAV_CMD_NAV_LAND,
    dialect.MAV_CMD_DO_FLIGHTTERMINATION,
    dialect.MAV_CMD_DO_SET_ROI_NONE,
)
_IRREVOCABLE = (dialect.MAV_CMD_NAV_TAKEOFF, dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN)

_UNSET_INT = (2**31 - 1, -(2**31))
"""x and y of a COMMAND_INT that stand for "not set": the specified INT32_MAX, and what a cast NaN becomes (R8)."""


@dataclass(frozen=True)
class Command:
    """One command, whichever message brought it. Unset parameters are NaN."""

    id: int
    params: tuple[float, float, float, float]
    """param1..param4."""
    x: float
    """param5: latitude in deg for a command with a location, else as sent."""
    y: float
    """param6: longitude in deg for a command with a location, else as sent."""
    z: float
    """param7: height in m for a command with a location."""
    frame: int | None
    """MAV_FRAME of a COMMAND_INT; None for COMMAND_LONG."""
    client: Hashable = None
    """Who sent it: (channel, system id, component id)."""
    flavour: Flavour = PX4
    """The autopilot that who sent it believes to speak to."""
    at: float = 0.0
    """When it arrived, on the monotonic clock."""
    counted: bool = True
    """It `holds`, and its client sent no other such command in the 5 s before."""

    @property
    def right(self) -> Right:
        """The right that its client has by it; what it ends of that is for its handler to say."""
        return Right(self.client, Extent.ALL, self.at, self.counted)

    @property
    def holds(self) -> bool:
        """Hold, Pause, Brake, Loiter or Position: a person means it against whatever the drone does."""
        if self.id in _MODE_COMMANDS:
            return self.mode in (FlightMode.HOLD, FlightMode.POSITION)
        return self.id in (dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_DO_PAUSE_CONTINUE) and self.stops

    @property
    def mode(self) -> FlightMode | None:
        """The mode that DO_SET_MODE or DO_SET_STANDARD_MODE names or MISSION_START means; None: we have none such."""
        if self.id == dialect.MAV_CMD_MISSION_START:
            return FlightMode.MISSION
        if self.id == dialect.MAV_CMD_DO_SET_STANDARD_MODE:
            return mode_of_standard(self.params[0])
        return self.flavour.mode_of_parameters(self.params[1], self.params[2])

    @property
    def patient(self) -> bool:
        """Who sent it takes IN_PROGRESS amiss, and waits without: it is not said before `MODE_PROGRESS_AFTER`."""
        return self.id == dialect.MAV_CMD_DO_SET_MODE

    @property
    def is_answered_once(self) -> bool:
        """True when IN_PROGRESS is never sent: ArduPilot's clients take the first acknowledgement for the final one.

        dronekit2's tests count exactly one; Mission Planner waits up to 25 s for it.
        """
        return self.flavour is ARDUPILOT and self.id in (
            dialect.MAV_CMD_PREFLIGHT_CALIBRATION,
            dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
        )

    @property
    def stops(self) -> bool:
        """It ends something and begins nothing: hold, land, disarm, cut the motors. It may be carried out twice."""
        if self.id == dialect.MAV_CMD_DO_REPOSITION:
            no_heading = math.isnan(self.params[3]) or (self.params[3] == 0.0 and self.flavour.zero_is_unset)
            return no_heading and all(math.isnan(value) for value in (self.x, self.y, self.z))
        if self.id in _MODE_COMMANDS:
            return self.mode in _STOPPING_MODES
        if self.id in (dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_DO_PAUSE_CONTINUE):
            return self.params[0] == 0.0
        return self.id in _STOPPING

    @property
    def lands(self) -> bool:
        """It asks for a landing. That stops something too, but a Hold of another client may have ended it since."""
        if self.id in _MODE_COMMANDS:
            return self.mode is FlightMode.LAND
        return self.id == dialect.MAV_CMD_NAV_LAND

    @property
    def returns(self) -> bool:
        """It asks for the way home: when that is flown already, asking again changes nothing."""
        if self.id in _MODE_COMMANDS:
            return self.mode is FlightMode.RETURN
        return self.id == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH

    @property
    def revocable(self) -> bool:
        """COMMAND_CANCEL may end it. Not an order to stop, which somebody else must not call off; and not what a drone
        that has heard it does whatever we say then, so that "cancelled" would be a lie: take off, return, restart."""
        if self.id in _MODE_COMMANDS and self.mode in (FlightMode.TAKEOFF, FlightMode.TERMINATED):
            return False
        return not (self.stops or self.returns or self.id in _IRREVOCABLE)

    @property
    def lapses(self) -> bool:
        """It asks for a mode that ends without another order: asked for again, it begins again, or is refused."""
        return self.id in (*_MODE_COMMANDS, dialect.MAV_CMD_MISSION_START) and self.mode in _LAPSING

    def same_as(self, other: Command) -> bool:
        """Equal, with NaN equal to NaN."""
        return (self.id, self.frame) == (other.id, other.frame) and all(
            a == b or (math.isnan(a) and math.isnan(b))
            for a, b in zip(
                (*self.params, self.x, self.y, self.z), (*other.params, other.x, other.y, other.z), strict=True
            )
        )


LOCATION_COMMANDS = frozenset(
    {
        dialect.MAV_CMD_NAV_WAYPOINT,
        dialect.MAV_CMD_NAV_LAND,
        dialect.MAV_CMD_NAV_TAKEOFF,
        dialect.MAV_CMD_DO_ORBIT,
        dialect.MAV_CMD_DO_REPOSITION,
        dialect.MAV_CMD_DO_SET_HOME,
        dialect.MAV_CMD_DO_SET_ROI_LOCATION,
        dialect.MAV_CMD_DO_SET_ROI,
    }
)
"""Commands whose x and y of a COMMAND_INT are degrees times 1e7."""


def from_long(
    message: dialect.MAVLink_command_long_message, client: Hashable = None, flavour: Flavour = PX4
) -> Command:
    """The command of a COMMAND_LONG."""
    return Command(
        message.command,
        (message.param1, message.param2, message.param3, message.param4),
        message.param5,
        message.param6,
        message.param7,
        None,
        client,
        flavour,
    )


def from_int(message: dialect.MAVLink_command_int_message, client: Hashable = None, flavour: Flavour = PX4) -> Command:
    """The command of a COMMAND_INT."""
    scale = 1e7 if message.command in LOCATION_COMMANDS else 1.0
    x, y = (math.nan if value in _UNSET_INT else value / scale for value in (message.x, message.y))
    return Command(
        message.command,
        (message.param1, message.param2, message.param3, message.param4),
        x,
        y,
        message.z,
        message.frame,
        client,
        flavour,
    )


@dataclass
class Execution:
    """An action under way or just ended."""

    client: Hashable
    command: Command
    result: int = dialect.MAV_RESULT_IN_PROGRESS
    """MAV_RESULT; IN_PROGRESS until it ended."""
    ended: float = math.inf
    superseded: bool = False
    """Another client's action has taken the vehicle over since."""


class CommandDesk:
    """Tells a new action from the retransmission of one.

    Of each client the newest action counts: arm, disarm, arm within two seconds are three actions, although the third
    equals the first.
    """

    def __init__(self) -> None:
        self._newest: dict[Hashable, Execution] = {}

    def retransmission(
        self,
        client: Hashable,
        command: Command,
        now: float,
        mode: FlightMode | None = None,
        landing_ended_at: float = -math.inf,
    ) -> int | None:
        """The MAV_RESULT to answer a command with that this client sends once more; None: it is to be executed.

        What may be carried out twice is: orders to stop always, but for a landing that another client has ended
        (`landing_ended_at` is when a client last ended one), a return while no other client has taken over, and modes
        that have ended by themselves (`mode` is the vehicle's). What another client has replaced is neither carried out
        over its head nor confirmed: it is answered with CANCELLED.
        """
        newest = self._newest.get(client)
        if newest is None or not newest.command.same_as(command):
            return None
        if newest.result == dialect.MAV_RESULT_IN_PROGRESS:
            return newest.result
        if command.stops and not (command.lands and newest.superseded and landing_ended_at >= newest.ended):
            return None
        succeeded = newest.result in (dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_CANCELLED)
        if now - newest.ended >= (RESEND_WINDOW if succeeded else REFUSAL_WINDOW):
            return None
        if newest.superseded:
            return dialect.MAV_RESULT_CANCELLED
        ended = command.lapses and mode is not None and mode is not command.mode
        return None if command.returns or ended else newest.result

    def begin(self, client: Hashable, command: Command) -> Execution:
        """Note that an action begins; this client's next one is compared with it."""
        self._newest.pop(client, None)  # so that the dictionary is in the order of use
        execution = self._newest[client] = Execution(client, command)
        if len(self._newest) > MAX_CLIENTS:
            del self._newest[next(iter(self._newest))]
        return execution

    def supersede(self, client: Hashable) -> None:
        """An action of this client has taken the vehicle over from all others."""
        for other, execution in self._newest.items():
            if other != client:
                execution.superseded = True

    def forget(self, client: Hashable | None = None) -> None:
        """What was done before no longer counts: for one client, which moved the vehicle by other means, or for all."""
        if client is None:
            self._newest.clear()
        else:
            self._newest.pop(client, None)
