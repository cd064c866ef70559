"""The messages of our own dialect over a real socket: what the simulated drone reported is what they say."""

from __future__ import annotations

import logging
import math
from typing import Any

import msgspec
import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support.mav import Client
from support.params import value_of, write
from support.setpoints import attitude, engage, streaming
from support.video_server import METADATA, VideoServer
from support.world import World, loopback, world

from anafi_mav.arsdk.messages import alarms, ardrone3, camera, common, rth, wifi
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.video.video_metadata import PROTO_PROFILE, Quaternion, StarfishLink, WifiLink
from anafi_mav.mavlink import dialect
from anafi_mav.sim import SimulatedDrone
from anafi_mav.sim.skycontroller import (
    PITCH,
    RESET_ZOOM,
    ROLL,
    TAKEOFF_LAND,
    THROTTLE,
    TILT,
    YAW,
    ZOOM,
    Skycontroller,
)

ACCEPTED, REJECTED = stock.MAV_RESULT_ACCEPTED, stock.MAV_RESULT_TEMPORARILY_REJECTED
FIRST, LAST = 1 << ListFlags.FIRST, 1 << ListFlags.LAST


async def ask(client: Client, id: int) -> Any:
    mark = client.mark()
    assert (await client.command(stock.MAV_CMD_REQUEST_MESSAGE, id)).result == ACCEPTED
    return await client.wait(dialect.mavlink_map[id].msgname, since=mark)


async def stream(client: Client, id: int, interval: float = 0.1) -> None:
    assert (await client.command(stock.MAV_CMD_SET_MESSAGE_INTERVAL, id, interval * 1e6)).result == ACCEPTED


async def test_anafi_messages_go_to_the_requester_only() -> None:
    async with world(clients=2) as w:
        asking, other = w.clients
        await stream(asking, dialect.MAVLINK_MSG_ID_ANAFI_HOME)
        await asking.wait("ANAFI_HOME")
        await asking.wait("ANAFI_HOME")
        assert not any(m.get_type().startswith("ANAFI_") for _, m in other.received)
        assert {m.get_type() for _, m in asking.received if m.get_type().startswith("ANAFI_")} == {"ANAFI_HOME"}


async def test_flight_status() -> None:
    async with world(speed=1.0) as w:
        observed = await ask(w.client, dialect.MAVLINK_MSG_ID_ANAFI_FLIGHT_STATUS)
        assert observed.flying_state == dialect.ANAFI_FLYING_STATE_LANDED
        assert (observed.steady, observed.plan, observed.alert) == (
            1,
            dialect.ANAFI_PLAN_STATE_STOPPED,
            dialect.ANAFI_ALERT_NONE,
        )
        assert (observed.wind, observed.vibration, observed.icing) == (
            0,
            0,
            255,
        )  # the simulated one says nothing of ice
        assert (observed.hover_warnings, observed.forced_landing_in) == (0, 255)
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_FLIGHT_STATUS)
        for event in (
            ardrone3.WindStateChanged(ardrone3.WarningLevel.WARNING),
            ardrone3.IcingLevelChanged(ardrone3.WarningLevel.CRITICAL),
            ardrone3.HoveringWarning(0, 1),
            ardrone3.MotorErrorStateChanged(0b0100, ardrone3.MotorError.ERROR_MOTOR_STALLED),
            ardrone3.AlertStateChanged(ardrone3.AlertState.TOO_MUCH_ANGLE),
            ardrone3.ForcedLandingAutoTrigger(ardrone3.ForcedLandingReason.DEFECTIVE_SENSOR, 0),
        ):
            w.drone.inject(event)
        observed = await w.client.wait("ANAFI_FLIGHT_STATUS", lambda m: m.forced_landing != 0)
        assert (observed.wind, observed.icing) == (1, 2)
        assert observed.hover_warnings == dialect.ANAFI_HOVER_WARNING_TOO_HIGH
        assert (observed.motor_error, observed.motors) == (2, 4)
        assert observed.alert == dialect.ANAFI_ALERT_TOO_MUCH_ANGLE
        assert (observed.forced_landing, observed.forced_landing_in) == (dialect.ANAFI_FORCED_LANDING_SENSOR, 0)
        # Repeated, it is true at the time of sending.
        again = await w.client.wait("ANAFI_FLIGHT_STATUS")
        last = await w.client.wait("ANAFI_FLIGHT_STATUS")
        assert again.time_boot_ms < last.time_boot_ms


