"""Unmodified MAVSDK: parameters, files, metadata and events, in both flavours (conformance B2, 116)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.flavours import both
from support.params import fetch
from support.product import Process, program
from support.world import world

from anafi_mav import mav_enums

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_setup.py")


def sets_of(script: Process) -> int:
    """PARAM_SETs that MAVSDK has sent."""
    return len([line for line in script.complaints if "Sending param_set" in line])


@both
async def test_conf_116_mavsdk_param_ftp_metadata_events(flavour: str, tmp_path: Path) -> None:
    async with world(flavour=flavour) as w:
        count = len(await fetch(w.client))
        folder = tmp_path / "downloads"
        folder.mkdir()
        words = (sys.executable, "-u", str(SCRIPT), f"tcpout://{w.address}:5760", str(folder), flavour)
        # Its cache of metadata lies in the home directory: an empty one, so that it has to load. It loads each file
        # once: where COMPONENT_METADATA is not received after five requests, or a transfer is silent for ten times half
        # a second, it reports nothing to its user and does not try again (component_metadata_impl.cpp,
        # retrieve_metadata). A computer that stalls for so long fails this test: its log shows at which file.
        env = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache"), "MAVSDK_PARAMETER_DEBUGGING": "1",
               "MAVSDK_COMPONENT_METADATA_DEBUGGING": "1"}  # fmt: skip
        async with program(*words, env=env) as script:
            await script.line(lambda line: line == "done", timeout=90.0)

            assert script.said("parameters") == [str(count)]
            before, after, at_last = script.said("height")
            assert (after, at_last) == ("41.5", "41.5")
            assert before != after
            name = "rth.set_min_altitude" if flavour == "px4" else "ardrone3.PilotingSettings.MaxAltitude"
            # Once for each time that MAVSDK said it, which it does again when there is no answer for half a second; all
            # but one, which is refused.
            observed = [list(entry.args.values()) for entry in w.commands(name)]
            assert observed in [[[41.5]] * number for number in range(1, sets_of(script))]
            assert script.said("whole") == ["4001" if flavour == "px4" else "2000"]
            assert len(script.said("refused")) == 1

            listed = script.said("listed")[0].split()
            assert {"general.json.xz", "parameter.json", "parameter.json.xz", "events.json.xz"} <= set(listed)
            burst, read = script.said("downloaded")
            assert burst == read
            assert int(burst.split()[1]) == count
            assert script.said("identical") == ["True", "True"]
            assert script.said("missing") == ["FILE_DOES_NOT_EXIST"]
            assert script.said("upload") == ["FILE_PROTECTED"]
            assert script.said("remove") == ["FILE_PROTECTED"]
            assert sorted(script.said("metadata")) == ["events 1", f"parameter {count}"]

            # Health and arming checks, as QGroundControl's own library reads them.
            await script.line(lambda line: line.startswith("report"), timeout=20.0)
            assert "can_arm=True problems=[] errors=[]" in script.said("report")[-1]
            w.drone.faults.magneto_required = True
            line = await script.line(
                lambda line: line.startswith("report") and "Magnetometer calibration required" in line
            )
            assert "can_arm=False" in line
            assert "errors=['magnetometer']" in line
            w.drone.faults.magneto_required = False
            since = len(script.lines)
            await script.line(
                lambda line: line.startswith("report") and "can_arm=True problems=[]" in line, since=since
            )
            w.drone.faults.gps = False
            line = await script.line(lambda line: "No GPS fix (gps)" in line, since=since)
            assert "can_arm=True" in line  # an ANAFI hovers without
            w.drone.faults.gps = True
            assert (await w.client.command(mav_enums.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == 0
            await script.line(lambda line: line == "event anafi armed Armed")
