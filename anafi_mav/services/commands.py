"""The command protocol: decoding, execution, retransmission and answer of a command.

No I/O. `CommandHistory` decides; `CommandService` runs the handler and sends the acknowledgements.
Rules: conformance R5-R10, B1 and C2 (frames), MAVLink command.md.
"""

from __future__ import annotations

import enum
import math
from collections import Counter
from collections.abc import Awaitable, Callable, Hashable
from dataclasses import dataclass
from typing import NamedTuple

from msgspec import Struct

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.services.flavours import PX4, Flavour
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import height_in_frame
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.fence.plan_items import DEGREES, PLACED

RESEND_WINDOW = 3.5
"""s after an action succeeded in which the same one from the same client is a retransmission: MAVSDK resends 3 s after
the last IN_PROGRESS, QGroundControl after 1.2 s, and neither can know that only the acknowledgement was lost (R10)."""

REFUSAL_WINDOW = 1.0
"""s after an action failed in which the same one gets the same answer.

Short: the reason may have ended.
"""

MAX_CLIENTS = 64
"""Newest actions that are remembered, one for each client and group.

There are a handful, and an address is easily made up.
"""

PROGRESS_AFTER, PROGRESS_EVERY = 0.3, 0.8
"""s until the first IN_PROGRESS and between them: MAVSDK resends at 0.5 s, every client gives up after 1-3 s (R9)."""

LATE_PROGRESS_AFTER = 2.5
"""s until the first IN_PROGRESS of a `LATE` command. DEVIATION: R9 wants one a second of every command.

MAVSDK 4.1 takes one of a DO_SET_MODE for the end of start_mission, pause_mission and arm, which fail then and crash
when the real end comes (mission_raw_impl.cpp start_mission; action_impl.cpp waits for the end, but for the mode that it
sets before arming). It takes one of a gimbal command for its failure (gimbal_impl.cpp receive_command_result). Its
set_home, reset_settings and format_storage return with one, and the real end then aborts the whole client program
("std::future_error", measured with 4.1.0). It gives up 2 s after it has sent them, the others later."""

_UNSET_INT = (2**31 - 1, -(2**31))
"""x and y of a COMMAND_INT that stand for "not set": the specified INT32_MAX, and what a cast NaN becomes (R8)."""

MAX_REFUSALS = 20
"""Refused commands that are kept: what a person reads to see why a station's button does nothing."""

MAX_DURATIONS = 200
"""Durations of accepted commands that are kept: enough for a 99th percentile."""


class ActionGroup(enum.Enum):
    """Actions that may replace each other, by the part of the system that they control.

    Actions of different groups run side by side: none replaces or ends the other, and each group has its own newest
    action of a client for retransmissions. An action ends older ones of its group only where its handler does so.
    """

    FLIGHT = "the movement of the aircraft, and everything that must not happen beside it"
    GIMBAL = "the direction of the gimbal"
    PHOTO = "photos and series of them"
    RECORDING = "the recording of a video"
    ZOOM = "the zoom"
    CAMERA = "mode, source and settings of the camera"
    STORAGE = "the storage of photos and videos"
    STREAM = "the live video"


IN_ORDER = (ActionGroup.PHOTO, ActionGroup.RECORDING, ActionGroup.CAMERA, ActionGroup.STREAM)
"""Groups whose actions run one after another, in the order in which they arrived.

Each then finds the state that the one before has confirmed. Those of other groups are replaced by newer ones instead,
or the drone itself refuses a second one.
"""