async def test_home() -> None:
    async with world() as w:
        observed = await ask(w.client, dialect.MAVLINK_MSG_ID_ANAFI_HOME)
        assert (observed.min_altitude, observed.hovering_altitude) == (20.0, 10.0)
        assert observed.preferred_type == w.drone.firmware.settings["home_type"]
        assert observed.state == dialect.ANAFI_RETURN_STATE_AVAILABLE
        assert observed.trigger_in == 65535
        await w.take_off(8.0)
        observed = await ask(w.client, dialect.MAVLINK_MSG_ID_ANAFI_HOME)
        home = w.drone.log.find("event", "ardrone3.GPSSettingsState.HomeChanged")[-1].args
        assert (observed.latitude, observed.longitude) == (
            round(home["latitude"] * 1e7),
            round(home["longitude"] * 1e7),
        )
        assert observed.type in (dialect.ANAFI_HOME_TYPE_TAKEOFF, dialect.ANAFI_HOME_TYPE_PILOT)
        w.drone.inject(rth.RthAutoTrigger(rth.AutoTriggerReason.BATTERY_CRITICAL_SOON, 17))
        w.drone.inject(rth.HomeReachability(rth.RthHomeReachability.CRITICAL))
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_HOME)
        observed = await w.client.wait("ANAFI_HOME", lambda m: m.reachability == dialect.ANAFI_REACHABILITY_CRITICAL)
        assert (observed.trigger, observed.trigger_in) == (dialect.ANAFI_RETURN_TRIGGER_BATTERY, 17)
        assert (await w.client.command(stock.MAV_CMD_NAV_RETURN_TO_LAUNCH)).result == ACCEPTED
        observed = await w.client.wait("ANAFI_HOME", lambda m: m.state == dialect.ANAFI_RETURN_STATE_IN_PROGRESS)
        assert observed.reason == dialect.ANAFI_RETURN_REASON_USER_REQUEST


async def test_checklist() -> None:
    async with world() as w:
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CHECKLIST)
        w.drone.faults.magneto_required = True
        observed = await w.client.wait("ANAFI_CHECKLIST", lambda m: m.checks_failed)
        assert observed.checks_failed == dialect.ANAFI_CHECK_MAGNETO_CALIBRATION
        assert observed.checks_told & observed.checks_failed
        on, off = alarms.State.ON, alarms.State.OFF
        w.drone.inject(alarms.Alarms(alarms.Type.HORIZONTAL_GEOFENCE_REACHED, on, FIRST))
        w.drone.inject(alarms.Alarms(alarms.Type.MAGNETO_PERTURBATION, off, LAST))
        observed = await w.client.wait("ANAFI_CHECKLIST", lambda m: m.alarms_raised)
        assert observed.alarms_raised == dialect.ANAFI_ALARM_HORIZONTAL_GEOFENCE
        assert (
            observed.alarms_told == dialect.ANAFI_ALARM_HORIZONTAL_GEOFENCE | dialect.ANAFI_ALARM_MAGNETO_PERTURBATION
        )


async def test_link() -> None:
    async with world() as w:
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_LINK)
        w.drone.inject(common.LinkSignalQuality(0x83))  # quality 3, perturbed
        w.drone.inject(wifi.RssiChanged(-67))
        observed = await w.client.wait("ANAFI_LINK", lambda m: m.rssi == -67)
        assert observed.quality == 3
        assert observed.flags == dialect.ANAFI_LINK_FLAGS_REPORTED | dialect.ANAFI_LINK_FLAGS_PERTURBED
        assert observed.goodput == 0xFFFFFFFF  # the live video alone reports it


@pytest.mark.parametrize(
    ("reported", "goodput", "rssi", "quality"),
    [
        ({"wifi": WifiLink(goodput=0xFFFFFFFF, quality=9, rssi=-40_000)}, 0xFFFFFFFE, -0x8000, 5),
        ({"wifi": None, "starfish": StarfishLink(links=(), quality=-1)}, 0xFFFFFFFF, 0x7FFF, 0xFF),
    ],
    ids=["wifi", "starfish"],
)
async def test_link_of_pictures_fits_its_fields(
    reported: dict[str, Any], goodput: int, rssi: int, quality: int, caplog: pytest.LogCaptureFixture
) -> None:
    def reports_no_link(drone: SimulatedDrone) -> None:
        drone.faults.unreported = frozenset({common.LinkSignalQuality.NAME, wifi.RssiChanged.NAME})

    metadata = msgspec.structs.replace(METADATA, **reported)
    server = VideoServer(PROTO_PROFILE, metadata, address=loopback())
    async with (
        server,
        world(drone_address=server.address, rtsp_port=server.port, before=reports_no_link, speed=1.0) as w,
    ):
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_EXPOSURE)
        frame = dialect.ANAFI_EXPOSURE_SOURCE_FRAME
        await w.client.wait("ANAFI_CAMERA_EXPOSURE", lambda m: m.source == frame, timeout=12.0)
        observed = await ask(w.client, dialect.MAVLINK_MSG_ID_ANAFI_LINK)
        assert (observed.goodput, observed.rssi, observed.quality) == (goodput, rssi, quality)
    assert [record for record in caplog.records if record.levelno >= logging.ERROR] == []


