"""Element poi: nose, and on request the camera, held on a place while the pilot flies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages import poi as modern
from anafi_mav.arsdk.messages.ardrone3 import PoiMode, PoiStatus
from anafi_mav.arsdk.messages.poi import Indicator
from anafi_mav.drone.element import Position, Reducer, members, position
from anafi_mav.drone.expectation import ANSWER_TIMEOUT
from anafi_mav.drone.sent_commands import SentCommand, Slot
from anafi_mav.drone.settings import Commanding
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.errors import AnafiMavError, CommandRejected, LocalProtocolError

_SAME_PLACE_DEG = 1e-7
"""About a centimetre."""


class PoiState(msgspec.Struct, frozen=True):
    """The point of interest that the drone looks at."""

    status: PoiStatus | None = None
    target: Position | None = None
    """Altitude above the take-off point."""
    mode: PoiMode | None = None
    """Relation of the gimbal to the place."""
    missing: frozenset[Indicator] | None = None
    """Missing inputs; empty = available. Ai only."""


class Poi(Commanding[PoiState]):
    """A place that the drone looks at while a pilot flies it."""

    NOTHING = PoiState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        ardrone3.PilotedPOIV2: lambda state, m: replace(
            state, status=m.status, target=position(m.latitude, m.longitude, m.altitude), mode=m.mode
        ),
        modern.Info: lambda state, m: replace(state, missing=members(m.missing_inputs, Indicator)),
    }

    async def start(
        self,
        latitude: float,
        longitude: float,
        altitude: float,
        mode: PoiMode = PoiMode.LOCKED_GIMBAL,
        timeout: float = ANSWER_TIMEOUT,
    ) -> None:
        """Point the nose at a place (deg, deg, m above take-off).

        Returns when the drone does, or will once it hovers. LOCKED_GIMBAL points the camera too, FREE_GIMBAL leaves
        it to the gimbal's verbs. Raises `CommandRejected` when it is unavailable: not flying, or no GPS. A start that
        times out or is cancelled is withdrawn.
        """
        if position(latitude, longitude, altitude) is None:
            raise LocalProtocolError(f"no place on earth: {latitude}, {longitude}, {altitude}")
        self._commander.require_feature(self.state.status, "points of interest")
        if self.state.status == PoiStatus.UNAVAILABLE:
            raise CommandRejected(self._why())

        def judge(message: Any) -> bool | AnafiMavError | None:
            if message.status == PoiStatus.UNAVAILABLE:
                return CommandRejected(self._why())
            same = math.isclose(message.latitude, latitude, rel_tol=0.0, abs_tol=_SAME_PLACE_DEG) and math.isclose(
                message.longitude, longitude, rel_tol=0.0, abs_tol=_SAME_PLACE_DEG
            )
            accepted = same and message.mode == mode and message.status in (PoiStatus.RUNNING, PoiStatus.PENDING)
            return True if accepted else None

        command = ardrone3.StartPilotedPOIV2(latitude, longitude, altitude, mode)
        sent = SentCommand(Slot.POI, undo=ardrone3.StopPilotedPOI())
        await self._commander.begin(sent, command, (ardrone3.PilotedPOIV2,), judge, timeout)

    def abort(self) -> None:
        """Command the end of pointing at the place, without waiting.

        An unanswered start is withdrawn. Does nothing without a place or a link.
        """
        self._commander.abort_pending("stopped", Slot.POI)
        if self.state.status in (PoiStatus.RUNNING, PoiStatus.PENDING):
            self._commander.send_stop_if_connected(ardrone3.StopPilotedPOI())

    async def stop(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """End pointing at the place; returns at once when none is active or about to be."""
        self._commander.require_feature(self.state.status, "points of interest")
        self._commander.abort_pending("stopped", Slot.POI)
        await self._commander.stops_delivered(ardrone3.StopPilotedPOI.NAME, timeout)
        if self.state.status not in (PoiStatus.RUNNING, PoiStatus.PENDING):
            return
        await self._commander.confirm(
            ardrone3.StopPilotedPOI(),
            (ardrone3.PilotedPOIV2,),
            lambda message: True if message.status in (PoiStatus.AVAILABLE, PoiStatus.UNAVAILABLE) else None,
            timeout,
        )

    def _why(self) -> str:
        lacks = ", ".join(spoken(one) for one in sorted(self.state.missing or ()))
        return f"a point of interest is unavailable: {lacks}" if lacks else "a point of interest is unavailable"