class Effect(enum.Enum):
    """Kind of change that a command requests.

    It decides whether a retransmission executes it again, and whether it can be cancelled.
    """

    CHANGE = "any other change: the same command sent again is answered, and COMMAND_CANCEL ends it"
    STOP = "ends something and begins nothing: carried out each time it arrives, and never cancelled"
    HOLD = "a STOP that a person means against whatever the drone does: Hold, Pause, Brake, Loiter, Position"
    LAND = "a STOP that another client's Hold may have ended since: it is then not repeated"
    KILL = "a STOP that cuts the motors in the air, where the configuration allows it"
    RETURN = "asks for the way home: when that is flown already, it is carried out again; never cancelled"
    LAPSING = "a mode that ends without another command: asked for after its end, it begins again, or is refused"
    EACH = "counts each time: after its end it is executed again, unless its confirmation says that it is repeated"
    TARGET = "may be set twice: carried out each time, in flight not after another client's command; never cancelled"
    NUMBERED = "counts, and its sender numbers it: the same number is no new one, whatever was commanded since"
    ONCE = "counts: answered, not repeated, until another action of its group began or what it did no longer holds"
    IRREVOCABLE = "cannot be cancelled: the drone does it whatever is sent then, so CANCELLED would be a lie"

    @property
    def stops(self) -> bool:
        """Ends something and begins nothing. It may be carried out twice."""
        return self in (Effect.STOP, Effect.HOLD, Effect.LAND, Effect.KILL)

    @property
    def is_repeatable(self) -> bool:
        """It is carried out again each time it arrives."""
        return self.stops or self is Effect.TARGET

    @property
    def is_revocable(self) -> bool:
        """COMMAND_CANCEL may end it. Not a stop, which another client must not withdraw."""
        return self in (Effect.CHANGE, Effect.LAPSING)

    @property
    def is_of_payload(self) -> bool:
        """One of those that `PayloadHistory` knows: its remembered answer cannot have become untrue."""
        return self in (Effect.STOP, Effect.TARGET, Effect.EACH, Effect.NUMBERED, Effect.ONCE)


EFFECT_OF_MODE = {
    FlightMode.HOLD: Effect.HOLD,
    FlightMode.POSITION: Effect.HOLD,
    FlightMode.GUIDED: Effect.STOP,
    FlightMode.LAND: Effect.LAND,
    FlightMode.RETURN: Effect.RETURN,
    FlightMode.OFFBOARD: Effect.LAPSING,
    FlightMode.FOLLOW: Effect.LAPSING,
    FlightMode.MISSION: Effect.LAPSING,
    FlightMode.TAKEOFF: Effect.IRREVOCABLE,
    FlightMode.TERMINATED: Effect.IRREVOCABLE,
    FlightMode.ORBIT: Effect.CHANGE,
}
"""The effect of a command that names a mode. Every mode has one: a test compares."""


def effect_of_mode(command: Command) -> Effect:
    """Return the effect of the mode that a command names.

    A mode that we do not have is refused, which changes nothing.
    """
    mode = command.mode
    return Effect.CHANGE if mode is None else EFFECT_OF_MODE[mode]


def is_stop_of_flight(effect: Effect, mode: FlightMode | None) -> bool:
    """Return True for Hold, Land, Return, pause, disarm and the end of the flight by cut motors.

    A person may mean them against whatever flies. Guided stops too, but programs choose it as a matter of routine.
    """
    is_always = effect in (Effect.HOLD, Effect.LAND, Effect.RETURN, Effect.KILL)
    return is_always or (effect is Effect.STOP and mode is None)


class Altitude(enum.Enum):
    """How z (param7) of a command is to be read."""

    UNUSED = "z is no height, or the command's height is not used"
    BY_FRAME = "as the frame says; above mean sea level in a COMMAND_LONG"
    AMSL = "as BY_FRAME; in relative frames above mean sea level too, where the flavour's `relative_frames_are_amsl`"


class ProgressPolicy(enum.Enum):
    """When IN_PROGRESS is sent."""

    PROMPT = "after `PROGRESS_AFTER`"
    EARLY = "after `PROGRESS_AFTER`, and at once where the command first waits for the end of a take-off's climb"
    LATE = "after `LATE_PROGRESS_AFTER`: clients take one for the end of it"
    FINAL_ONLY = "as `PROMPT`, but never to clients of flavours that take `first_answer_as_final`"