@pytest.mark.parametrize("length", [0.5, 3.0, 1e29])
async def test_rotations_of_pictures_have_the_length_one(length: float, caplog: pytest.LogCaptureFixture) -> None:
    metadata = msgspec.structs.replace(
        METADATA, quat=Quaternion(length, 0.0, -length, 0.0), drone_quat=Quaternion(length, 0.0, 0.0, length)
    )
    server = VideoServer(PROTO_PROFILE, metadata, address=loopback())
    half = math.sqrt(0.5)
    async with server, world(drone_address=server.address, rtsp_port=server.port, speed=1.0) as w:
        await stream(w.client, dialect.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS, 1 / 30)
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_PICTURE, 1 / 30)
        picture = await w.client.wait("ANAFI_PICTURE", timeout=12.0)
        assert picture.q == pytest.approx([half, 0.0, -half, 0.0])
        assert picture.drone_q == pytest.approx([half, 0.0, 0.0, half])
        mark = w.client.mark()
        await w.client.wait("GIMBAL_DEVICE_ATTITUDE_STATUS", lambda m: abs(m.q[2] + 0.5) < 1e-6, since=mark)
    assert [record for record in caplog.records if record.levelno >= logging.ERROR] == []


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_camera_exposure_and_intrinsics(model: str) -> None:
    async with world(model=model) as w:
        observed = await ask(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_EXPOSURE)
        assert (observed.camera, observed.source) == (0, dialect.ANAFI_EXPOSURE_SOURCE_STEPS)
        assert observed.ev == 0.0
        assert observed.zoom == pytest.approx(1.0)
        assert math.isnan(observed.awb_r_gain)
        if model == "4k":
            await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_EXPOSURE)
            w.drone.inject(camera.ZoomLevel(0, 2.5))
            observed = await w.client.wait("ANAFI_CAMERA_EXPOSURE", lambda m: m.zoom == 2.5)
        lens = await ask(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_INTRINSICS)
        width, fx = {"4k": (1280, 953.87), "ai": (1920, 1505.94)}[model]
        assert (lens.width, lens.fx) == (width, pytest.approx(fx))
        # Half the width over the focal length is the tangent of half the field of view: 69 and 68 degrees by Parrot.
        assert 2 * math.degrees(math.atan(lens.width / 2 / lens.fx)) == pytest.approx(
            67 if model == "4k" else 65, abs=2
        )


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_video_runs_while_a_stream_needs_its_metadata(model: str) -> None:
    async with world(model=model, speed=1.0) as w:
        if w.drone.rtsp_port is None:
            pytest.skip(w.drone.rtsp_problem)
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_LINK)
        observed = await w.client.wait("ANAFI_LINK")
        assert observed.goodput == 0xFFFFFFFF
        video = w.gateway.systems[0].drone.video
        assert not video.state.playing
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_EXPOSURE)
        frame = dialect.ANAFI_EXPOSURE_SOURCE_FRAME
        observed = await w.client.wait("ANAFI_CAMERA_EXPOSURE", lambda m: m.source == frame, timeout=12.0)
        # The simulated camera's numbers: ms on the wire, rad on the wire.
        assert 0.0 < observed.exposure_time < 0.1
        assert 25 <= observed.iso <= 6400
        assert 0.5 < observed.awb_r_gain < 4.0
        assert 0.5 < observed.awb_b_gain < 4.0
        assert observed.hfov == pytest.approx({"4k": 69.0, "ai": 68.0}[model], abs=0.5)
        assert 30.0 < observed.vfov < observed.hfov
        lens = await ask(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_INTRINSICS)
        assert (lens.source, lens.camera) == (dialect.ANAFI_INTRINSICS_SOURCE_STREAM, 0)
        assert (lens.width, lens.cx) == {"4k": (1280, pytest.approx(642.81)), "ai": (1920, pytest.approx(997.28))}[
            model
        ]
        assert 2 * math.degrees(math.atan(lens.width / 2 / lens.fx)) == pytest.approx(observed.hfov, abs=0.1)
        if model == "4k":
            radio = await w.client.wait("ANAFI_LINK", lambda m: m.goodput != 0xFFFFFFFF)
            assert radio.goodput == video.state.frame.metadata.wifi.goodput * 1000
        exposure = dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_EXPOSURE
        assert (await w.client.command(stock.MAV_CMD_SET_MESSAGE_INTERVAL, exposure, -1)).result == ACCEPTED
        while video.state.playing:
            await w.client.wait("ANAFI_LINK")
        observed = await ask(w.client, exposure)
        assert (observed.source, math.isnan(observed.awb_r_gain)) == (dialect.ANAFI_EXPOSURE_SOURCE_STEPS, True)


