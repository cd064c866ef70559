"""Items 125-127 of the conformance list: component metadata, the EVENT interface and pre-arm checks."""

from __future__ import annotations

import json
import lzma
import re
import struct
import zlib
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.ftp import Ftp
from support.mav import Client
from support.params import fetch, value_of, write
from support.plans import circle, upload
from support.world import HOME, world

from anafi_mav import geo
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, FlyingStateChanged
from anafi_mav.mavlink import dialect as newer  # the stock dialect has never heard of events
from anafi_mav.sim import SimulatedDrone

ACCEPTED, TEMPORARILY_REJECTED = 0, 1
RUN_PREARM_CHECKS, ARM = dialect.MAV_CMD_RUN_PREARM_CHECKS, dialect.MAV_CMD_COMPONENT_ARM_DISARM


def crc32(data: bytes) -> int:
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


async def requested(client: Client, id: int, kind: str) -> Any:
    mark = client.mark()
    assert (await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, id)).result == ACCEPTED
    return await client.wait(kind, since=mark, timeout=1.0)


async def load(client: Client, uri: str) -> bytes:
    assert uri.startswith("mftp:///")
    return await Ftp(client).download(uri.removeprefix("mftp://"))


@both
async def test_conf_125_metadata(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        where = await requested(w.client, 397, "COMPONENT_METADATA")
        old = await requested(w.client, 395, "COMPONENT_INFORMATION")
        assert (old.general_metadata_uri, old.general_metadata_file_crc) == (where.uri, where.file_crc)
        content = await load(w.client, where.uri)
        assert crc32(content) == where.file_crc
        general = json.loads(lzma.decompress(content))
        assert general["version"] == 1
        assert (general["vendorName"], general["modelName"]) == ("Parrot", "ANAFI 4K")
        assert re.fullmatch(r"\d+\.\d+\.\d+(\.\d+)?", general["firmwareVersion"])
        documents = {}
        for entry in general["metadataTypes"]:
            content = await load(w.client, entry["uri"])
            assert crc32(content) == entry["fileCrc"]
            documents[entry["type"]] = json.loads(lzma.decompress(content))
            plain = await load(w.client, entry["uri"].removesuffix(".xz"))
            assert plain == lzma.decompress(content)
        assert set(documents) == {1, 4}

        # Every parameter of the list is described, with its type, and nothing else is.
        values = await fetch(w.client)
        described = {one["name"]: one for one in documents[1]["parameters"]}
        assert documents[1]["version"] == 1  # what QGroundControl reads
        assert list(described) == list(values)
        types = {2: "Int8", 4: "Int16", 6: "Int32", 9: "Float"}
        for name, one in described.items():
            assert one["type"] == types[values[name].param_type]
            assert one["shortDesc"]
            assert one["category"] in ("Standard", "System")
            value = value_of(values[name], flavour)
            if "min" in one and value == value:
                assert one["min"] <= value <= one.get("max", value)
            if "values" in one:
                assert value in [choice["value"] for choice in one["values"]]
        tilt = described["ANF_MAX_TILT"]
        assert (tilt["min"], tilt["max"], tilt["units"]) == (1.0, 40.0, "deg")
        assert described["ANF_RTH_END"]["values"] == [
            {"value": 0, "description": "Landing"},
            {"value": 1, "description": "Hovering"},
        ]
        name, unit = ("MPC_TILTMAX_AIR", "deg") if flavour == "px4" else ("ANGLE_MAX", "centi-degrees")
        assert described[name]["longDesc"].endswith("The same as ANF_MAX_TILT.")
        assert described[name]["units"] == unit
        assert described["ANF_TKOFF_ALT"]["default"] == 2.5
        if flavour == "ardupilot":
            cruise, limits = described["WPNAV_SPEED"], described["ANF_CRUISE_SPEED"]
            assert (cruise["min"], cruise["max"]) == (100.0 * limits["min"], 100.0 * limits["max"])
        assert "default" not in tilt  # a drone does not tell its own

        basic = await requested(w.client, 396, "COMPONENT_INFORMATION_BASIC")
        assert (basic.vendor_name, basic.model_name) == ("Parrot", "ANAFI 4K")
        version = await requested(w.client, 148, "AUTOPILOT_VERSION")
        assert basic.capabilities == version.capabilities
        assert version.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_FTP


async def test_conf_125_crc_differs_by_model_only() -> None:
    """Another model, other files; the same one again, the same: a cache by CRC is right."""
    seen = []
    for model in ("4k", "ai", "4k"):
        async with world(model=model) as w:
            seen.append((await requested(w.client, 397, "COMPONENT_METADATA")).file_crc)
    assert seen[0] == seen[2] != seen[1]


class Events:
    """A reader of events who knows nothing but events.json."""

    def __init__(self, document: dict[str, Any]) -> None:
        assert document["version"] == 2
        (self.component,) = document["components"].values()
        (number,) = document["components"]
        self.by_id = {
            int(number) << 24 | int(sub): (group, event)
            for group, entry in self.component["event_groups"].items()
            for sub, event in entry["events"].items()
        }
        self.enums = self.component["enums"]

    def read(self, message: Any) -> tuple[str, list[int]]:
        """(name, arguments) of an EVENT."""
        _, event = self.by_id[message.id]
        codes = {"uint8_t": "B", "uint32_t": "I"}
        types = [one["type"] for one in event.get("arguments", [])]
        pattern = "<" + "".join(codes[self.enums[one]["type"] if one in self.enums else one] for one in types)
        return event["name"], list(struct.unpack_from(pattern, bytes(message.arguments)))

    def text(self, message: Any) -> str:
        """The message with its third argument, if it has one."""
        _, event = self.by_id[message.id]
        _, values = self.read(message)
        text: str = event["message"]
        if "{3}" in text:
            kind = event["arguments"][2]["type"]
            text = text.replace("{3}", self.enums[kind]["entries"][str(values[2])]["description"])
        return text


async def reader(client: Client) -> Events:
    return Events(json.loads(await Ftp(client).download("/events.json")))


@both
async def test_conf_126_the_sequence(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        current = await w.client.wait("CURRENT_EVENT_SEQUENCE", since=0, timeout=3.0)
        assert current.flags == newer.MAV_EVENT_CURRENT_SEQUENCE_FLAGS_RESET
        events = await reader(w.client)
        assert events.component["supported_protocols"] == ["health_and_arming_check"]
        mark = w.client.mark()
        assert (await w.client.command(RUN_PREARM_CHECKS)).result == ACCEPTED
        await w.client.wait("EVENT", lambda m: events.read(m)[0] == "health_summary", since=mark)
        heard = [m for _, m in w.client.since(mark, "EVENT")]
        assert [events.read(m)[0] for m in heard] == ["arming_check_summary", "health_summary"]
        assert {(m.destination_system, m.destination_component) for m in heard} == {(0, 0)}
        assert heard[1].sequence == heard[0].sequence + 1
        assert {m.log_levels & 0xF for m in heard} == {8}  # protocol: not to be shown
        current = await w.client.wait("CURRENT_EVENT_SEQUENCE", lambda m: m.flags == 0, timeout=5.0)
        assert current.sequence == heard[-1].sequence

        # Both of them again, and one that never was.
        mark = w.client.mark()
        w.client.send(newer.MAVLink_request_event_message(1, 1, heard[0].sequence, heard[1].sequence))
        await w.client.wait("EVENT", lambda m: m.sequence == heard[1].sequence, since=mark)
        again = [m for _, m in w.client.since(mark, "EVENT")]
        assert [m.get_msgbuf()[10:-2] for m in again] == [m.get_msgbuf()[10:-2] for m in heard]
        mark = w.client.mark()
        w.client.send(newer.MAVLink_request_event_message(1, 1, 60000, 60000))
        error = await w.client.wait("RESPONSE_EVENT_ERROR", since=mark)
        assert (error.target_system, error.target_component, error.sequence) == (255, 190, 60000)
        assert (error.reason, error.sequence_oldest_available) == (0, 1)


@both
async def test_conf_126_health_and_arming_checks(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        events = await reader(w.client)
        groups = events.component["navigation_mode_groups"]["groups"]
        beat = await w.client.wait("HEARTBEAT")
        (group,) = [int(index) for index, modes in groups.items() if beat.custom_mode in modes]

        async def report() -> tuple[dict[str, list[int]], list[str]]:
            mark = w.client.mark()
            await w.client.wait("EVENT", lambda m: events.read(m)[0] == "health_summary", since=mark)
            heard = [m for _, m in w.client.since(mark, "EVENT")]
            summaries = {events.read(m)[0]: events.read(m)[1] for m in heard if "summary" in events.read(m)[0]}
            return summaries, [events.text(m) for m in heard if "summary" not in events.read(m)[0]]

        w.drone.faults.magneto_required = True
        summaries, problems = await report()
        _, errors, _, can_arm, can_run = summaries["arming_check_summary"]
        assert problems == ["Magnetometer calibration required"]
        assert errors == 8  # health_component_t magnetometer
        assert can_arm == 0
        assert can_run & 1 << group
        assert summaries["health_summary"][2] == 8
        # What is said is what is done.
        ack = await w.client.command(ARM, 1)
        assert ack.result == TEMPORARILY_REJECTED

        w.drone.faults.magneto_required = False
        summaries, problems = await report()
        assert problems == []
        assert summaries["arming_check_summary"][3] & 1 << group
        w.drone.faults.gps = False
        summaries, problems = await report()
        assert problems == ["No GPS fix"]
        _, errors, warnings, can_arm, _ = summaries["arming_check_summary"]
        assert (errors, warnings) == (0, 2)
        returning = [int(i) for i, modes in groups.items() if (0x05040000 if flavour == "px4" else 6) in modes]
        assert can_arm & 1 << group
        assert not can_arm & 1 << returning[0]


async def test_conf_126_the_fence_is_a_check() -> None:
    async with world() as w:
        events = await reader(w.client)
        mark = w.client.mark()
        elsewhere = geo.destination(HOME[0], HOME[1], 800.0, 800.0)
        assert (await upload(w.client, [circle(elsewhere, 100.0)], dialect.MAV_MISSION_TYPE_FENCE)).type == 0
        wrong = await w.client.wait("EVENT", lambda m: events.read(m)[0] == "check_fence", since=mark)
        assert events.text(wrong) == "Fence does not allow takeoff here"
        await w.client.wait("EVENT", lambda m: events.read(m)[0] == "health_summary", since=mark)
        assert (await w.client.command(ARM, 1)).result == TEMPORARILY_REJECTED


async def test_conf_126_flight_events_are_sent_in_sequence() -> None:
    async with world() as w:
        events = await reader(w.client)
        mark = w.client.mark()
        await w.take_off(3.0)
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
        await w.client.wait("EVENT", lambda m: events.read(m)[0] == "disarmed", since=mark, timeout=20.0)
        names = [events.read(m)[0] for _, m in w.client.since(mark, "EVENT")]
        assert [name for name in names if "summary" not in name] == [
            "armed",
            "takeoff_detected",
            "landing_detected",
            "disarmed",
        ]


@pytest.mark.parametrize("before", [FlyingState.EMERGENCY, None], ids=["motors cut", "not reported"])
async def test_conf_126_landed_state_without_a_flight_is_no_landing(before: FlyingState | None) -> None:
    """The state may be reported late, or again after an emergency stop on the ground."""

    def reports(drone: SimulatedDrone) -> None:
        drone.faults.unreported = frozenset({FlyingStateChanged.NAME} if before is None else ())

    async with world(before=reports) as w:
        events = await reader(w.client)
        mark = w.client.mark()
        if before is not None:
            w.drone.inject(FlyingStateChanged(before))
            await w.client.wait("EVENT", lambda m: events.read(m)[0] == "check_emergency", since=mark)
            mark = w.client.mark()
        w.drone.faults.unreported = frozenset()
        w.drone.inject(FlyingStateChanged(FlyingState.LANDED))
        on_ground = dialect.MAV_LANDED_STATE_ON_GROUND
        await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == on_ground, since=mark)
        await w.client.wait("EVENT", lambda m: events.read(m)[0] == "health_summary", since=mark)
        assert "landing_detected" not in [events.read(m)[0] for _, m in w.client.since(mark, "EVENT")]


@both
async def test_conf_127_run_prearm_checks(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        assert (await w.client.command(RUN_PREARM_CHECKS)).result == ACCEPTED
        await w.client.wait("EVENT", since=mark)
        assert not [m for _, m in w.client.since(mark, "STATUSTEXT") if m.text.startswith("PreArm")]
        w.drone.faults.magneto_required = True
        await w.client.wait("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & 0x10000000)
        mark = w.client.mark()
        assert (await w.client.command(RUN_PREARM_CHECKS)).result == ACCEPTED
        text = await w.client.wait("STATUSTEXT", since=mark)
        assert text.text.startswith("PreArm: ")
        w.drone.faults.magneto_required = False
        await w.client.wait("SYS_STATUS", lambda m: m.onboard_control_sensors_health & 0x10000000)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(RUN_PREARM_CHECKS)).result == TEMPORARILY_REJECTED


async def test_conf_127_station_that_connects_in_flight_gets_the_health_report() -> None:
    """The answer is that of common.xml; the report is sent all the same, as by PX4."""
    async with world() as w:
        events = await reader(w.client)
        await w.take_off(3.0)
        late = await w.connect(sysid=200)
        assert (await late.command(RUN_PREARM_CHECKS)).result == TEMPORARILY_REJECTED
        await late.wait("EVENT", lambda m: events.read(m)[0] == "health_summary", since=0)
        assert not [m for _, m in late.since(0, "STATUSTEXT") if m.text.startswith("PreArm")]


async def test_a_write_does_not_make_the_metadata_stale() -> None:
    """Ranges are reported once for a connection: a client's cache stays good while values change."""
    async with world() as w:
        before = (await requested(w.client, 397, "COMPONENT_METADATA")).file_crc
        await write(w.client, "ANF_MAX_ALT", 60.0)
        assert (await requested(w.client, 397, "COMPONENT_METADATA")).file_crc == before
