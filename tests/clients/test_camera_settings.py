"""Unmodified MAVSDK and MAVProxy: the camera's settings by their definition (conformance 94 to 96, 113, 116)."""

from __future__ import annotations

import asyncio
import re
import shutil
import sys
from pathlib import Path

import pytest
from support.definition_readers import read_definition
from support.ext_params import fetch, value_of, write
from support.ftp import Ftp
from support.mav import CAMERA
from support.product import Process, program
from support.sim_settings import sim_value
from support.world import world

from anafi_mav.arsdk.messages.camera import CameraEvCompensation, EvCompensation
from anafi_mav.mavlink import dialect

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_camera_settings.py")
MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent)) or "mavproxy.py"


@pytest.mark.parametrize(("model", "flavour"), [("4k", "px4"), ("thermal", "ardupilot")])
async def test_conf_116_mavsdk_lists_and_sets_camera_settings(model: str, flavour: str, tmp_path: Path) -> None:
    async with world(model=model, flavour=flavour) as w:
        drone = w.gateway.systems[0].drone
        definition = read_definition(await Ftp(w.client, component=CAMERA).download("/camera_definition.xml"))
        values = {name: value_of(message) for name, message in (await fetch(w.client)).items()}
        hidden = definition.hidden(values)
        words = (sys.executable, "-u", str(SCRIPT), f"tcpout://{w.address}:5760")
        # It keeps definitions in the home directory: an empty one, so that it has to load.
        env = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
        async with program(*words, env=env, stdin=asyncio.subprocess.PIPE) as script:

            async def step(name: str) -> None:
                await script.line(lambda line: line == f"held {name}", timeout=30.0)

            for name in ("CAM_EV", "CAM_WBMODE", "CAM_ZOOMLOSSY", "CAM_VIDMODE"):
                await step(name)
                options = [float(text) for text in script.said(f"options {name}")[-1].split()]
                assert options == pytest.approx([option.value for option in definition.parameters[name].options])
                assert sim_value(w.drone, name) == pytest.approx(options[-1], abs=1e-6)
                assert float(script.said(f"reads {name}")[-1]) == pytest.approx(options[-1], abs=1e-6)
                script.say("")
            await step("CAM_ZOOMSPEED")
            assert sim_value(w.drone, "CAM_ZOOMSPEED") == pytest.approx(1.5)
            before = sim_value(w.drone, "CAM_VIDMODE")
            await drone.camera.start_recording()
            script.say("")
            await step("recording")
            (tried,) = script.said("tried recording")
            assert tried != "done"
            assert sim_value(w.drone, "CAM_VIDMODE") == before
            w.drone.inject(EvCompensation(cam_id=0, value=CameraEvCompensation.EV_MINUS_1_00))
            # By another client: MAVSDK notices changes of int32 and float only.
            choice = dialect.MAV_PARAM_EXT_TYPE_INT32
            assert (await write(w.client, "CAM_ANTIFLICKER", 2.0, choice)).param_result == dialect.PARAM_ACK_ACCEPTED
            script.say("")
            await script.line(lambda line: line == "done", timeout=30.0)

            listed = set(script.said("listed")[0].split())
            shown = {name for name, one in definition.parameters.items() if one.is_listed}
            assert shown - hidden <= listed <= shown
            assert float(script.said("reads CAM_ISOMAX")[0]) == values["CAM_ISOMAX"]
            ranges = set(script.said("range")[0].split())
            assert ranges == {name for name in listed if not definition.parameters[name].options}
            assert set(script.said("after")[0].split()) == {"3", "4"}


async def typed(mavproxy: Process, command: str, pattern: str) -> str:
    """Type a command; the line that follows and has the pattern in it."""
    since = len(mavproxy.lines)
    mavproxy.say(command)
    return await mavproxy.line(lambda line: re.search(pattern, line) is not None, since=since, timeout=20.0)


async def shows(mavproxy: Process, name: str, value: str) -> None:
    """List the settings until this one has the value: MAVProxy does not report its arrival."""
    while True:
        since = len(mavproxy.lines)
        mavproxy.say("camera params")
        line = await mavproxy.line(lambda line: f"{name} " in line, since=since, timeout=20.0)
        if line.split()[line.split().index(name) + 1] == value:
            return


async def test_conf_113_mavproxy_loads_and_sets_camera_settings(tmp_path: Path) -> None:
    async with world(model="thermal", flavour="ardupilot") as w:
        values = {name: value_of(message) for name, message in (await fetch(w.client)).items()}
        before = {"CAM_EV": str(values["CAM_EV"]), "CAM_WBMODE": f"{values['CAM_WBMODE']:g}"}
        loaded = f"loaded {len(values)} settings"
        words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{w.address}:5760", f"--state-basedir={tmp_path}")
        async with program(*words, stdin=asyncio.subprocess.PIPE, env={"HOME": str(tmp_path)}) as mavproxy:
            await mavproxy.line(lambda line: "online system 1" in line, timeout=30.0)
            await typed(mavproxy, "module load camera", loaded)
            # It sets nothing before it has read the value.
            for name in ("CAM_EV", "CAM_WBMODE"):
                await shows(mavproxy, name, before[name])
            for name, value, command in (
                ("CAM_EV", "-2.0", "camera.set_ev_compensation"),
                ("CAM_WBMODE", "2", "camera.set_white_balance"),
            ):
                mavproxy.say(f"camera param {name} {value}")
                await w.drone.wait_log(lambda entry, command=command: entry.name == command, 20.0)
                assert sim_value(w.drone, name) == pytest.approx(float(value), abs=1e-6)
                await shows(mavproxy, name, value)
            assert w.gateway.web is not None
            url = w.gateway.web.url_for("127.0.0.1", "/drone/1/camera_definition.xml")
            for ending in ("", ".xz"):
                await typed(mavproxy, f"camera definition {url}{ending}", loaded)
            assert not [line for line in mavproxy.lines if "Traceback" in line], mavproxy