async def test_no_skycontroller() -> None:
    async with world() as w:
        for id in (61410, 61411, 61412):
            assert (await w.client.command(stock.MAV_CMD_REQUEST_MESSAGE, id)).result == REJECTED


def at_hand(w: World) -> Skycontroller:
    controller = w.drone.skycontroller
    assert controller is not None
    return controller


async def test_skycontroller() -> None:
    async with world(skycontroller=3, speed=1.0) as w:
        status = await ask(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CONTROLLER_STATUS)
        assert status.model == 0x0918
        assert status.source == dialect.ANAFI_PILOTING_SOURCE_SKYCONTROLLER
        assert status.battery in (0, 1, 2)
        assert 0 < status.battery_remaining <= 100
        assert status.serial_number
        observed = await ask(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CONTROLLER_INPUT)
        assert observed.grabbed_axes == 0
        assert observed.axes == [-128] * 6


@pytest.mark.parametrize(
    ("angles", "q"),
    [
        # rad of roll, pitch, yaw; cos and sin of half of them. All three: the product of their quaternions, by hand.
        ((0.6, 0.0, 0.0), (0.955336, 0.295520, 0.0, 0.0)),
        ((0.0, -0.4, 0.0), (0.980067, 0.0, -0.198669, 0.0)),
        ((0.0, 0.0, 1.2), (0.825336, 0.0, 0.0, 0.564642)),
        ((math.pi / 2, 0.0, math.pi / 2), (0.5, 0.5, 0.5, 0.5)),
    ],
)
async def test_where_the_skycontroller_points(angles: tuple[float, float, float], q: tuple[float, ...]) -> None:
    async with world(skycontroller=3) as w:
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CONTROLLER_ATTITUDE, 0.05)
        at_hand(w).attitude = angles
        await w.client.wait("ANAFI_CONTROLLER_ATTITUDE", lambda m: m.q == pytest.approx(q, abs=1e-5))


async def test_skycontroller_sticks_are_reported_while_a_program_flies() -> None:
    """Each is moved as little as a hand that rests on it does: the program goes on."""
    observed = {YAW: 4, THROTTLE: -7, ROLL: -5, PITCH: 10}
    places = {YAW: 0, THROTTLE: 1, ROLL: 2, PITCH: 3}  # ANAFI_AXIS, by its bits
    async with world(skycontroller=3, speed=1.0) as w:
        await w.take_off()
        await stream(w.client, dialect.MAVLINK_MSG_ID_ANAFI_CONTROLLER_INPUT, 0.05)
        async with streaming(w.client, attitude(pitch=-0.1)):
            await engage(w.client, "px4")
            for axis, percent in observed.items():
                at_hand(w).stick(axis, percent)
                inputs = await w.client.wait(
                    "ANAFI_CONTROLLER_INPUT", lambda m, p=percent, a=axis: m.axes[places[a]] == p
                )
            assert inputs.axes == [4, -7, -5, 10, -128, -128]  # the wheels are the pilot's
            channels = await ask(w.client, dialect.MAVLINK_MSG_ID_RC_CHANNELS)
            # Roll, pitch, throttle, yaw: 5 us a percent, forward below the middle.
            assert [getattr(channels, f"chan{n}_raw") for n in range(1, 9)] == [1475, 1450, 1465, 1520, *[65535] * 4]
            assert channels.chancount == 8
            axes = dialect.ANAFI_AXIS_YAW | dialect.ANAFI_AXIS_THROTTLE | dialect.ANAFI_AXIS_ROLL
            assert inputs.grabbed_axes == axes | dialect.ANAFI_AXIS_PITCH
            assert inputs.source == dialect.ANAFI_PILOTING_SOURCE_GATEWAY
            began = w.drone.log[-1].t
            await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["pitch"] > 0, since=began)
        # The program is gone: so are the sticks, which are the pilot's again.
        inputs = await w.client.wait("ANAFI_CONTROLLER_INPUT", lambda m: m.grabbed_axes == 0)
        assert inputs.axes == [-128] * 6
        assert inputs.source == dialect.ANAFI_PILOTING_SOURCE_SKYCONTROLLER


