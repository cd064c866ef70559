"""The modes that a station shows at the end of a return that the drone ends by landing: no other between the two."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.world import ARMED, world

from anafi_mav.arsdk.messages import rth
from anafi_mav.arsdk.messages.rth import RthEndingBehavior, RthState, StateReason

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
RETURN = dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH


def shown(beats: list[int]) -> list[int]:
    """Each mode once, in its order."""
    return [mode for before, mode in zip([-1, *beats], beats, strict=False) if mode != before]


@both
async def test_return_ended_by_landing_shows_no_mode_between(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        w.drone.firmware.settings.set("rth_ending", RthEndingBehavior.LANDING)
        w.drone.inject(rth.EndingBehavior(RthEndingBehavior.LANDING))
        mark = w.client.mark()
        w.drone.inject(rth.State(RthState.IN_PROGRESS, StateReason.CONNECTION_LOST))  # the drone's own
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, since=mark)
        w.drone.inject(rth.State(RthState.AVAILABLE, StateReason.FINISHED))
        await w.client.wait("SYS_STATUS")
        assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result == ACCEPTED
        beats = [m.custom_mode for _, m in w.client.since(mark, "HEARTBEAT")]
        assert shown(beats)[-1] == w.modes.returning
        # Nothing landed: after two seconds it holds.
        await w.client.heartbeat(lambda beat: beat.custom_mode not in (w.modes.returning, w.modes.land))


@both
async def test_commanded_return_ended_by_landing_shows_return_and_land(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        w.drone.firmware.settings.set("rth_ending", RthEndingBehavior.LANDING)
        w.drone.inject(rth.EndingBehavior(RthEndingBehavior.LANDING))
        mark = w.client.mark()
        assert (await w.client.command(RETURN)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=40.0)
        beats = [m.custom_mode for _, m in w.client.since(mark, "HEARTBEAT") if m.base_mode & ARMED]
        assert set(beats) <= {w.modes.returning, w.modes.land}
        assert shown(beats)[0] == w.modes.returning
        assert len(shown(beats)) <= 2
