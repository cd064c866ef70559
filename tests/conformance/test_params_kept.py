"""A parameter that was echoed is stored, and param.pck is made once per change."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.ftp import Ftp
from support.params import send_set, value_of
from support.world import world

from anafi_mav.services.parameter import parameter_service
from anafi_mav.state_lock import STATE_WRITER, state_folder

REAL32 = 9
SLOW = 0.5
"""s that the disk of these tests is busy with something else."""


def stored(serial: str) -> dict[str, float]:
    """The settings in the state file at this moment."""
    folder = state_folder(None)
    assert folder is not None
    path = folder / f"{serial}.json"
    if not Path(path).exists():
        return {}
    kept: dict[str, float] = json.loads(path.read_text())["settings"].get(parameter_service.KEY, {})
    return kept


@both
async def test_parameter_echo_waits_until_the_value_is_stored(flavour: str) -> None:
    """A gateway that is killed right after the echo has it when it is back: the echo comes after the file."""
    async with world(flavour=flavour) as w:
        serial = w.drone.identity.serial
        other = await w.connect(sysid=254)
        for name, value in (("ANF_GCS_LOSS_T", 7.0), ("ANF_TKOFF_ALT", 6.0), ("ANF_GCS_LOSS_T", 9.0)):
            STATE_WRITER.submit(time.sleep, SLOW)  # a slow memory card
            marks = w.client.mark(), other.mark()
            send_set(w.client, name, value, REAL32, flavour)
            for client, mark in zip((w.client, other), marks, strict=True):
                echo = await client.wait(
                    "PARAM_VALUE", lambda m, name=name: m.param_id == name, since=mark, timeout=10.0
                )
                assert value_of(echo, flavour) == value
                assert stored(serial)[name] == value


async def test_parameter_read_during_storing_waits_too() -> None:
    async with world() as w:
        STATE_WRITER.submit(time.sleep, SLOW)
        send_set(w.client, "ANF_GCS_LOSS_T", 7.0, REAL32)
        answers = []
        while 7.0 not in answers:
            mark = w.client.mark()
            w.client.send(dialect.MAVLink_param_request_read_message(1, 1, b"ANF_GCS_LOSS_T", -1))
            answers.append(value_of(await w.client.wait("PARAM_VALUE", since=mark, timeout=10.0)))
        assert stored(w.drone.identity.serial)["ANF_GCS_LOSS_T"] == 7.0


async def test_parameters_written_together_are_stored_before_their_echo() -> None:
    async with world() as w:
        serial = w.drone.identity.serial
        STATE_WRITER.submit(time.sleep, SLOW)
        mark = w.client.mark()
        for value in (7.0, 8.0, 9.0):
            send_set(w.client, "ANF_GCS_LOSS_T", value, REAL32)
            send_set(w.client, "ANF_TKOFF_ALT", value - 2.0, REAL32)
        for name, value in (("ANF_GCS_LOSS_T", 9.0), ("ANF_TKOFF_ALT", 7.0)):
            await w.client.wait(
                "PARAM_VALUE", lambda m, n=name, v=value: m.param_id == n and value_of(m) == v, since=mark, timeout=10.0
            )
            assert stored(serial)[name] == value


async def test_param_pck_is_made_once_per_change(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    make = parameter_service.packed_file

    def counted(*arguments: object) -> bytes:
        made.append(1)
        return make(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(parameter_service, "packed_file", counted)
    async with world(flavour="ardupilot") as w:
        ftp = Ftp(w.client)
        first = await ftp.download("@PARAM/param.pck")
        for _ in range(3):
            assert await ftp.download("@PARAM/param.pck") == first
        assert len(made) == 1
        mark = w.client.mark()
        send_set(w.client, "ANF_GCS_LOSS_T", 7.0, REAL32, "ardupilot")
        await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "ANF_GCS_LOSS_T", since=mark)
        changed = await ftp.download("@PARAM/param.pck")
        assert changed != first
        assert len(made) == 2
        # The drone's own settings are in it, too.
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_param_set_message(1, 1, b"ANF_MAX_TILT", 21.0, REAL32))
        await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "ANF_MAX_TILT" and m.param_value == 21.0, since=mark)
        assert await ftp.download("@PARAM/param.pck") not in (first, changed)
        assert len(made) == 3