@pytest.mark.parametrize(("flavour", "generation"), [("px4", 3), ("ardupilot", 4)])
async def test_wheels_and_buttons_are_the_clients_on_request(flavour: str, generation: int) -> None:
    async with world(skycontroller=generation, speed=1.0, flavour=flavour) as w:
        pilot = at_hand(w)

        async def grabbed(buttons: int, axes: int, since: float) -> None:
            masks = {"buttons": buttons, "axes": axes}
            await w.drone.wait_log(lambda e: e.name == "grab" and e.args == masks, since=since)

        assert (await ask(w.client, dialect.MAVLINK_MSG_ID_RC_CHANNELS)).chancount == 0
        for name in ("ANF_SC_WHEELS", "ANF_SC_BUTTONS"):
            assert value_of(await write(w.client, name, 1, stock.MAV_PARAM_TYPE_INT32, flavour), flavour) == 1
        await grabbed(0b1100, 0b110000, 0.0)
        for id in (dialect.MAVLINK_MSG_ID_RC_CHANNELS, dialect.MAVLINK_MSG_ID_ANAFI_CONTROLLER_INPUT):
            await stream(w.client, id, 0.01)
        began = w.drone.log[-1].t
        pilot.stick(TILT, -40)
        pilot.stick(ZOOM, 100)
        pilot.press(RESET_ZOOM)
        channels = await w.client.wait("RC_CHANNELS", lambda m: m.chan8_raw == 2000)
        read = [getattr(channels, f"chan{n}_raw") for n in range(1, 10)]
        assert read == [*[65535] * 4, 1300, 2000, 1000, 2000, 65535]
        inputs = await w.client.wait("ANAFI_CONTROLLER_INPUT", lambda m: m.buttons)
        assert (inputs.axes, inputs.buttons) == ([-128] * 4 + [-40, 100], 0b1000)
        pilot.release(RESET_ZOOM)
        await w.client.wait("RC_CHANNELS", lambda m: m.chan8_raw == 1000)
        pilot.press(TAKEOFF_LAND)  # the pilot's, always
        await w.drone.wait_log(lambda e: e.name.endswith("TakeOff"), since=began)
        acted = [e.name for e in w.drone.log if e.t > began and e.name.startswith(("gimbal.", "camera."))]
        assert acted == []
        # A Skycontroller releases everything when a connection ends.
        began = w.drone.log[-1].t
        assert w.drone.session is not None
        await w.drone.session.close()
        await grabbed(0, 0, began)
        await grabbed(0b1100, 0b110000, began)
        mark = w.client.mark()
        await w.client.wait("RC_CHANNELS", lambda m: m.chan5_raw == 1300, since=mark)
        assert value_of(await write(w.client, "ANF_SC_WHEELS", 0, stock.MAV_PARAM_TYPE_INT32, flavour), flavour) == 0
        await grabbed(0b1100, 0, began)
        pilot.stick(TILT, 20)
        await w.drone.wait_log(lambda e: e.name == "gimbal.set_target", since=began)


async def test_the_dialect_works_in_pymavlink_as_the_page_says() -> None:
    """docs/dialect.md: mavutil with our module in place of its own."""
    from pymavlink import mavutil

    before = mavutil.mavlink
    try:
        mavutil.mavlink = dialect
        link = mavutil.mavlink_connection("udpin:127.0.0.1:0", dialect=None)
        sender = dialect.MAVLink(None, 1, 1)
        [message] = link.mav.parse_buffer(dialect.MAVLink_anafi_link_message(5, 6, -40, 4, 1).pack(sender))
        assert (message.get_type(), message.rssi) == ("ANAFI_LINK", -40)
        link.close()
    finally:
        mavutil.mavlink = before
