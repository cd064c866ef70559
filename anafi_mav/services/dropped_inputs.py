"""Inputs of streams that are not flown: causes, and when a text to the sender is due.

No I/O.

A command is acknowledged. A message that is refused because another station is the operator is answered besides, where
its protocol has an answer. Setpoints, sticks, targets and gimbal rates are not: so their sender gets a STATUSTEXT when
they are not flown, one per cause and episode. An episode of a cause begins with an input that is dropped for it. It
ends when an input of the same stream is flown, or when none has been dropped for this cause for `EPISODE_GAP`.

Not reported, and never passed to `drop`: centred sticks and zero rates of a gimbal, a throttle that has not left its
rest, setpoints without motion before their mode is chosen, targets outside of mode Follow (they name no drone), and an
input that a newer one of the same sender has replaced.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from anafi_mav import texts
from anafi_mav.texts import OperatorText, Template
from anafi_mav.vehicle.base.severity import Severity

REPORT_EVERY = 10.0
"""s between two texts of one cause to one sender, in how many episodes ever."""

EPISODE_GAP = 5.0
"""s without a dropped input after which the next one begins another episode: slow streams send one a second, and a bad
link loses several in a row."""

MODE_GRACE = 2.0
"""s for which setpoints may wait for the mode that flies them: programs begin to stream before they choose it."""

MAX_SENDERS = 32
"""Senders whose episodes are remembered: more than stream to one drone. A sender beyond them gets no text as long as
all of them have got one within `REPORT_EVERY`, so that made-up system ids cannot cause a flood of texts."""


class InputStream(enum.Enum):
    """Stream of inputs without acknowledgement. The value names its messages."""

    SETPOINT = "SET_ATTITUDE_TARGET, SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT"
    STICKS = "MANUAL_CONTROL, RC_CHANNELS_OVERRIDE"
    TARGET = "FOLLOW_TARGET, GLOBAL_POSITION_INT of a station in mode Follow"
    GIMBAL = (
        "GIMBAL_MANAGER_SET_ATTITUDE, GIMBAL_MANAGER_SET_PITCHYAW, GIMBAL_MANAGER_SET_MANUAL_CONTROL, "
        "MOUNT_CONFIGURE, MOUNT_CONTROL"
    )
    REGION = "MOUNT_CONTROL with a place"
    CHANGE = (
        "Commands, parameters, plans and other messages that change something, while another station is the operator"
    )


def _refused(what: OperatorText) -> Callable[[OperatorText], OperatorText]:
    return lambda reason: texts.REFUSED.fill(what=what, reason=reason)


def _with(form: Template) -> Callable[[OperatorText], OperatorText]:
    return lambda reason: form.fill(reason=reason)


@dataclass(frozen=True, eq=False)
class DropCause:
    """A cause for which inputs of a stream are not flown."""

    stream: InputStream
    reason: OperatorText | Template | None
    """None: any other reason, in the words of the drone."""
    text: Callable[[OperatorText], OperatorText]
    """Makes the whole text of a reason with its values."""
    grace: float = 0.0
    """s that an episode must have lasted before it is reported."""
    severity: Severity = Severity.WARNING


def _rows(
    stream: InputStream,
    text: Callable[[OperatorText], OperatorText],
    *reasons: OperatorText | Template | None,
    grace: float = 0.0,
) -> Iterator[DropCause]:
    severity = Severity.NOTICE if grace else Severity.WARNING
    return (DropCause(stream, reason, text, grace, severity) for reason in reasons)


_BOUNDS = (
    *(texts.NOT_A_NUMBER, texts.NOT_ON_EARTH, texts.AT_NULL, texts.TOO_LOW, texts.ABOVE_CEILING, texts.BELOW_FENCE),
    *(texts.TOO_FAR, texts.BEYOND_GEOFENCE, texts.BEYOND_ZONE, texts.WAY_LEAVES_ZONE, texts.FENCE_NO_FIX),
    *(texts.AMSL_UNKNOWN, texts.NEAR_ESTIMATE),
)
"""Reasons of `vehicle.base.bounds` and the fence."""

_ACTIVITIES = (
    *(texts.RETURNS, texts.ON_GROUND, texts.STARTS_MOTORS, texts.TAKES_OFF, texts.HOVERS, texts.FLIES, texts.LANDS),
    *(texts.EMERGENCY_STOP, texts.FORCED, texts.FLYING_STATE_UNKNOWN),
)
"""Reasons of `Aircraft.activity`."""

CAUSES: tuple[DropCause, ...] = (
    *_rows(
        InputStream.SETPOINT,
        _refused(texts.SETPOINT),
        # The message.
        *(texts.ATTITUDE_RATES, texts.ATTITUDE_NO_ROTATION, texts.ATTITUDE_LENGTH, texts.ATTITUDE_UPSIDE_DOWN),
        *(texts.THRUST_RANGE, texts.FRAME_UNSUPPORTED, texts.TERRAIN_UNSUPPORTED, texts.HALF_PLACE, texts.FORCES),
        *(texts.NOTHING_ASKED, texts.NOT_ALL_NUMBERS, texts.TOO_FAST, texts.TOO_MUCH_ACCELERATION),
        texts.TURNS_TOO_FAST,
        # Its place and height.
        *_BOUNDS,
        *(texts.TAKEOFF_POINT_UNKNOWN, texts.HEADING_UNKNOWN, texts.HEIGHT_UNKNOWN, texts.NO_FIX),
        # Other clients and the pilot.
        *(texts.OTHER_PROGRAM, texts.TOO_MANY_PROGRAMS, texts.NOT_ARMED_BY_CLIENT, texts.PAUSED_BY_CLIENT, texts.PILOT),
        *(texts.PILOT_SWITCH, texts.OTHER_OPERATOR),
        *(texts.NOT_CHOSEN, texts.WAITED_TOO_LONG, texts.MISSION_DISPLACED),
        # The drone.
        *(texts.IN_MODE, texts.TAKE_OFF_FIRST, texts.TAKE_OFF_OR_GUIDED, texts.WILL_TAKE_OFF, texts.TILT_UNKNOWN),
        texts.NOT_IN_AIR,
        *(texts.STICKS_FOLLOW_CAMERA, texts.ROLL_INVERTED, texts.MOTION_UNKNOWN, *_ACTIVITIES, texts.PROBLEMS),
    ),
    *_rows(InputStream.SETPOINT, _refused(texts.SETPOINT), texts.NOT_OFFBOARD, texts.NO_CLIMB, grace=MODE_GRACE),
    *_rows(InputStream.SETPOINT, _with(texts.SETPOINT_DROPPED), texts.MOVE_CANCELLED, texts.MOVE_FAILED, None),
    *_rows(InputStream.STICKS, _with(texts.MANUAL_CONTROL_IGNORED), texts.AXIS_RANGE, texts.THROTTLE_RANGE),
    *_rows(InputStream.STICKS, _with(texts.RC_OVERRIDE_IGNORED), texts.CHANNEL_RANGE),
    *_rows(
        InputStream.STICKS,
        _with(texts.STICKS_IGNORED),
        *(texts.STICKS_IGNORED_MODE, texts.STICKS_DO_NOT_ARM, texts.TAKE_OFF_FIRST, texts.OTHER_STICKS, texts.PILOT),
        *(texts.TILT_UNKNOWN, texts.PILOT_SWITCH, texts.OTHER_OPERATOR, None),
    ),
    *_rows(
        InputStream.TARGET,
        _with(texts.TARGET_IGNORED),
        *(texts.TARGET_NO_POSITION, texts.TARGET_NO_VELOCITY, texts.TARGET_FAST, texts.TARGET_FAR, texts.OTHER_TARGET),
        texts.OTHER_OPERATOR,
        *(texts.NO_FIX, texts.POSITION_UNKNOWN, texts.TARGET_NO_ALTITUDE, texts.HEIGHT_UNKNOWN),
        *(texts.GROUND_HEIGHT_UNKNOWN, *_BOUNDS, None),
    ),
    *_rows(
        InputStream.GIMBAL,
        _refused(texts.GIMBAL),
        *(texts.NO_SUCH_GIMBAL, texts.ATTITUDE_LENGTH, texts.NO_RETRACT, texts.TWO_YAW_FRAMES, texts.NOTHING_ASKED),
        *(texts.GIMBAL_ANGLE, texts.GIMBAL_RATE, texts.GIMBAL_SHARE, texts.GIMBAL_MODE, texts.HEADING_UNKNOWN),
        *(texts.NO_GIMBAL, texts.NO_SUCH_AXIS, texts.GIMBAL_CALIBRATES),
        *(texts.GIMBAL_OF_CLIENT, texts.GIMBAL_OF_MISSION, texts.GIMBAL_NO_CLIENT, None),
    ),
    *_rows(
        InputStream.REGION,
        _refused(texts.ROI),
        *(texts.GIMBAL_OF_CLIENT, texts.GIMBAL_OF_MISSION, texts.GIMBAL_NO_CLIENT, texts.GIMBAL_CALIBRATES),
        *(texts.NO_GIMBAL, texts.NOT_ON_EARTH, texts.AT_NULL, texts.DRONE_FLIES, texts.NOT_IN_AIR),
        *(texts.MISSION_DISPLACED, texts.PILOT_SWITCH, texts.OTHER_OPERATOR, *_ACTIVITIES, None),
    ),
    *_rows(InputStream.CHANGE, _refused(texts.MESSAGE), texts.OTHER_OPERATOR),
)
"""All causes. The docs list them, and a test compares them with the reasons in the code."""


def _pattern(reason: OperatorText | Template | None) -> str | None:
    return None if reason is None else reason.pattern


_BY_REASON = {(cause.stream, _pattern(cause.reason)): cause for cause in CAUSES}


def cause_of(stream: InputStream, reason: OperatorText) -> DropCause:
    """Return the cause that a reason belongs to, whatever values it is filled with."""
    return _BY_REASON.get((stream, reason.pattern)) or _BY_REASON[stream, None]


class DropReport(NamedTuple):
    """A text that is due to the sender of a dropped input."""

    severity: Severity
    text: OperatorText


@dataclass
class _Episode:
    """The present or last episode of one cause for one sender."""

    began: float
    newest: float
    """Time of its newest dropped input; -inf once it has ended."""
    is_reported: bool = False
    reported_at: float = -math.inf
    """Time of the newest text, of this episode or an earlier one."""


class DroppedInputs:
    """Episodes of dropped inputs to one drone, by sender and cause."""

    def __init__(self) -> None:
        self._senders: dict[Hashable, dict[DropCause, _Episode]] = {}
        """The sender whose input was dropped last is at the end."""

    def drop(self, client: Hashable, stream: InputStream, reason: OperatorText, now: float) -> DropReport | None:
        """Note an input that is not flown; return the text that its sender gets now, or None."""
        episodes = self._episodes_of(client, now)
        if episodes is None:
            return None
        cause = cause_of(stream, reason)
        episode = episodes.setdefault(cause, _Episode(now, now))
        if now - episode.newest >= EPISODE_GAP:
            episode.began, episode.is_reported = now, False
        episode.newest = now
        is_due = now - episode.began >= cause.grace and now - episode.reported_at >= REPORT_EVERY
        if episode.is_reported or not is_due:
            return None
        episode.is_reported, episode.reported_at = True, now
        return DropReport(cause.severity, cause.text(reason))

    def use(self, client: Hashable, stream: InputStream) -> None:
        """Note that an input of a stream is flown: the sender's episodes of that stream end."""
        for cause, episode in self._senders.get(client, {}).items():
            if cause.stream is stream:
                episode.newest = -math.inf

    def forget(self, is_gone: Callable[[Hashable], bool]) -> None:
        """Forget the senders for which `is_gone` returns True."""
        self._senders = {client: episodes for client, episodes in self._senders.items() if not is_gone(client)}

    def _episodes_of(self, client: Hashable, now: float) -> dict[DropCause, _Episode] | None:
        """Return a sender's episodes; None when there is no room for another sender."""
        episodes = self._senders.pop(client, None)
        if episodes is None:
            episodes = {}
            if len(self._senders) >= MAX_SENDERS:
                quiet = next((one for one, theirs in self._senders.items() if _is_quiet(theirs, now)), None)
                if quiet is None:
                    return None
                del self._senders[quiet]
        self._senders[client] = episodes
        return episodes


def _is_quiet(episodes: dict[DropCause, _Episode], now: float) -> bool:
    """True when no text has left for these within `REPORT_EVERY`."""
    return all(now - episode.reported_at >= REPORT_EVERY for episode in episodes.values())
