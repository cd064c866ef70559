"""Unmodified MAVSDK (4.x) hears the product: its telemetry, info, shell and log_files plugins, in its own process."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from support.product import free_udp_port, product, program
from support.world import loopback

from anafi_mav import __version__

pytestmark = pytest.mark.third_party

HOME = (48.8789, 2.3677, 35.0)
LISTEN = Path(__file__).with_name("mavsdk_listen.py")


async def test_telemetry_and_info(tmp_path: Path) -> None:
    address = loopback()
    port = free_udp_port(address)
    config = f"""
        endpoints: ["udpout://{address}:{port}"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, home: {list(HOME)}, speed: 2}}}}]
    """
    async with product(tmp_path, config) as p:
        async with program(sys.executable, str(LISTEN), f"udpin://{address}:{port}") as client:
            status = await client.end(110.0)
            assert status == 0, client
        observed: dict[str, Any] = {}
        for line in client.lines:
            if line.startswith("{"):
                entry = json.loads(line)
                observed[entry["kind"]] = entry["value"]
        assert observed["end"] is True

        position = observed["position"]
        assert (position["latitude_deg"], position["longitude_deg"]) == pytest.approx(HOME[:2], abs=3e-5)
        assert position["absolute_altitude_m"] == pytest.approx(HOME[2], abs=1.0)
        assert position["relative_altitude_m"] == pytest.approx(0.0, abs=0.3)
        assert observed["home"]["latitude_deg"] == pytest.approx(HOME[0], abs=3e-5)
        assert (observed["in_air"], observed["landed_state"], observed["armed"]) == (False, "ON_GROUND", False)
        assert observed["flight_mode"] == "HOLD"
        assert observed["attitude_euler"]["yaw_deg"] == pytest.approx(0.0, abs=2.0)
        assert observed["attitude_quaternion"]["w"] == pytest.approx(1.0, abs=0.01)
        assert observed["velocity_ned"]["down_m_s"] == pytest.approx(0.0, abs=0.1)
        assert observed["gps_info"]["fix_type"] == "FIX_3D"
        assert observed["raw_gps"]["horizontal_uncertainty_m"] == pytest.approx(1.0)
        assert observed["raw_gps"]["hdop"] == pytest.approx(655.35)  # UINT16_MAX, which MAVSDK hands on
        assert observed["battery"]["remaining_percent"] == pytest.approx(100.0, abs=2.0)
        assert 6.0 < observed["battery"]["voltage_v"] < 9.0
        assert all(observed["health"].values()), observed["health"]
        assert observed["health_all_ok"] is True
        assert observed["rc_status"]["is_available"]
        assert (
            observed["rc_status"]["signal_strength_percent"] is None
        )  # NaN: without sticks there is no radio of theirs
        assert observed["unix_epoch_time"] / 1e6 == pytest.approx(time.time(), abs=120.0)
        assert observed["distance_sensor"]["current_distance_m"] == pytest.approx(0.0, abs=0.3)
        assert observed["altitude"]["altitude_relative_m"] == pytest.approx(0.0, abs=0.3)
        assert observed["odometry"]["position_body"]["z_m"] == pytest.approx(0.0, abs=0.3)

        # What an ANAFI does not measure is said to be unsupported, everything else takes the rate.
        unsupported = {"actuator_output_status", "ground_truth", "imu", "scaled_imu", "raw_imu"}
        for kind, value in observed.items():
            if kind.startswith("rate "):
                expected = "UNSUPPORTED" if kind[5:] in unsupported else "SUCCESS"
                assert value == expected, kind

        assert observed["gps_global_origin"]["latitude_deg"] == pytest.approx(HOME[0], abs=3e-5)
        assert observed["version"]["flight_sw_major"] == 1
        assert observed["version"]["os_sw_major"] == 1
        assert observed["version"]["os_sw_minor"] == 8  # of the ANAFI's firmware 1.8.2
        assert observed["identification"]["hardware_uid"]
        assert observed["log_files"] == "NO_LOGFILES"
        assert f"anafi-mav {__version__}" in observed["shell"]

        assert (observed["flying landed_state"], observed["flying armed"]) == ("IN_AIR", True)
        assert observed["flying distance_sensor"]["current_distance_m"] == pytest.approx(3.0, abs=0.8)
        for name in ("attitude_quaternion", "odometry"):  # the pictures' pace; events would be at 5 Hz
            assert observed[f"hz {name}"] > 20.0, name
        date, size, copy, after = observed["flight logs"]
        lines = copy.splitlines()
        assert (len(copy), date[:4]) == (size, str(time.gmtime().tm_year))
        assert {line.split()[0] for line in lines} == {"log-1.bin"}
        assert [int(line.split()[3]) for line in lines] == list(range(len(lines)))  # none missing, none twice
        assert after == "NO_LOGFILES"
        flight = observed["flight_information"]
        assert flight["flight_uid"] > 0
        assert 0 < flight["duration_since_takeoff_ms"] <= flight["duration_since_arming_ms"]
        assert p.entries("command", "Piloting.Landing")
