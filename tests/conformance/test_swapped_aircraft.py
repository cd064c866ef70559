"""Another aircraft at the address of an earlier one: every ANAFI has 192.168.42.1 in its own Wi-Fi."""

from __future__ import annotations

from support.flavours import both
from support.mav import Client
from support.params import fetch, value_of, write
from support.world import HOME, loopback

from anafi_mav.config import Config, DroneConfig, HttpConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator

INT32, REAL32 = 6, 9
ELSEWHERE = (HOME[0] + 0.01, HOME[1], HOME[2])
"""A place 1.1 km from home."""


@both
async def test_aircraft_of_another_model_has_its_own_parameters_and_origin(flavour: str) -> None:
    address, local = loopback(), loopback()
    config = Config(
        endpoints=(f"tcpin://{local}:5760?flavour={flavour}",),
        drones=(DroneConfig(name="alpha", sysid=1, address=address),),
        video=False,
        http=HttpConfig(port=0),
    )

    def aircraft(model: str, serial: str, home: tuple[float, float, float]) -> Simulator:
        spec = DroneSpec(model=model, address=address, home=home, serial=serial, http_port=None, rtsp_port=None)
        return Simulator([spec], speed=1.0, seed=1)

    async with Gateway(config):
        client = await Client().connect(5760, local)
        try:
            async with aircraft("4k", "PI040416AA0A000001", HOME):
                await client.wait("LOCAL_POSITION_NED", since=0, timeout=60.0)
                first = await fetch(client, flavour)
                assert "ANF_OBS_AVOID" not in first
                assert (await write(client, "ANF_HAND_LAUNCH", 1, INT32, flavour)).param_id == "ANF_HAND_LAUNCH"
                await write(client, "ANF_CRUISE_SPEED", 2.0, REAL32, flavour)
            mark = client.mark()
            async with aircraft("ai", "PI051416AA0A000002", ELSEWHERE):
                place = await client.wait("LOCAL_POSITION_NED", since=mark, timeout=60.0)
                assert abs(place.x) < 1.0
                # The values that differ are sent to every client, those of new parameters too.
                pushed = {m.param_id: m for _, m in client.since(mark, "PARAM_VALUE")}
                assert {"ANF_MODEL", "ANF_OBS_AVOID", "ANF_HAND_LAUNCH", "ANF_CRUISE_SPEED"} <= pushed.keys()
                second = await fetch(client, flavour)
                assert [m.param_index for m in second.values()] == list(range(len(second)))
                assert len({m.param_count for m in second.values()} | {len(second)}) == 1
                for name, value in (("ANF_MODEL", 0x091A), ("ANF_HAND_LAUNCH", 0), ("ANF_CRUISE_SPEED", 0)):
                    assert value_of(second[name], flavour) == value
                echo = await write(client, "ANF_OBS_AVOID", 1, INT32, flavour)
                assert value_of(echo, flavour) == 1
                assert second["ANF_OBS_AVOID"].param_index == echo.param_index
        finally:
            await client.close()
