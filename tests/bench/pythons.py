"""Wheel and source distribution installed and flown with every interpreter that is named.

    .venv/bin/python tests/bench/pythons.py python3.10 python3.12 python3.13 ...

Both are built once. Each is installed by pip into a new environment of each interpreter, with what it needs from the
package index. Then README's first command runs there, with a state folder and an endpoint of its own, and a client
flies: arm, take-off, go to, landing. The exit status is 1 when one of them fails.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import ROOT, Client, loopback, machine
from pymavlink import mavutil

STEP_LIMIT = 600.0
"""s for an installation: what no cache has is loaded, and the source distribution is built."""

START_LIMIT = 60.0
LANDED_LIMIT = 60.0


def main() -> int:
    interpreters = sys.argv[1:] or [sys.executable]
    print(machine())
    print("| Python | installed from | pip | ready after | flight |\n|---|---|---|---|---|", flush=True)
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for package in build(Path(folder) / "dist"):
            for number, interpreter in enumerate(interpreters):
                home = Path(folder) / f"{number}{package.suffix}"
                version = said([interpreter, "-c", "import platform; print(platform.python_version())"])
                try:
                    result = fly(install(interpreter, package, home), home)
                except (subprocess.SubprocessError, SystemExit, OSError) as error:
                    failed += 1
                    text = getattr(error, "stderr", None) or str(error)
                    result = f"– | – | FAILED: {str(text).strip().splitlines()[-1]}"
                kind = "wheel" if package.suffix == ".whl" else "sdist"
                print(f"| {version.strip()} | {kind} | {result} |", flush=True)
    return 1 if failed else 0


def said(words: list[str]) -> str:
    return subprocess.run(words, check=True, capture_output=True, text=True, timeout=STEP_LIMIT).stdout


def build(folder: Path) -> list[Path]:
    """Return the wheel and the source distribution of this tree."""
    words = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True, timeout=STEP_LIMIT)
    return sorted(folder.iterdir())


def install(interpreter: str, package: Path, home: Path) -> Path:
    """Return the folder of programs of a new environment with the package; pip has found no conflict there."""
    said([interpreter, "-m", "venv", str(home)])
    programs = home / "bin"
    said([str(programs / "pip"), "install", "--quiet", str(package)])
    said([str(programs / "pip"), "check"])
    return programs


def fly(programs: Path, home: Path) -> str:
    """Run README's first command, fly its drone and land it; return the rest of the row."""
    address = loopback()
    count = len(said([str(programs / "pip"), "list", "--format=freeze"]).splitlines())
    environment = {**os.environ, "XDG_STATE_HOME": str(home / "state")}
    words = [str(programs / "anafi-mav"), "--endpoint", f"tcpin://{address}:5760"]
    began = time.monotonic()
    with subprocess.Popen(words, cwd=home, env=environment, stdout=subprocess.PIPE, text=True) as gateway:
        try:
            assert gateway.stdout is not None
            if not any(line.startswith("ready") for line in gateway.stdout):
                raise SystemExit("anafi-mav ended before it was ready")
            ready = time.monotonic() - began
            client = Client(f"tcp:{address}:5760")
            client.take_off(5.0)
            there = client.expect("GLOBAL_POSITION_INT", 5.0)
            north = there.lat + 900  # 10 m
            goto = (1, 1, 6, mavutil.mavlink.MAV_CMD_DO_REPOSITION, 0, 0, -1, 1, 0, float("nan"))
            client.link.mav.command_int_send(*goto, north, there.lon, 8.0)
            client.expect("GLOBAL_POSITION_INT", 30.0, lambda m: abs(m.lat - north) < 90 and m.relative_alt > 7500)
            client.command(mavutil.mavlink.MAV_CMD_NAV_LAND)
            armed = mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED
            client.expect("HEARTBEAT", LANDED_LIMIT, lambda m: m.get_srcComponent() == 1 and not m.base_mode & armed)
        finally:
            gateway.terminate()
        if gateway.wait(30.0) != 0:
            raise SystemExit(f"anafi-mav ended with status {gateway.returncode}")
    return f"{count} distributions | {ready:.1f} s | landed, ended with status 0"


if __name__ == "__main__":
    sys.exit(main())
