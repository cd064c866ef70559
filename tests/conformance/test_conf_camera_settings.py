"""Camera definition and extended parameters: every option of every setting, judged by the simulator's own state."""

from __future__ import annotations

import asyncio
import itertools
import lzma
from collections.abc import Iterable, Iterator

import aiohttp
import pytest
from msgspec import structs
from support.camera_states import MODEL_KEYS
from support.cameras import PHOTO, enter
from support.definition_readers import Described, ReadDefinition, read_definition
from support.ext_params import CHOICE, fetch, read, send_set, value_of, write
from support.flavours import both
from support.ftp import Ftp
from support.mav import CAMERA, Client
from support.missions import ACTIVE, put, said, start, state, takeoff, way
from support.plans import Item
from support.sim_settings import sim_value
from support.world import World, world

from anafi_mav.arsdk.messages.camera import CameraEvCompensation, EvCompensation, ExposureSettings, ZoomLevel
from anafi_mav.mavlink import dialect
from anafi_mav.sim.world.faults import Impairment

ACCEPTED, UNSUPPORTED, FAILED, IN_PROGRESS = (
    dialect.PARAM_ACK_ACCEPTED,
    dialect.PARAM_ACK_VALUE_UNSUPPORTED,
    dialect.PARAM_ACK_FAILED,
    dialect.PARAM_ACK_IN_PROGRESS,
)
KINDS = {"uint32": 5, "int32": 6, "float": 9}
"""MAV_PARAM_EXT_TYPE by the name in a definition."""

DEPENDENT = {"CAM_THM_LOW": (-100.0, 10.5), "CAM_THM_HIGH": (1000.0, 150.0)}
"""Ranges of which the drone takes a part only: the lower bound of a palette is never above the upper one."""


async def load(client: Client) -> ReadDefinition:
    """The definition as a station loads it."""
    ftp = Ftp(client, component=CAMERA)
    plain = await ftp.download("/camera_definition.xml")
    assert lzma.decompress(await ftp.download("camera_definition.xml.xz")) == plain
    return read_definition(plain)


class Station:
    """A station with a definition, that follows the values."""

    def __init__(self, w: World, definition: ReadDefinition) -> None:
        self.w = w
        self.definition = definition
        self.values: dict[str, float] = {}

    async def refresh(self) -> None:
        """Read all values, until they agree with each other: events of a switch come one after the other."""
        while True:
            self.values = {name: value_of(message) for name, message in (await fetch(self.w.client)).items()}
            assert set(self.values) == set(self.definition.parameters)
            hidden = self.definition.hidden(self.values)
            shown = [one for name, one in self.definition.parameters.items() if name not in hidden and one.options]
            if all(self.values[one.name] in self.definition.options(one.name, self.values) for one in shown):
                return

    async def set(self, name: str, value: float) -> None:
        """Set a value and compare what the drone has then."""
        before = dict(self.values)
        mark = self.w.client.mark()
        one = self.definition.parameters[name]
        ack = await write(self.w.client, name, value, KINDS[one.kind])
        assert (ack.param_result, value_of(ack)) == (ACCEPTED, value), name
        assert sim_value(self.w.drone, name) == pytest.approx(value, abs=2e-6), name
        for _, message in self.w.client.since(mark, "PARAM_EXT_VALUE"):
            self.values[message.param_id] = value_of(message)
        self.values[name] = value
        if self._controls(one) or self.values != before | {name: value}:
            await self.refresh()
            assert self.values[name] == value

    @staticmethod
    def _controls(one: Described) -> bool:
        return any(option.exclusions or option.ranges for option in one.options)

    def controllers(self, name: str) -> list[str]:
        """Settings that decide about this one, those that are decided about by none first."""
        found = {name}
        while True:
            more = {
                other.name
                for other in self.definition.parameters.values()
                for option in other.options
                if found & {*option.exclusions, *(limited.target for limited in option.ranges)}
            }
            if more <= found:
                break
            found |= more
        order = {one: place for place, one in enumerate(self.definition.parameters)}
        return sorted(found - {name}, key=lambda one: (one != "CAM_THERMAL", order[one]))

    def ways(self, name: str, value: float) -> Iterator[dict[str, float]]:
        """Values of the controllers with which this one can have the value; those with the fewest changes first."""
        names = self.controllers(name)
        choices = [[option.value for option in self.definition.parameters[one].options] for one in names]
        found = []
        for values in itertools.product(*choices):
            way = dict(zip(names, values, strict=True))
            state = self.values | way
            hidden = self.definition.hidden(state)
            fits = all(way[one] in self.definition.options(one, state) for one in names if one not in hidden)
            if fits and name not in hidden and value in self.options(name, state):
                found.append(way)
        yield from sorted(found, key=lambda way: sum(self.values[one] != way[one] for one in names))

    def options(self, name: str, values: dict[str, float]) -> Iterable[float]:
        """The options now, or for a range its ends and its middle."""
        one = self.definition.parameters[name]
        if one.options:
            return self.definition.options(name, values)
        if name in DEPENDENT:
            return DEPENDENT[name]
        assert one.low is not None
        assert one.high is not None
        middle = (one.low + one.high) / 2.0
        return (one.low, one.high, one.low if one.step is None else round(middle))

    async def reach(self, name: str, value: float) -> None:
        """Set the controllers so that the value can be chosen, then the value."""
        way = next(self.ways(name, value), None)
        assert way is not None, f"{name} cannot be {value}"
        for one, wanted in way.items():
            if self.values[one] != wanted:
                await self.set(one, wanted)
        await self.set(name, value)


