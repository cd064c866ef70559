"""Items 111, 112, 149 and 153 of the conformance list: clocks, texts, the banner, the shell and the tune."""

from __future__ import annotations

import asyncio
import statistics
import time
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.mav import Client
from support.plans import Item, around, circle, upload
from support.world import HOME, World, world

from anafi_mav import __version__
from anafi_mav.arsdk.messages import ardrone3, battery, rth
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.mavlink import dialect as newer

ACCEPTED, UNSUPPORTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_UNSUPPORTED
WHOLE = 1 << ListFlags.FIRST | 1 << ListFlags.LAST


def texts(messages: list[Any]) -> list[tuple[int, str]]:
    """(severity, text) of STATUSTEXTs, the chunks of long ones put together as ground stations do."""
    whole: list[tuple[int, str]] = []
    parts: dict[int, list[tuple[int, str]]] = {}
    for message in messages:
        if message.id == 0:
            whole.append((message.severity, message.text))
            continue
        chunks = parts.setdefault(message.id, [])
        assert message.chunk_seq == len(chunks)
        chunks.append((message.severity, message.text))
        if len(message.text) < 50:
            whole.append((message.severity, "".join(text for _, text in parts.pop(message.id))))
    assert not parts
    return whole


def heard(client: Client, mark: int) -> list[tuple[int, str]]:
    return texts([m for _, m in client.since(mark, "STATUSTEXT")])


async def text(client: Client, wanted: str, mark: int, timeout: float = 5.0) -> int:
    """The severity of the first text that begins so."""
    await client.wait(
        "STATUSTEXT",
        lambda m: any(t.startswith(wanted) for _, t in heard_so_far(client, mark)),
        since=mark,
        timeout=timeout,
    )
    return next(severity for severity, said in heard_so_far(client, mark) if said.startswith(wanted))


def heard_so_far(client: Client, mark: int) -> list[tuple[int, str]]:
    """Without a text whose last chunk has not come yet."""
    messages = [m for _, m in client.since(mark, "STATUSTEXT")]
    while messages and messages[-1].id and len(messages[-1].text) == 50:
        unfinished = messages[-1].id
        messages = [m for m in messages if m.id != unfinished]
    return texts(messages)


@both
async def test_conf_111_timesync_and_ping(flavour: str) -> None:
    async with world(clients=2, flavour=flavour) as w:
        first, second = w.clients
        mark, others = first.mark(), second.mark()
        delays = []
        for number in range(1, 21):
            began = time.monotonic()
            first.send(dialect.MAVLink_timesync_message(0, number))
            answer = await first.wait("TIMESYNC", lambda m, n=number: m.ts1 == n, since=mark)
            delays.append(time.monotonic() - began)
            assert answer.tc1 > 0
        assert statistics.median(delays) < 0.020
        # One clock: the answer counts what the streams count.
        stream = await first.wait("ATTITUDE")
        first.send(dialect.MAVLink_timesync_message(0, 99))
        answer = await first.wait("TIMESYNC", lambda m: m.ts1 == 99, since=mark)
        assert answer.tc1 / 1e6 == pytest.approx(stream.time_boot_ms, abs=500)
        for number in range(5):
            first.send(dialect.MAVLink_ping_message(123456 + number, number, 0, 0))
            pong = await first.wait("PING", lambda m, n=number: m.seq == n, since=mark)
            assert (pong.time_usec, pong.target_system, pong.target_component) == (123456 + number, 255, 190)
        first.send(dialect.MAVLink_timesync_message(5, 600))  # another client's answer
        first.send(dialect.MAVLink_ping_message(1, 77, 1, 1))  # and another
        await first.heartbeat(lambda beat: True)
        assert not [m for _, m in first.since(mark, "PING") if m.seq == 77]
        assert not [m for _, m in first.since(mark, "TIMESYNC") if m.ts1 == 600]
        # Answers go to who asked; questions are passed on to everybody, as any broadcast.
        assert all(m.tc1 == 0 or m.ts1 == 600 for _, m in second.since(others, "TIMESYNC"))
        assert all(m.target_system == 0 or m.seq == 77 for _, m in second.since(others, "PING"))


async def test_conf_111_system_time() -> None:
    async with world() as w:
        observed = await w.client.wait("SYSTEM_TIME")
        assert observed.time_unix_usec / 1e6 == pytest.approx(time.time(), abs=0.5)
        attitude = await w.client.wait("ATTITUDE")
        assert 0 <= attitude.time_boot_ms - observed.time_boot_ms < 1500


