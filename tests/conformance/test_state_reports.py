"""A state folder that cannot be read is reported to each client that uploads a plan, and to no other."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.plans import circle, upload
from support.world import HOME, loopback, world

from anafi_mav.state_lock import state_folder
from anafi_mav.texts import PLANS_NOT_KEPT


async def test_unreadable_state_file_is_reported_to_each_client_that_uploads() -> None:
    drone, folder = loopback(), state_folder(None)
    assert folder is not None
    async with world(drone_address=drone) as w:
        serial = w.drone.identity.serial
    (folder / f"{serial}.json").mkdir()  # reading it fails, also for root
    async with world(drone_address=drone, clients=3) as w:
        first, second, silent = w.clients
        plan = [circle(HOME[:2], 100.0)]
        for client in (first, second, first):
            mark = client.mark()
            ack = await upload(client, plan, dialect.MAV_MISSION_TYPE_FENCE)
            assert ack.type == dialect.MAV_MISSION_ACCEPTED
            await client.wait("STATUSTEXT", lambda m: m.text == PLANS_NOT_KEPT, since=mark)
        assert PLANS_NOT_KEPT not in [m.text for _, m in silent.since(0, "STATUSTEXT")]
        (problem,) = w.gateway.state_problems()
        assert problem.startswith(f"{folder / serial}.json: Is a directory")
