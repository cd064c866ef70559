"""A drone whose turn among many others does not come: heartbeats and watches do not wait for it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.params import write
from support.world import world

GCS = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3)


class Turns:
    """The calls that wait for their turn in the running event loop."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self._waiting: dict[Callable[[], None], None] = {}
        self._is_held = False
        loop = asyncio.get_running_loop()
        patch.setattr(loop, "call_after_clients", self._request, raising=False)
        patch.setattr(loop, "cancel_after_clients", self._cancel, raising=False)

    def _request(self, call: Callable[[], None]) -> None:
        if self._is_held:
            self._waiting[call] = None
        else:
            call()

    def _cancel(self, call: Callable[[], None]) -> None:
        self._waiting.pop(call, None)

    def hold(self) -> None:
        self._is_held = True

    def release(self) -> int:
        """Make the calls that wait, and return how many."""
        self._is_held = False
        waiting, self._waiting = self._waiting, {}
        for call in waiting:
            call()
        return len(waiting)


async def test_heartbeat_and_link_loss_wait_for_no_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    turns = Turns(monkeypatch)
    async with world(speed=1.0) as w:
        onlooker = await w.connect(sysid=254)
        await write(onlooker, "NAV_DLL_ACT", 3, dialect.MAV_PARAM_TYPE_INT32)
        await write(onlooker, "ANF_GCS_LOSS_T", 4.0)
        await w.take_off(8.0)
        w.client.send(GCS)
        mark = onlooker.mark()
        await onlooker.wait("SYS_STATUS")
        turns.hold()
        mark = onlooker.mark()
        await onlooker.wait("STATUSTEXT", lambda text: "No ground station for 4 s" in text.text, timeout=5.0)
        beats = [at for at, beat in onlooker.since(mark, "HEARTBEAT") if beat.get_srcComponent() == 1]
        assert max(late - early for early, late in pairwise(beats)) < 1.05
        assert len(beats) >= 3
        await w.drone.wait_log(lambda entry: entry.kind == "command" and entry.name.endswith("Piloting.Landing"), 2.0)
        assert onlooker.since(mark, "SYS_STATUS") == []
        mark = onlooker.mark()
        assert turns.release() == 1
        await onlooker.wait("SYS_STATUS", timeout=0.5)
        await onlooker.wait("SYS_STATUS", timeout=1.5)


async def test_turn_that_waits_ends_with_the_link(monkeypatch: pytest.MonkeyPatch) -> None:
    turns = Turns(monkeypatch)
    async with world(speed=1.0) as w:
        await w.client.wait("SYS_STATUS")
        turns.hold()
        await w.client.silence("SYS_STATUS", 1.5)  # a turn waits
        w.drone.faults.mute = True
        await w.client.silence("HEARTBEAT", 2.0)  # the link is lost
        assert turns.release() == 0
        w.drone.faults.mute = False
        mark = w.client.mark()
        await w.client.heartbeat(lambda beat: True, since=mark, timeout=15.0)
        await w.client.wait("SYS_STATUS")