async def station(w: World) -> Station:
    found = Station(w, await load(w.client))
    await found.refresh()
    return found


@pytest.mark.parametrize("model", MODEL_KEYS)
async def test_conf_094_every_option_reaches_the_drone(model: str) -> None:
    async with world(model=model, speed=1.0) as w:
        ours = await station(w)
        for name in ours.definition.parameters.keys() - ours.definition.hidden(ours.values):
            assert ours.values[name] == pytest.approx(sim_value(w.drone, name), abs=2e-6), name
        for name, one in ours.definition.parameters.items():
            every = [option.value for option in one.options] or [*ours.options(name, ours.values)]
            for value in every:
                await ours.reach(name, value)


async def test_conf_095_list_and_reads_agree() -> None:
    async with world() as w:
        listed = await fetch(w.client)
        for name in ("CAM_MODE", "CAM_EV", "CAM_ZOOMSPEED"):
            by_name = await read(w.client, name)
            by_index = await read(w.client, index=by_name.param_index)
            assert by_index.param_id == name
            assert value_of(by_name) == value_of(by_index) == value_of(listed[name])
            assert by_name.get_srcComponent() == CAMERA
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_param_ext_request_read_message(1, CAMERA, b"NO_SUCH_THING", -1))
        w.client.send(dialect.MAVLink_param_ext_request_read_message(1, CAMERA, b"", 999))
        await read(w.client, "CAM_EV")
        assert [m.param_id for _, m in w.client.since(mark, "PARAM_EXT_VALUE")] == ["CAM_EV"]


@pytest.mark.parametrize(
    ("name", "value", "kind", "result"),
    [
        ("CAM_EV", 0.5, 9, UNSUPPORTED),
        ("CAM_EV", float("nan"), 9, UNSUPPORTED),
        ("CAM_ZOOMSPEED", 11.0, 9, UNSUPPORTED),
        ("CAM_SATURATION", 1.5, 9, UNSUPPORTED),
        ("CAM_WBMODE", 200.0, CHOICE, UNSUPPORTED),
        ("CAM_WBMODE", 2.0, 5, UNSUPPORTED),
        ("CAM_VIDFPS", 120.0, 9, UNSUPPORTED),
        ("NO_SUCH_THING", 1.0, CHOICE, FAILED),
    ],
)
async def test_conf_095_value_that_is_not_accepted_is_refused(name: str, value: float, kind: int, result: int) -> None:
    async with world() as w:
        before = await fetch(w.client)
        ack = await write(w.client, name, value, kind)
        assert ack.param_result == result
        if name in before:
            assert value_of(ack) == value_of(before[name])
            assert value_of(await read(w.client, name)) == value_of(before[name])


