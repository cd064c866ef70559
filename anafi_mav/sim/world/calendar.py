"""The drone's wall clock: what a controller set it to, going on in simulated time."""

from __future__ import annotations

import re
from datetime import datetime, timedelta, timezone

_SHAPE = re.compile(r"(\d{8}T\d{6})([+-])(\d{2})(\d{2})")


class Calendar:
    """Dates as Parrot writes them: ``20180616T141516+0100`` (ISO 8601 basic)."""

    def __init__(self, unix_time: float = 0.0) -> None:
        """`unix_time`: s since 1970 at simulated time 0."""
        self._base = unix_time
        self._zone = timezone.utc

    def begin(self, unix_time: float) -> None:
        """Set the date of simulated time 0, in UTC, as GPS does for a drone without a client's time."""
        self._base, self._zone = unix_time, timezone.utc

    def set(self, text: str, time: float) -> bool:
        """It is `text` at simulated time `time`.

        False, and nothing is changed, when that is no date.
        """
        shape = _SHAPE.fullmatch(text)
        if shape is None:
            return False
        stamp, sign, hours, minutes = shape.groups()
        offset = timedelta(hours=int(hours), minutes=int(minutes))
        try:
            zone = timezone(-offset if sign == "-" else offset)
            moment = datetime.strptime(stamp, "%Y%m%dT%H%M%S").replace(tzinfo=zone)
        except ValueError:
            return False
        self._zone = zone
        self._base = moment.timestamp() - time
        return True

    def date(self, time: float) -> str:
        return datetime.fromtimestamp(self._base + time, self._zone).strftime("%Y%m%dT%H%M%S%z")

    def milliseconds(self, time: float) -> int:
        """Since 1970, UTC."""
        return round((self._base + time) * 1000.0)