@both
async def test_conf_112_long_texts_and_severities(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        place = (HOME[0], HOME[1])
        zones = [circle(place, 30.0), circle(around(place, (9.0, 9.0))[0], 5.0, inclusion=False)]
        return_point = Item(dialect.MAV_CMD_NAV_FENCE_RETURN_POINT, *place, 5.0)
        assert (await upload(w.client, [*zones, return_point], dialect.MAV_MISSION_TYPE_FENCE)).type == 0
        assert await text(w.client, "Drone geofence set: 30 m", mark) == dialect.MAV_SEVERITY_NOTICE
        [(severity, fence), _] = heard(w.client, mark)
        assert len(fence) > 50
        assert fence == "Fence: 1 inclusion circle, 1 exclusion circle; return point unused"
        assert severity == dialect.MAV_SEVERITY_INFO
        chunks = [m for _, m in w.client.since(mark, "STATUSTEXT") if m.id]
        assert len(chunks) == 2
        assert all(len(m.text) == 50 for m in chunks[:-1])
        for event, begins, severity in (
            (ardrone3.WindStateChanged(ardrone3.WarningLevel.WARNING), "Wind: warning", 4),
            (ardrone3.WindStateChanged(ardrone3.WarningLevel.CRITICAL), "Wind: critical", 2),
            (ardrone3.VibrationLevelChanged(ardrone3.WarningLevel.CRITICAL), "Vibration: critical", 2),
            (battery.Alert(battery.BatteryAlert.TOO_HOT, battery.AlertLevel.WARNING, WHOLE), "Battery too hot: w", 4),
            (ardrone3.HoveringWarning(1, 0), "Too dark", 4),
            (
                ardrone3.ForcedLandingAutoTrigger(ardrone3.ForcedLandingReason.BATTERY_TOO_HOT, 30),
                "Drone lands in 30 s: battery too hot",
                1,
            ),
            (rth.HomeReachability(rth.RthHomeReachability.CRITICAL), "Home: critical", 2),
            (
                rth.RthAutoTrigger(rth.AutoTriggerReason.BATTERY_CRITICAL_SOON, 12),
                "Drone returns home in 12 s",
                4,
            ),
            (ardrone3.AlertStateChanged(ardrone3.AlertState.CUT_OUT), "Alert: cut out", 2),
        ):
            mark = w.client.mark()
            w.drone.inject(event)
            assert await text(w.client, begins, mark) == severity
        mark = w.client.mark()  # said once, not with every event
        w.drone.inject(ardrone3.WindStateChanged(ardrone3.WarningLevel.CRITICAL))
        w.drone.inject(ardrone3.IcingLevelChanged(ardrone3.WarningLevel.CRITICAL))
        await text(w.client, "Icing: critical", mark)
        assert [said for _, said in heard(w.client, mark)] == ["Icing: critical"]
        assert not any(m.text.endswith("\t") for _, m in w.client.since(0, "STATUSTEXT"))


@pytest.mark.parametrize(
    ("flavour", "first"),
    [("px4", f"anafi-mav {__version__}"), ("ardupilot", f"ArduCopter V4.5.7 (anafi-mav {__version__})")],
)
async def test_conf_149_banner_and_version(flavour: str, first: str) -> None:
    async with world(flavour=flavour) as w:
        drone = f"ANAFI 4K {w.drone.firmware.identity.serial} firmware 1.8.2"
        assert heard(w.client, 0) == []  # it has not said a word yet
        late = await w.connect(compid=191)
        await late.heartbeat(lambda beat: True, since=0)
        spoke, began = late.mark(), time.monotonic()
        late.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3))
        await text(late, drone, 0)
        assert time.monotonic() - began >= 1.0  # QGroundControl shows no text before it has made its vehicle
        assert len(late.since(spoke, "HEARTBEAT")) >= 1
        assert heard(late, 0) == [(dialect.MAV_SEVERITY_INFO, first), (dialect.MAV_SEVERITY_INFO, drone)]
        mark, others = late.mark(), w.client.mark()
        late.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3))
        vehicle = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_PX4, 0, 0, 0, 3)
        late.send(vehicle)
        await late.heartbeat(lambda beat: True)
        assert heard(late, mark) == []
        assert (await late.command(dialect.MAV_CMD_DO_SEND_BANNER)).result == ACCEPTED
        assert [said for _, said in heard(late, mark)] == [first, drone]
        assert heard(w.client, others) == []
        assert (
            await late.command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        ).result == ACCEPTED
        version = await late.wait("AUTOPILOT_VERSION", since=mark)
        numbers = [int(part) for part in __version__.split(".")[:3]]
        assert version.middleware_sw_version == numbers[0] << 24 | numbers[1] << 16 | numbers[2] << 8
        assert version.os_sw_version == 0x01080200  # the firmware
        custom = bytes(version.flight_custom_version)
        if flavour == "px4":  # QGroundControl shows bytes 2, 1, 0
            assert (custom[2], custom[1], custom[0]) == (1, 8, 2)
        else:
            assert custom.rstrip(b"\0") == b"1.8.2"
        assert version.flight_sw_version & 0xFF == dialect.FIRMWARE_VERSION_TYPE_DEV  # no nagging dialog
        assert bytes(version.uid2).rstrip(b"\0").decode() == w.drone.firmware.identity.serial