async def test_conf_095_temperature_of_many_decimals_is_accepted_as_the_drone_takes_it() -> None:
    async with world(model="thermal") as w:
        ack = await write(w.client, "CAM_THM_HIGH", 33.33333, dialect.MAV_PARAM_EXT_TYPE_REAL32)
        assert ack.param_result == dialect.PARAM_ACK_ACCEPTED
        assert value_of(ack) == pytest.approx(33.333)
        assert sim_value(w.drone, "CAM_THM_HIGH") == pytest.approx(33.333)


async def test_conf_095_repeated_write_is_not_carried_out_again() -> None:
    async with world() as w:
        for _ in range(3):
            ack = await write(w.client, "CAM_EV", 1.0, 9)
            assert (ack.param_result, value_of(ack)) == (ACCEPTED, 1.0)
        assert len(w.commands("camera.set_ev_compensation")) == 1


async def test_conf_095_unreported_value_is_not_accepted_unwritten() -> None:
    """The interval of a series is shown as its default in other photo modes; the drone has another one.

    An ANAFI Ai reports it in all of them.
    """
    async with world() as w:
        await enter(w.client, PHOTO)
        for name, value, kind in (
            ("CAM_PHOTOMODE", 3.0, CHOICE),
            ("CAM_PHOTOLAPSE", 7.0, 9),
            ("CAM_PHOTOMODE", 0.0, CHOICE),
        ):
            assert (await write(w.client, name, value, kind)).param_result == ACCEPTED
        assert value_of(await read(w.client, "CAM_PHOTOLAPSE")) == 2.0
        for _ in range(2):
            assert (await write(w.client, "CAM_PHOTOLAPSE", 2.0, 9)).param_result == FAILED
        assert sim_value(w.drone, "CAM_PHOTOLAPSE") == 7.0
        assert (await write(w.client, "CAM_PHOTOMODE", 3.0, CHOICE)).param_result == ACCEPTED
        assert (await write(w.client, "CAM_PHOTOLAPSE", 2.0, 9)).param_result == ACCEPTED
        assert sim_value(w.drone, "CAM_PHOTOLAPSE") == 2.0


async def test_conf_095_late_answer_is_announced_as_in_progress() -> None:
    async with world(speed=1.0) as w:
        w.drone.faults.down = Impairment(delay=1.0)
        mark = w.client.mark()
        send_set(w.client, "CAM_EV", 1.0, 9)
        first = await w.client.wait("PARAM_EXT_ACK", since=mark)
        assert (first.param_result, value_of(first)) == (IN_PROGRESS, 0.0)
        again = w.client.mark()
        send_set(w.client, "CAM_EV", 1.0, 9)
        repeated = await w.client.wait("PARAM_EXT_ACK", since=again)
        assert repeated.param_result == IN_PROGRESS
        last = await w.client.wait("PARAM_EXT_ACK", lambda m: m.param_result != IN_PROGRESS, since=mark)
        assert (last.param_result, value_of(last)) == (ACCEPTED, 1.0)
        assert len(w.commands("camera.set_ev_compensation")) == 1


async def test_conf_095_silent_drone_is_a_failure() -> None:
    async with world() as w:
        w.drone.faults.unreported = frozenset({"camera.style"})
        ack = await write(w.client, "CAM_SATURATION", 2.0, 9)
        assert (ack.param_result, value_of(ack)) == (FAILED, 0.0)
        assert (await write(w.client, "CAM_EV", 1.0, 9)).param_result == ACCEPTED


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_conf_095_recording_keeps_its_settings(model: str) -> None:
    async with world(model=model) as w:
        ours = await station(w)
        await w.gateway.systems[0].drone.camera.start_recording()
        for name, value in (("CAM_VIDRES", 3.0), ("CAM_MODE", 0.0), ("CAM_HDR", 1.0 - ours.values["CAM_HDR"])):
            before = ours.values[name]
            mark = w.client.mark()
            ack = await write(w.client, name, value, CHOICE)
            assert (ack.param_result, value_of(ack)) == (FAILED, before)
            pushed = await w.client.wait("PARAM_EXT_VALUE", lambda m, name=name: m.param_id == name, since=mark)
            assert value_of(pushed) == before
        await w.client.wait("STATUSTEXT", lambda m: "camera is recording" in m.text, since=0)
        assert w.gateway.systems[0].drone.camera[0].recording_now
        assert (await write(w.client, "CAM_EV", 1.0, 9)).param_result == ACCEPTED


