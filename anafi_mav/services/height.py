"""The one height: metres above the take-off point, and its bridge to mean sea level.

ARSDK flies in heights above take-off (ATO) and reports GPS altitude above mean sea level (AMSL). While the drone
stands, the AMSL height of the take-off point is latched as GPS AMSL minus ATO; from then on AMSL is ATO plus that
number. Two GPS readings are never subtracted in flight: they drift by metres.

The drone counts ATO anew from each take-off. After a landing elsewhere it stands at an ATO that is not 0, so the point
of the next take-off is another one than that of the last: its AMSL height is what GPS says there.
"""

from __future__ import annotations


class HeightReference:
    """AMSL height of the take-off point, once known."""

    def __init__(self) -> None:
        self._takeoff_amsl: float | None = None
        self._standing_amsl: float | None = None
        """Where the drone stands, which is where it will take off."""
        self._flight_id: str | None = None

    @property
    def takeoff_amsl(self) -> float | None:
        """m; None until the drone stood with a GPS fix while we listened."""
        return self._takeoff_amsl

    def on_ground(self, gps_amsl: float | None, ato: float | None) -> None:
        """The drone stands: latch the newest readings (m)."""
        if gps_amsl is not None:
            self._takeoff_amsl = gps_amsl - (ato or 0.0)
            self._standing_amsl = gps_amsl
        self._flight_id = None

    def take_off(self) -> None:
        """The drone leaves the ground, and counts its height from there."""
        if self._standing_amsl is not None:
            self._takeoff_amsl = self._standing_amsl
            self._standing_amsl = None

    def in_flight(self, flight_id: str | None) -> None:
        """The drone flies the flight with this id. Another flight than the one latched for ends the latch.

        After a lost link the drone may have landed elsewhere and taken off again without us.
        """
        if not flight_id:
            return
        if self._flight_id is None:
            self._flight_id = flight_id
        elif self._flight_id != flight_id:
            self._takeoff_amsl, self._flight_id = None, flight_id

    def link_down(self, *, flying: bool) -> None:
        """A latch made on the ground is worth nothing after a silence in which the drone may have moved."""
        self._standing_amsl = None
        if not flying or self._flight_id is None:
            self._takeoff_amsl = None

    def ato(self, amsl: float) -> float | None:
        """Height (m) above the take-off point, on the ground the next one, of an AMSL height; None without a latch."""
        reference = self._takeoff_amsl if self._standing_amsl is None else self._standing_amsl
        return None if reference is None else amsl - reference

    def amsl(self, ato: float) -> float | None:
        """AMSL height (m) of a height above take-off; None without a latch."""
        return None if self._takeoff_amsl is None else ato + self._takeoff_amsl
