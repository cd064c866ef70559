"""Ways in which a real firmware may differ from the simulated one, each switched on by name.

The simulated firmware behaves as Parrot's XML files, Olympe and GroundSDK let expect. Where they are silent or
contradict each other, a quirk is the other reading, so that a controller can be tested against both.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Iterable
from dataclasses import dataclass

from anafi_mav.errors import ConfigError


class Quirk(enum.Enum):
    """A deviation of the simulated firmware.

    The value is its name on the command line and in files.
    """

    description: str
    """One sentence for the documentation."""

    def __new__(cls, name: str, description: str) -> Quirk:
        quirk = object.__new__(cls)
        quirk._value_ = name
        quirk.description = description
        return quirk

    LANDING_IGNORES_TAKEOFF = ("landing-ignores-takeoff", "TakeOff does not end a landing")
    LANDING_IGNORES_GAZ = ("landing-ignores-gaz", "positive gaz in a PCMD does not end a landing")
    TAKEOFF_FROM_GROUND_LATE = (
        "takeoff-from-ground-late",
        "TakeOff is executed one second late, whatever the flying state is by then",
    )
    HANDSHAKE_REFUSED_8S = (
        "handshake-refused-8s",
        "the session of a silent controller lives for 8 s, and a handshake is refused until then",
    )
    RTH_FINISHED_MISSING = ("rth-finished-missing", "rth.state never reports the reason finished")
    LAST_ITEM_NOT_REPORTED = ("last-item-not-reported", "MissionItemExecuted is absent for a plan's last line")
    STOPPED_BEFORE_EXECUTED = (
        "stopped-before-executed",
        "the state stopped of a plan that has ended is reported before MissionItemExecuted of its last line",
    )
    FLAG_REMEMBERED = (
        "flag-remembered",
        "the flag of the last PCMD counts until the next PCMD: with flag 1 the drone never hovers, and a return or "
        "point of interest waits for ever",
    )
    RETURN_WAITS_FOR_MOVES = (
        "return-waits-for-moves",
        "a return that a user requests ends no move, plan or point of interest: it begins when the drone hovers after "
        "it",
    )
    RAMPING_IGNORES_LANDING = (
        "ramping-ignores-landing",
        "Landing and UserTakeOff(0) do nothing while the motors ramp up",
    )
    RETURN_ENDS_ABOVE_HOME = (
        "return-ends-above-home",
        "the height at the end of a return counts from that of the home, not from the take-off",
    )
    NO_FLIGHT_ID = ("no-flight-id", "FlightId is never reported")
    GPS_LOCATION_STOPS = ("gps-location-stops", "GpsLocationChanged is no longer sent although the drone reports a fix")
    UPLOAD_REFUSED_WHILE_PAUSED = (
        "upload-refused-while-paused",
        "the web server takes no flight plan while another one is paused",
    )
    NO_HTTP_RANGE = ("no-http-range", "the web server ignores Range in requests and answers with the whole file")
    ROLL_INVERTED = ("roll-inverted", "AttitudeChanged.roll is positive with the left wing down")


@dataclass(frozen=True)
class Scramble:
    """The quirk with a number: events late, twice and in another order (`scramble`)."""

    seed: int


QUIRKS = {quirk.value: quirk for quirk in Quirk}
"""Quirks without a number, by name."""

SCRAMBLE = "scramble:SEED"
"""Form of the name of a `Scramble`."""

EXPECTED = f"{', '.join(QUIRKS)}, {SCRAMBLE}"
"""Names for a help text or an error."""


def named(names: Iterable[str], key_path: str) -> frozenset[Quirk | Scramble]:
    """Return the quirks with these names.

    Raises `ConfigError` at `key_path` for an unknown name.
    """
    return frozenset(_named(name, key_path) for name in names)


def _named(name: str, key_path: str) -> Quirk | Scramble:
    if name in QUIRKS:
        return QUIRKS[name]
    if seed := re.fullmatch(r"scramble:([0-9]{1,9})", name):
        return Scramble(int(seed[1]))
    raise ConfigError(key_path, f"expected one of {EXPECTED}, got {name[:60]!r}")