async def shell(w: World, words: bytes, until: str = "anafi> ") -> str:
    """What the shell says to these bytes."""
    mark = w.client.mark()
    said = ""

    def collect(message: Any) -> bool:
        nonlocal said
        assert (message.device, message.flags) == (dialect.SERIAL_CONTROL_DEV_SHELL, 1)
        said += bytes(message.data[: message.count]).decode()
        return said.endswith(until)

    for start in range(0, len(words), 70):
        piece = words[start : start + 70]
        w.client.send(
            newer.MAVLink_serial_control_message(10, 2, 1000, 0, len(piece), list(piece.ljust(70, b"\0")), 1, 1)
        )
    await w.client.wait("SERIAL_CONTROL", collect, since=mark)
    return said


@both
async def test_conf_153_shell(flavour: str) -> None:
    async with world(clients=2, flavour=flavour) as w:
        said = await shell(w, b"version\n")
        assert f"anafi-mav {__version__}" in said
        assert w.drone.firmware.identity.serial in said
        assert "status" in await shell(w, b"help\n")
        assert await shell(w, b"\n") == "anafi> "
        await_rest = await shell(w, b"sta" + b"tus\r\n", until="ready\nanafi> ")
        assert "mode hold, disarmed" in await_rest
        assert "battery 100 %" in await_rest
        w.drone.faults.magneto_required = True
        await w.client.wait("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & 4)
        assert "not ready: magneto" in await shell(w, b"status\n")
        assert "no such command: rm -rf" in await shell(w, b"rm -rf /\n")
        long = await shell(w, b"x" * 1000 + b"\n")
        assert long.startswith("no such command: xxx")
        assert len(long) < 150
        assert "geofence: available" in await shell(w, b"features\n")
        mark = w.client.mark()  # other devices do not exist, and an answer is no question
        for device, flags in ((0, 2), (10, 3)):
            data = list(b"help\n".ljust(70, b"\0"))
            w.client.send(newer.MAVLink_serial_control_message(device, flags, 0, 0, 5, data, 1, 1))
        await w.client.heartbeat(lambda beat: True)
        assert w.client.since(mark, "SERIAL_CONTROL") == []
        assert w.clients[1].since(0, "SERIAL_CONTROL") == []


def sounds(w: World) -> list[str]:
    return [entry.name.rsplit(".", 1)[1] for entry in w.drone.log if entry.name.startswith("ardrone3.Sound.")]


@both
async def test_conf_153_tune(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        w.client.send(newer.MAVLink_play_tune_v2_message(1, 1, newer.TUNE_FORMAT_QBASIC1_1, b"MFT200L8AAAA"))
        await w.drone.wait_log(lambda entry: entry.name == "ardrone3.Sound.StartAlertSound")
        await w.drone.wait_log(lambda entry: entry.name == "ardrone3.Sound.StopAlertSound", 5.0)
        w.client.send(dialect.MAVLink_play_tune_message(1, 1, b"AB", b""))
        await w.drone.wait_log(lambda entry: sounds(w).count("StartAlertSound") == 2)
        w.client.send(dialect.MAVLink_play_tune_message(1, 1, b"", b""))  # silence
        await w.drone.wait_log(lambda entry: sounds(w).count("StopAlertSound") == 2, 2.0)
        assert sounds(w) == ["StartAlertSound", "StopAlertSound"] * 2


async def test_conf_153_no_tune_in_the_air() -> None:
    async with world() as w:
        await w.take_off(3.0)
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_play_tune_message(1, 1, b"AB", b""))
        await text(w.client, "Tune refused", mark)
        assert sounds(w) == []


@both
async def test_conf_153_gripper_and_winch(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        for command in (211, 42600, 2520, 181, 183, 187):
            ack = await asyncio.wait_for(w.client.command(command, 1, 1), 1.0)
            assert ack.result == UNSUPPORTED