async def test_conf_095_mission_keeps_the_settings_of_its_pictures() -> None:
    photo = Item(dialect.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, p1=0.0, p2=0.0, p3=1.0, p4=1.0, frame=2)
    async with world(web=True, speed=8.0) as w:
        await put(w, [takeoff(5.0), way(60.0, 0.0, 5.0), photo, way(60.0, 5.0, 5.0)])
        await start(w)
        await state(w, ACTIVE, seq=1)
        mark = w.client.mark()
        ack = await write(w.client, "CAM_EV", 1.0, 9)
        assert (ack.param_result, value_of(ack)) == (FAILED, 0.0)
        await said(w, "mission uses camera", since=mark)
        assert w.commands("camera.set_ev_compensation") == []
        assert (await write(w.client, "CAM_ZOOMSPEED", 1.0, 9)).param_result == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0)).result == dialect.MAV_RESULT_ACCEPTED
        assert (await write(w.client, "CAM_EV", 1.0, 9)).param_result == ACCEPTED


async def test_conf_095_writes_fail_when_the_link_is_lost() -> None:
    async with world(speed=1.0) as w:
        mark = w.client.mark()
        w.drone.faults.mute = True
        for name, value in (("CAM_EV", 1.0), ("CAM_SATURATION", 2.0)):
            send_set(w.client, name, value, 9)
        for name in ("CAM_EV", "CAM_SATURATION"):
            ack = await w.client.wait(
                "PARAM_EXT_ACK", lambda m, name=name: (m.param_id, m.param_result) == (name, FAILED), since=mark
            )
            assert value_of(ack) == 0.0
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: True, timeout=20.0)
        for name in ("CAM_EV", "CAM_SATURATION"):
            assert value_of(await read(w.client, name)) == pytest.approx(sim_value(w.drone, name), abs=1e-6)


async def test_conf_095_two_clients_see_the_drones_last_answer() -> None:
    async with world(clients=2) as w:
        first, second = w.clients
        marks = first.mark(), second.mark()
        send_set(first, "CAM_EV", 1.0, 9)
        send_set(second, "CAM_EV", -1.0, 9)
        for client, mark in zip(w.clients, marks, strict=True):
            ack = await client.wait("PARAM_EXT_ACK", lambda m: m.param_result in (ACCEPTED, UNSUPPORTED), since=mark)
            assert ack.param_result == ACCEPTED
        last = sim_value(w.drone, "CAM_EV")
        for client, mark in zip(w.clients, marks, strict=True):
            await client.wait("PARAM_EXT_VALUE", lambda m: value_of(m) == last, since=mark)
            values = [value_of(m) for _, m in client.since(mark, "PARAM_EXT_VALUE") if m.param_id == "CAM_EV"]
            assert set(values) == {-1.0, 1.0}
            assert values[-1] == last


async def test_conf_096_change_elsewhere_reaches_every_client() -> None:
    async with world(clients=2) as w:
        await fetch(w.client)
        marks = [client.mark() for client in w.clients]
        w.drone.inject(EvCompensation(cam_id=0, value=CameraEvCompensation.EV_MINUS_1_00))
        w.drone.inject(ZoomLevel(cam_id=0, level=1.5))
        for client, mark in zip(w.clients, marks, strict=True):
            value = await client.wait("PARAM_EXT_VALUE", since=mark)
            assert (value.param_id, value_of(value)) == ("CAM_EV", -1.0)
            # Once more, for a client that has lost it.
            await client.wait("PARAM_EXT_VALUE", lambda m, lost=value: m is not lost, since=mark)
            assert [m.param_id for _, m in client.since(mark, "PARAM_EXT_VALUE")] == ["CAM_EV", "CAM_EV"]