@dataclass(frozen=True, kw_only=True)
class Definition:
    """Facts about a MAV_CMD apart from its handler."""

    location: bool
    """x and y are a place: degrees, times 1e7 in a COMMAND_INT. Wrong by mistake it would be 4.8e8 degrees, so it is
    stated here and compared with MAVLink's own definition (hasLocation) when the command is registered."""
    altitude: Altitude
    effect: Effect | Callable[[Command], Effect]
    """One for all, or by the command's parameters."""
    mode: Callable[[Command], FlightMode | None] | None = None
    """The mode that it names, None for one that we do not have. Only for commands that name modes."""
    progress: ProgressPolicy = ProgressPolicy.PROMPT
    group: ActionGroup | Callable[[Command], ActionGroup] = ActionGroup.FLIGHT
    """One for all, or by the command's parameters."""
    offered: Callable[[Flavour], bool] = lambda flavour: True
    """Return True for flavours whose clients have the command."""
    still_holds: Callable[[Command], bool] = lambda command: True
    """Return False once what this command did has ended or changed: the same command is then a new one."""

    def check(self, id: int) -> None:
        """Raise `ValueError` when this contradicts MAVLink's definition of the MAV_CMD, or itself."""
        if self.location != (id in PLACED):
            raise ValueError(f"MAV_CMD {id}: MAVLink says {id in PLACED} of its location, the row {self.location}")
        if self.altitude is not Altitude.UNUSED and not self.location:
            raise ValueError(f"MAV_CMD {id}: its z cannot be a height, it has no location")
        if (self.effect is effect_of_mode) != (self.mode is not None):
            raise ValueError(f"MAV_CMD {id}: it must have both mode and `effect_of_mode`, or none of them")
        may_fly = self.group is ActionGroup.FLIGHT or not isinstance(self.group, ActionGroup)
        if not may_fly and isinstance(self.effect, Effect) and not self.effect.is_of_payload:
            raise ValueError(f"MAV_CMD {id}: its group has no {self.effect.name}: say if it counts or sets a target")


@dataclass(frozen=True)
class Action(Definition):
    """A MAV_CMD that changes the vehicle's behaviour, with all its facts in one row."""

    handler: Callable[[Command], Awaitable[None]]
    """Executed once however often the command arrives; returns when the drone confirmed, or raises an
    `AnafiMavError` that says why not."""


OURS = (0.0, 1.0, float(dialect.MAV_COMP_ID_CAMERA))
"""Target camera ids that mean the drone's camera: all cameras, the autopilot's first, this component."""


def require_camera(what: texts.OperatorText, id: float) -> None:
    """Refuse a command for a camera that does not exist."""
    if not math.isnan(id) and id not in OURS:
        raise Refused(what, texts.NO_SUCH_CAMERA.fill(number=f"{id:g}"), lasting=True)


QUERY = Definition(location=False, altitude=Altitude.UNUSED, effect=Effect.CHANGE)
"""A command that is answered at once, and changes nothing."""


