"""The one height: metres above the take-off point, and its bridge to mean sea level. No I/O.

ARSDK flies in heights above take-off (ATO) and reports GPS altitude above mean sea level (AMSL). While the drone
stands, the AMSL height of the take-off point is latched as GPS AMSL minus ATO; from then on AMSL is ATO plus that
number. GPS altitude drifts by metres, so in flight the number is not corrected any more.

A gateway that finds the drone in the air has not seen it stand. It uses the number that it kept from before, if that
belongs to the same flight. Otherwise it takes GPS AMSL minus ATO once, and the number counts as an estimate.

The drone counts ATO again from each take-off. After a landing elsewhere it stands at an ATO that is not 0, so the point
of the next take-off is another one than that of the last: its AMSL height is what GPS says there.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec
from typing_extensions import Self

ESTIMATE_ERROR = 10.0
"""m by which an estimate may be wrong.

GPS altitude now is compared with GPS altitude some minutes earlier, at the take-off.
"""

ESTIMATE_FLOOR = 15.0
"""m above the estimated ground below which no AMSL target is flown to."""


class TakeoffRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Take-off point of a flight and initiators of its descent, for the next connection or run."""

    flight_id: str
    amsl: float
    """m."""
    estimated: bool
    latitude: float | None = None
    """deg; None without a fix at take-off."""
    longitude: float | None = None
    landing: str | None = None
    """Name of the `Initiator` of the landing under way; None without one."""
    returning: str | None = None
    """That of the return under way."""

    @classmethod
    def read(cls, kept: Any) -> Self | None:
        """Return the record that `written` made, or None when it is invalid: people can edit files."""
        try:
            record = msgspec.convert(kept, cls)
        except msgspec.ValidationError:
            return None
        place = (record.latitude, record.longitude)
        if not record.flight_id or not math.isfinite(record.amsl) or (None in place and place != (None, None)):
            return None
        if record.latitude is not None and record.longitude is not None:
            on_earth = abs(record.latitude) <= 90.0 and abs(record.longitude) <= 180.0
            return record if on_earth else None
        return record

    @property
    def written(self) -> Any:
        """As plain JSON values."""
        return msgspec.to_builtins(self)


class HeightReference:
    """AMSL height of the take-off point, once known."""

    def __init__(self) -> None:
        self._takeoff_amsl: float | None = None
        self._estimated = False
        self._standing_amsl: float | None = None
        """AMSL height (m) at which the drone stands, which is where it will take off."""
        self._flight_id = ""
        self._kept: TakeoffRecord | None = None
        """From an earlier connection; counts only for the flight that it names."""

    @property
    def takeoff_amsl(self) -> float | None:
        """m; None until the drone has reported GPS altitude and height above take-off."""
        return self._takeoff_amsl

    @property
    def estimated(self) -> bool:
        """True when the take-off was not seen: AMSL heights may be wrong by `ESTIMATE_ERROR`."""
        return self._estimated

    @property
    def flight_id(self) -> str:
        """Id of the flight that the number belongs to; empty on the ground or when unreported."""
        return self._flight_id

    def on_ground(self, gps_amsl: float | None, ato: float | None) -> None:
        """Latch the newest readings (m) while the drone stands."""
        if gps_amsl is not None:
            self._takeoff_amsl, self._estimated = gps_amsl - (ato or 0.0), False
            self._standing_amsl = gps_amsl
        elif self._takeoff_amsl is not None and ato is not None:
            self._standing_amsl = self._takeoff_amsl + ato
        self._flight_id, self._kept = "", None

    def take_off(self) -> None:
        """Note that the drone leaves the ground, and counts its height from there."""
        if self._standing_amsl is not None:
            self._takeoff_amsl = self._standing_amsl
            self._standing_amsl = None

    def recall(self, kept: TakeoffRecord | None) -> None:
        """Take the record of this drone's last flight.

        It is used once the drone reports the same flight.
        """
        self._kept = kept

    def in_flight(self, flight_id: str | None, gps_amsl: float | None, ato: float | None) -> bool:
        """Note that the drone flies the flight with this id, at these readings (m).

        Return True when an estimate was made.

        The id is only compared with the kept one: within one connection every landing is seen, and a firmware may
        report the id of a new flight some seconds late.
        """
        self._flight_id = flight_id or self._flight_id
        kept, missing = self._kept, self._takeoff_amsl is None
        if kept is not None and kept.flight_id == self._flight_id and (missing or self._estimated):
            self._takeoff_amsl, self._estimated, self._kept = kept.amsl, kept.estimated, None
            return False
        if not missing or gps_amsl is None or ato is None:
            return False
        self._takeoff_amsl, self._estimated = gps_amsl - ato, True
        return True

    def link_down(self) -> None:
        """Forget the number: without a link the drone may have landed elsewhere and taken off again."""
        self._takeoff_amsl = self._standing_amsl = self._kept = None
        self._estimated, self._flight_id = False, ""

    def ato(self, amsl: float) -> float | None:
        """Return the height (m) above the take-off point of an AMSL height; None without a latch.

        On the ground it is that of the next take-off.
        """
        reference = self._takeoff_amsl if self._standing_amsl is None else self._standing_amsl
        return None if reference is None else amsl - reference

    def amsl(self, ato: float) -> float | None:
        """Return the AMSL height (m) of a height above take-off; None without a latch."""
        return None if self._takeoff_amsl is None else ato + self._takeoff_amsl