async def test_conf_096_settings_that_follow_a_change_are_sent_too() -> None:
    async with world(clients=2) as w:
        other = w.clients[1]
        mark = other.mark()
        assert (await write(w.client, "CAM_VIDMODE", 2.0, CHOICE)).param_result == ACCEPTED
        for name in ("CAM_VIDMODE", "CAM_VIDRES", "CAM_VIDFPS"):
            message = await other.wait("PARAM_EXT_VALUE", lambda m, name=name: m.param_id == name, since=mark)
            assert value_of(message) == pytest.approx(sim_value(w.drone, name), abs=1e-6)


async def test_conf_096_mode_as_parameter_and_as_setting_is_one() -> None:
    async with world(clients=2) as w:
        other = w.clients[1]
        for mode in (0.0, 1.0):
            mark = other.mark()
            assert (await write(w.client, "CAM_MODE", mode, CHOICE)).param_result == ACCEPTED
            assert (await other.wait("CAMERA_SETTINGS", since=mark)).mode_id == mode
        mark = w.client.mark()
        ack = await other.command(dialect.MAV_CMD_SET_CAMERA_MODE, 0, 0, target=(1, CAMERA))
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        value = await w.client.wait("PARAM_EXT_VALUE", lambda m: m.param_id == "CAM_MODE", since=mark)
        assert value_of(value) == 0.0


@both
async def test_conf_094_definition_is_the_same_over_http(flavour: str) -> None:
    async with world(flavour=flavour) as w, aiohttp.ClientSession() as http:
        plain = await Ftp(w.client, component=CAMERA).download("/camera_definition.xml")
        assert w.gateway.web is not None
        url = w.gateway.web.url_for("127.0.0.1", "/drone/1/camera_definition.xml")
        assert url is not None
        async with http.get(url) as answer:
            assert (answer.status, answer.content_type) == (200, "application/xml")
            assert await answer.read() == plain
        async with http.get(f"{url}.xz") as answer:
            assert lzma.decompress(await answer.read()) == plain
        async with http.get(url.replace("/1/", "/8/")) as answer:
            assert answer.status == 404


async def test_other_capabilities_make_another_definition() -> None:
    async with world(model="thermal") as w:
        link = w.gateway.systems[0].definition
        before, announced = await load(w.client), asyncio.Event()
        link.subscribe(announced.set)
        assert (link.uri, link.version) == ("mftp://camera_definition.xml.xz", before.version)
        reports = w.drone.firmware.payload.cameras[0].settings_report()
        (exposure,) = (report for report in reports if isinstance(report, ExposureSettings))
        every = structs.replace(exposure, manual_iso_sensitivity_capabilities=0xFFFFFF)
        mark = w.client.mark()
        w.drone.inject(every)
        await announced.wait()
        information = await w.client.wait("CAMERA_INFORMATION", since=mark)
        assert (information.cam_definition_uri, information.cam_definition_version) == (link.uri, link.version)
        after = await load(w.client)
        assert after.version == link.version != before.version
        assert len(after.parameters["CAM_ISO"].options) > len(before.parameters["CAM_ISO"].options)


async def test_definition_keeps_options_that_are_reported_no_longer() -> None:
    async with world(model="thermal") as w:
        before = await load(w.client)
        times = [option.value for option in before.parameters["CAM_SHUTTERSPD"].options]
        reports = w.drone.firmware.payload.cameras[0].settings_report()
        (exposure,) = (report for report in reports if isinstance(report, ExposureSettings))
        few = structs.replace(exposure, manual_shutter_speed_capabilities=0b11)
        w.drone.inject(few)
        await w.gateway.systems[0].drone.expect(ExposureSettings, lambda m: True, 5.0)
        for _ in range(2):  # longer than the gateway waits for further events
            await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        after = await load(w.client)
        assert after.version == before.version
        assert [option.value for option in after.parameters["CAM_SHUTTERSPD"].options] == times