class Command(Struct, frozen=True):
    """One command, from any of its messages. Unset parameters are NaN."""

    id: int
    definition: Definition
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
    """Sender: (channel, system id, component id)."""
    flavour: Flavour = PX4
    """The autopilot that the sender takes us for."""
    right: Right = Right(None, Extent.COMMANDED, 0)
    """The right that its client has by it; its handler decides what it may end. Empty until it is carried out."""
    confirmation: int = 0
    """Above 0 in a COMMAND_LONG that is sent again because no answer was received."""
    component: int = dialect.MAV_COMP_ID_AUTOPILOT1
    """The component that carries it out."""

    @property
    def effect(self) -> Effect:
        """Effect that it requests."""
        effect = self.definition.effect
        return effect if isinstance(effect, Effect) else effect(self)

    @property
    def is_revocable(self) -> bool:
        """COMMAND_CANCEL may end it, also a movement of the aircraft that counts each time."""
        return self.effect.is_revocable or (self.effect is Effect.EACH and self.group is ActionGroup.FLIGHT)

    @property
    def group(self) -> ActionGroup:
        """Group of actions that it may replace."""
        group = self.definition.group
        return group if isinstance(group, ActionGroup) else group(self)

    @property
    def mode(self) -> FlightMode | None:
        """The mode that it names; None: it names none, or one that we do not have."""
        return None if self.definition.mode is None else self.definition.mode(self)

    @property
    def is_stop_of_flight(self) -> bool:
        """True for a command that stops the aircraft, lands it or leads it home."""
        return self.group is ActionGroup.FLIGHT and is_stop_of_flight(self.effect, self.mode)

    @property
    def progress(self) -> ProgressPolicy | None:
        """When IN_PROGRESS is sent to its client; None: never."""
        progress = self.definition.progress
        return None if progress is ProgressPolicy.FINAL_ONLY and self.flavour.first_answer_as_final else progress

    def place(self) -> GeoPoint | None:
        """Return its position; None when it is unset. Half a position is refused."""
        if math.isnan(self.x) and math.isnan(self.y):
            return None
        if not (math.isfinite(self.x) and math.isfinite(self.y)):
            raise Refused(texts.POSITION, texts.LATITUDE_LONGITUDE_NUMBERS, lasting=True)
        return GeoPoint(self.x, self.y)

    def height(self, vehicle: Aircraft, *, flown: bool = True) -> float | None:
        """Return the height above take-off (m) of its z; None when z is unset.

        By the frame (AMSL in COMMAND_LONG), and by the flavour of its sender. `flown`: the drone is to fly at this
        height. Raises `Refused`, `UnsupportedFrame`.
        """
        if math.isnan(self.z):
            return None
        altitude = self.definition.altitude
        if altitude is Altitude.UNUSED:
            raise ValueError(f"MAV_CMD {self.id}: its row says that it has no height")
        amsl = altitude is Altitude.AMSL and self.flavour.relative_frames_are_amsl
        return height_in_frame(vehicle, self.z, self.frame, amsl=amsl, flown=flown)

    def same_as(self, other: Command) -> bool:
        """True when both commands are equal, with NaN equal to NaN."""
        return (self.id, self.frame) == (other.id, other.frame) and all(
            a == b or (math.isnan(a) and math.isnan(b))
            for a, b in zip(
                (*self.params, self.x, self.y, self.z), (*other.params, other.x, other.y, other.z), strict=True
            )
        )


def from_long(
    message: dialect.MAVLink_command_long_message,
    definition: Definition,
    client: Hashable = None,
    flavour: Flavour = PX4,
) -> Command:
    """The command of a COMMAND_LONG."""
    return Command(
        message.command,
        definition,
        (message.param1, message.param2, message.param3, message.param4),
        message.param5,
        message.param6,
        message.param7,
        None,
        client,
        flavour,
        confirmation=message.confirmation,
    )


def from_int(
    message: dialect.MAVLink_command_int_message,
    definition: Definition,
    client: Hashable = None,
    flavour: Flavour = PX4,
) -> Command:
    """The command of a COMMAND_INT."""
    scale = DEGREES if definition.location else 1.0
    x, y = (math.nan if value in _UNSET_INT else value / scale for value in (message.x, message.y))
    return Command(
        message.command,
        definition,
        (message.param1, message.param2, message.param3, message.param4),
        x,
        y,
        message.z,
        message.frame,
        client,
        flavour,
    )


class Execution(Struct, eq=False):
    """An action under way or just ended."""

    client: Hashable
    command: Command
    result: int = dialect.MAV_RESULT_IN_PROGRESS
    """MAV_RESULT; IN_PROGRESS until it ended."""
    ended: float = math.inf
    superseded: bool = False
    """Another client's action has replaced it since."""
    overtaken: bool = False
    """Another action of its group has begun since. Only `PayloadHistory` notes it."""

    @property
    def succeeded(self) -> bool:
        """It was carried out, at least for a while."""
        return self.result in (dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_CANCELLED)

    @property
    def still_holds(self) -> bool:
        """False when it was accepted and what it did has ended or changed since."""
        return self.result != dialect.MAV_RESULT_ACCEPTED or self.command.definition.still_holds(self.command)


def is_in_window(execution: Execution, now: float) -> bool:
    """Return True while an ended action is remembered."""
    return now - execution.ended < (RESEND_WINDOW if execution.succeeded else REFUSAL_WINDOW)


