"""Element flight plan: plans are uploaded to the drone's web server and flown by the drone.

Parrot's file format is not known here: a plan is bytes. 4K, Thermal and USA fly version 1 of it, the Ai version 2; the
drone says which by what it reports (feature flight_plan).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common
from anafi_mav.arsdk.messages import flight_plan as modern
from anafi_mav.arsdk.messages.common import FlightPlanComponent, MavlinkType, PlayError, PlayingState
from anafi_mav.arsdk.messages.flight_plan import Indicator, SupportedCapabilities
from anafi_mav.drone.element import Reducer, members, with_item
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Commander, loop_time
from anafi_mav.drone.rest import Rest
from anafi_mav.drone.sent_commands import PLAN_MEMORY, Phase, SentCommand, Slot
from anafi_mav.drone.settings import Commanding, same_as
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, NotSupported, RemoteProtocolError
from anafi_mav.models import NO_MODEL, Model

API = "/api/v1/upload"
START_TIMEOUT = PLAN_MEMORY
DOUBT_TIMEOUT = ANSWER_TIMEOUT
"""s that a start is awaited after a start error that is attributed to an older one: it may be this one's, and the drone
then reports nothing else."""

_UID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")


class PlanOnDrone(msgspec.Struct, frozen=True):
    """A plan on the drone."""

    uid: str
    date: str = ""


class Recovery(msgspec.Struct, frozen=True):
    """Place at which the last plan was interrupted, to resume it there."""

    uid: str
    custom_id: str
    item: int
    seconds: int
    """Duration flown."""


class FlightPlanState(msgspec.Struct, frozen=True):
    """The flight plan under way, and what the drone needs to fly one."""

    playing: PlayingState | None = None
    uid: str | None = None
    """Id of the plan that plays or is paused; empty without one."""
    type: MavlinkType | None = None
    item: int | None = None
    """Index of the last completed item, from 0; None before the first."""
    skipped: int | None = None
    """Waypoint that was left out. Ai only."""
    available: bool | None = None
    """True when a plan can be started."""
    components: Mapping[FlightPlanComponent, bool] = {}
    """Requirement of a plan -> fulfilled."""
    missing: frozenset[Indicator] | None = None
    """Requirements that a plan lacks. Ai only."""
    capabilities: frozenset[SupportedCapabilities] | None = None
    """Ai only."""
    error: PlayError | None = None
    """Why the drone refused or stopped a plan; None once it plays one."""
    returns_on_disconnect: bool | None = None
    """A lost link ends the plan with a return home."""
    recovery: Recovery | None = None

    @property
    def is_reported(self) -> bool:
        """True for a drone that flies plans.

        It may report a playing state only after the first start (common.xml 0-12-0).
        """
        return self.playing is not None or self.available is not None or bool(self.components)

    @property
    def unavailable(self) -> tuple[str, ...]:
        """Requirements that prevent the flight of a plan, in words."""
        words = [spoken(part) for part, ok in self.components.items() if not ok]
        words += [spoken(one) for one in sorted(self.missing or ())]
        return tuple(words)


def _playing(state: FlightPlanState, message: common.MavlinkFilePlayingStateChanged) -> FlightPlanState:
    begins = message.state == PlayingState.PLAYING and (state.playing != PlayingState.PAUSED or state.item is None)
    same = message.filepath == state.uid
    return replace(
        state,
        playing=message.state,
        uid=message.filepath,
        type=message.type,
        item=None if begins and not (same and state.playing == PlayingState.PLAYING) else state.item,
        skipped=None if begins else state.skipped,
        error=None if begins else state.error,
    )


def _recovery(state: FlightPlanState, message: modern.RecoveryInfo) -> FlightPlanState:
    known = Recovery(message.flightplan_id, message.custom_id, message.item, message.running_time)
    return replace(state, recovery=known if message.flightplan_id else None)


class FlightPlan(Commanding[FlightPlanState]):
    """Flight plans: files in Parrot's format that the drone flies by itself."""

    NOTHING = FlightPlanState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        common.MavlinkFilePlayingStateChanged: _playing,
        common.MissionItemExecuted: lambda state, m: replace(state, item=m.idx),
        common.AvailabilityStateChanged: lambda state, m: replace(state, available=m.AvailabilityState != 0),
        common.ComponentStateListChanged: lambda state, m: replace(
            state, components=with_item(state.components, m.component, m.State != 0, 0)
        ),
        common.MavlinkPlayErrorStateChanged: lambda state, m: replace(state, error=m.error),
        common.ReturnHomeOnDisconnectChanged: lambda state, m: replace(state, returns_on_disconnect=m.state != 0),
        modern.Info: lambda state, m: replace(state, missing=members(m.missing_inputs, Indicator)),
        modern.Capabilities: lambda state, m: replace(
            state, capabilities=members(m.supported_capabilities, SupportedCapabilities)
        ),
        modern.WaypointSkipped: lambda state, m: replace(state, skipped=m.item),
        modern.RecoveryInfo: _recovery,
    }

    def __init__(self, commander: Commander, rest: Rest) -> None:
        super().__init__(commander)
        self._rest = rest
        self.model: Callable[[], Model] = lambda: NO_MODEL
        """Which drone it is; the drone sets it."""
        self.end_unreported: Callable[[], None] = lambda: None
        """Handles the end of a plan that the drone does not report; the drone sets it."""

    def on_playing(self, message: common.MavlinkFilePlayingStateChanged, now: float) -> None:
        """A flight plan plays, is paused or stopped."""
        sent = self._commander.sent.attribute(message, now)
        playing = message.state == PlayingState.PLAYING
        if playing and sent is not None and self._commander.sent.is_unwanted(sent, now):
            self._commander.send_stop_if_connected(common.Stop())

    @property
    def flown(self) -> SentCommand | str | None:
        """The plan that plays, as our start of it, or as the id of another controller's plan.

        None: no plan plays.
        """
        sent = self._commander.sent.in_effect(Slot.PLAN)
        return sent or (self.state.uid if self.state.playing == PlayingState.PLAYING else None)

    @property
    def plays_withdrawn(self) -> bool:
        """True when the drone has reported that it plays a plan whose start was withdrawn."""
        sent = self._commander.sent.in_effect(Slot.PLAN)
        return sent is not None and sent.phase is Phase.WITHDRAWN

    def attribute_line(self, line: int, now: float) -> bool:
        """Attribute a line that is reported as executed to a plan, once for each report.

        Return True when it is of the plan before the newest one.
        """
        return self._commander.sent.attribute_line(line, now)[1]

    def is_skipped_late(self, line: int, now: float) -> bool:
        """Return True when a line that is reported as left out is of the plan before the newest one."""
        return self._commander.sent.plan_of_line(line, now)[1]

    def is_undecided(self, uid: str) -> bool:
        """Return True when an earlier start of this plan may still begin; `start` refuses it then."""
        return self._commander.sent.is_undecided(uid, loop_time())

    @property
    def version(self) -> int:
        """Version of the file format that this drone flies: 1, or 2 on the Ai.

        The model decides. Of a model that is not known, the events that the Ai alone is known to send.
        """
        figures = self.model().plan_figures
        if figures is not None:
            return figures.version
        return 1 if self.state.missing is None and self.state.capabilities is None else 2

    @property
    def starts_anywhere(self) -> bool:
        """True when `start` takes an `item` and `continue_on_disconnect`."""
        return SupportedCapabilities.START_AT_V2 in (self.state.capabilities or frozenset())

    # -- files

    async def upload(self, plan: bytes) -> str:
        """Upload a plan; return the id that the drone gives it, for `start`.

        Raises `CommandRejected` when the web server refuses it, `CommandTimeout`, `RemoteProtocolError`.
        """
        self._available()
        uid = await self._rest.json("PUT", f"{API}/flightplan", plan)
        if not isinstance(uid, str) or not _UID.fullmatch(uid):
            raise RemoteProtocolError(f"the drone took the flight plan and gave it no name: {uid!r:.80}")
        return uid

    async def list(self) -> tuple[PlanOnDrone, ...]:
        """Return the plans on the drone."""
        self._available()
        answer = await self._rest.json("GET", f"{API}/flightplans")
        try:
            return msgspec.convert(answer, tuple[PlanOnDrone, ...], strict=False)
        except (msgspec.ValidationError, RecursionError) as error:
            raise RemoteProtocolError(f"the drone's list of flight plans: {error}") from error

    async def get(self, uid: str) -> dict[str, Any]:
        """Return the details of one plan.

        Raises `CommandRejected` when the drone has none with this id.
        """
        self._available()
        answer = await self._rest.json("GET", f"{API}/flightplan/{_checked(uid)}")
        if not isinstance(answer, dict):
            raise RemoteProtocolError(f"the drone reports nothing of flight plan {uid}")
        return answer

    async def delete(self, uid: str) -> bool:
        """Delete a plan; False when the drone does not: Parrot documents no way to do it."""
        self._available()
        try:
            await self._rest.read("DELETE", f"{API}/flightplan/{_checked(uid)}")
        except CommandRejected:
            return False
        return True

    # -- flying

    async def start(
        self,
        uid: str,
        item: int = 0,
        type: MavlinkType | None = None,
        *,
        continue_on_disconnect: bool | None = None,
        timeout: float = START_TIMEOUT,
        cause: object = None,
    ) -> None:
        """Fly an uploaded plan, or resume the paused one; returns when it plays.

        `item` (from 0) is where it begins, `continue_on_disconnect` flies on without a link: Ai only. Raises
        `CommandRejected` with what the drone lacks, `CommandTimeout`. A start that times out or is cancelled is
        withdrawn, also when the drone begins the plan only then. Until that is decided (20 s at most) another start of
        the same plan raises `CommandRejected`: the drone's report names the plan alone, so it could confirm the wrong
        one. The same file uploaded again is another plan. `cause`: see `flown`.
        """
        self._available()
        command = self._start(uid, item, type, continue_on_disconnect)
        if self.is_undecided(uid):
            raise CommandRejected("an earlier start may still begin")
        sent = SentCommand(Slot.PLAN, uid, common.Stop(), plan_before=self.state.uid, cause=cause)
        resumes = item == 0 and self.state.playing == PlayingState.PAUSED and self.state.uid == uid
        sent.line = self._commander.sent.newest_line(uid) if resumes else item - 1
        begun = loop_time()

        def judge(message: Any) -> bool | AnafiMavError | None:
            if sent.phase is Phase.REFUSED:
                return CommandRejected(self._why())
            if sent.awaited and isinstance(message, common.StartingErrorEvent):
                seconds = max(0.0, min(begun + timeout - loop_time(), DOUBT_TIMEOUT))
                sent.answer.expire_after(seconds, command.NAME)
            return True if sent.phase is Phase.CONFIRMED else None

        answers = (common.MavlinkFilePlayingStateChanged, common.StartingErrorEvent)
        try:
            await self._commander.begin(sent, command, answers, judge, timeout)
        except CommandTimeout:
            if self.state.unavailable:
                raise CommandRejected(self._why()) from None
            raise

    def _start(self, uid: str, item: int, type: MavlinkType | None, goes_on: bool | None) -> Message:
        kind = type
        if kind is None:
            kind = MavlinkType.FLIGHT_PLAN if self.version == 1 else MavlinkType.FLIGHT_PLAN_V2
        if item == 0 and goes_on is None:
            return common.Start(uid, kind)
        can = self.state.capabilities or frozenset()
        other = modern.MavlinkType(kind)
        if SupportedCapabilities.START_AT_V2 in can:
            return modern.StartAtV2(uid, uid, other, item, int(bool(goes_on)))
        if SupportedCapabilities.START_AT in can and goes_on is None:
            return modern.StartAt(uid, uid, other, item)
        raise NotSupported("start of a flight plan in its middle" if item else "flight plans without a link")

    def _why(self) -> str:
        reasons = ", ".join(self.state.unavailable)
        return f"the flight plan cannot be flown: {reasons}" if reasons else "the drone cannot start the flight plan"

    def suspend(self) -> None:
        """Pause without waiting for the drone's confirmation; an unconfirmed start is withdrawn."""
        self._commander.abort_pending("something else flies", Slot.PLAN)
        if self.state.playing == PlayingState.PLAYING or self._commander.sent.is_executed(Slot.PLAN):
            self._commander.send_stop_if_connected(common.Pause())

    async def pause(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Hover; `start` with the same plan resumes it. Raises `CommandRejected` when no plan plays."""
        self._available()
        if self.state.playing != PlayingState.PLAYING:
            raise CommandRejected("no flight plan plays")
        await self._end(common.Pause(), PlayingState.PAUSED, timeout)

    async def stop(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """End the plan and hover; returns at once when none is playing, paused or starting.

        A drone that has ended its plan without a report may have nothing to answer: a plan that does not play counts as
        stopped when the drone has received the command and then reported nothing.
        """
        self._available()
        self._commander.abort_pending("stopped", Slot.PLAN)
        await self._commander.stops_delivered(common.Stop.NAME, timeout)
        if self.state.playing == PlayingState.PLAYING:
            await self._end(common.Stop(), PlayingState.STOPPED, timeout)
        elif self.state.playing == PlayingState.PAUSED:
            await self._end_paused(timeout)

    async def _end_paused(self, timeout: float) -> None:
        judge: Callable[[Any], bool | None] = lambda message: True if message.state == PlayingState.STOPPED else None  # noqa: E731
        end = self._commander.expect((common.MavlinkFilePlayingStateChanged,), judge)
        try:
            delivery = self._commander.send_stop(common.Stop())
            if not await end.wait_or_quiet(delivery, common.Stop.NAME, timeout):
                self.end_unreported()
        finally:
            end.close()

    async def _end(self, command: Message, wanted: PlayingState, timeout: float) -> None:
        ends = (wanted, PlayingState.STOPPED)
        judge: Callable[[Any], bool | None] = lambda message: True if message.state in ends else None  # noqa: E731
        await self._commander.confirm(command, (common.MavlinkFilePlayingStateChanged,), judge, timeout)
        if self.state.playing != wanted:
            raise CommandRejected("the flight plan has ended")

    async def set_returns_on_disconnect(self, on: bool) -> bool:
        """Set if a lost link ends a plan with a return home."""
        self._commander.require_feature(self.state.returns_on_disconnect, common.ReturnHomeOnDisconnect.NAME)
        return await self._change(
            common.ReturnHomeOnDisconnect(int(on)),
            common.ReturnHomeOnDisconnectChanged,
            lambda message: bool(message.state),
            same_as(on),
        )

    def _available(self) -> None:
        self._commander.require_feature(self.state.is_reported or None, "flight plans")


def _checked(uid: str) -> str:
    """A name that can stand in a path."""
    if not _UID.fullmatch(uid):
        raise CommandRejected(f"{uid!r} is no flight plan of the drone")
    return uid
