"""A client behind a radio of 2000 bytes/s: what it gets, and that it is answered."""

from __future__ import annotations

import asyncio
import time
from collections import Counter

from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import Client
from support.world import OPTIONS_PORT, world

RATE = 2000


def size(client: Client, since: float) -> int:
    return sum(len(message.get_msgbuf()) for at, message in client.received if at >= since)


async def test_client_with_a_byte_budget_gets_a_subset_that_fits() -> None:
    async with world(options=[f"bytes_per_second={RATE}"]) as w:
        radio = await w.connect(250, port=OPTIONS_PORT)
        await w.take_off(5.0)
        await asyncio.sleep(10.0)
        began = time.monotonic()
        await asyncio.sleep(20.0)
        elapsed = time.monotonic() - began
        assert 0.5 * RATE < size(radio, began) / elapsed <= 1.02 * RATE
        assert size(w.client, began) > 1.2 * size(radio, began)
        rates = Counter(message.get_type() for at, message in radio.received if at >= began)
        assert rates["HEARTBEAT"] >= 2 * 18  # of two components
        for kind, least in (("ATTITUDE", 2.0), ("GLOBAL_POSITION_INT", 2.0), ("SYS_STATUS", 0.4), ("GPS_RAW_INT", 0.8)):
            assert rates[kind] / elapsed > least, rates
        assert not rates.keys() & {"ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "ALTITUDE", "MOUNT_ORIENTATION"}
        sent = time.monotonic()
        assert (await radio.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result == 0
        assert time.monotonic() - sent < 0.5
        mark = radio.mark()
        radio.send(dialect.MAVLink_param_request_list_message(1, 1))
        last = await radio.wait("PARAM_VALUE", lambda m: m.param_index == m.param_count - 1, since=mark, timeout=120.0)
        got = {message.param_index for _, message in radio.since(mark, "PARAM_VALUE")}
        assert {*range(last.param_count)} <= got
        assert size(radio, sent) / (time.monotonic() - sent) <= 1.05 * RATE
        assert (await radio.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 31, 5e5)).result == 0
        await radio.wait("ATTITUDE_QUATERNION")  # on request