class CommandHistory:
    """Distinguishes a new action of the flight from the retransmission of one.

    For each client only the newest action counts: arm, disarm, arm within two seconds are three actions, although the
    third equals the first. `PayloadHistory` knows the actions of the other groups.
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
        """Return the MAV_RESULT that answers a retransmission; None: execute the command.

        These may be executed twice: commands that stop something always, except a landing that another client has
        ended (`landing_ended_at` is when a client last ended one); a return and a target while no other client has
        replaced it; and modes that have ended by themselves (`mode` is the vehicle's, needed for LAPSING alone). A
        command that another client has replaced is neither executed against that client nor confirmed: it is answered
        with CANCELLED. One that was refused had nothing to replace, and keeps its result.
        """
        newest = self._newest.get(client)
        if newest is None or not newest.command.same_as(command):
            return None
        if newest.result == dialect.MAV_RESULT_IN_PROGRESS:
            return newest.result
        effect = command.effect
        if effect is Effect.EACH and not command.confirmation:
            return None
        landing_ended = effect is Effect.LAND and newest.superseded and landing_ended_at >= newest.ended
        target_replaced = effect is Effect.TARGET and newest.superseded
        if effect.is_repeatable and not (landing_ended or target_replaced):
            return None
        if not is_in_window(newest, now):
            return None
        if newest.superseded and newest.succeeded:
            return dialect.MAV_RESULT_CANCELLED
        ended = effect is Effect.LAPSING and mode is not None and mode is not command.mode
        return None if effect is Effect.RETURN or ended or not newest.still_holds else newest.result

    def was_cancelled(self, client: Hashable, id: int, now: float) -> bool:
        """Return True when this command, the client's newest, has just ended with CANCELLED."""
        newest = self._newest.get(client)
        if newest is None or newest.command.id != id or newest.result != dialect.MAV_RESULT_CANCELLED:
            return False
        return is_in_window(newest, now)

    def begin(self, client: Hashable, command: Command) -> Execution:
        """Note that an action begins; this client's next one is compared with it."""
        self._newest.pop(client, None)  # so that the dictionary is in the order of use
        execution = self._newest[client] = Execution(client, command)
        if len(self._newest) > MAX_CLIENTS:
            del self._newest[next(iter(self._newest))]
        return execution

    def supersede(self, client: Hashable) -> None:
        """Note that an action of this client has replaced those of all others."""
        for other, execution in self._newest.items():
            if other != client:
                execution.superseded = True

    def forget_clients(self, is_gone: Callable[[Hashable], bool]) -> None:
        """Forget the actions of the clients for which `is_gone` returns True."""
        self._newest = {client: execution for client, execution in self._newest.items() if not is_gone(client)}

    def forget(self, client: Hashable | None = None) -> None:
        """Forget the newest action of one client, or all actions (client None).

        For one client: it moved the vehicle, for example, by other means.
        """
        if client is None:
            self._newest.clear()
        else:
            self._newest.pop(client, None)


class CommandRefusal(NamedTuple):
    """A command whose final result was not ACCEPTED."""

    at: float
    """s, monotonic."""
    sysid: int
    compid: int
    client: str
    """Name of the channel."""
    command: int
    result: int
    reason: str


class CommandLog:
    """Counts results, and keeps the last refusals and durations."""

    def __init__(self) -> None:
        self.results: Counter[int] = Counter()
        """By MAV_RESULT."""
        self.refusals: tuple[CommandRefusal, ...] = ()
        """Oldest first."""
        self.durations: list[float] = []
        """s from the arrival to the acknowledgement of actions that were accepted."""

    def refuse(self, refusal: CommandRefusal) -> None:
        """Note a command that was not accepted."""
        self.results[refusal.result] += 1
        self.refusals = (*self.refusals, refusal)[-MAX_REFUSALS:]

    def accept(self, result: int, duration: float | None = None) -> None:
        """Note an accepted command; `duration`: s that its action took, None for a query."""
        self.results[result] += 1
        if duration is not None:
            self.durations.append(duration)
            del self.durations[:-MAX_DURATIONS]
