"""MAVLink routers of other projects: the words that start each of them between gateways and stations."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

ROUTERS = {"mavproxy": "", "mavlink-router": "MAVLINK_ROUTERD", "mavp2p": "MAVP2P"}
"""Routers, with the environment variable that names the program; MAVProxy is in the test extra."""


def program_of(router: str) -> str | None:
    """The program, or None where there is none on this machine."""
    if router == "mavproxy":
        found = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent))
    else:
        found = os.environ.get(ROUTERS[router]) or None
    return found


def words(router: str, program: str, gateways: Sequence[str], stations: str) -> list[str]:
    """The command line: TCP to each "host:port" of `gateways`, and a UDP port at which stations connect."""
    if router == "mavproxy":
        quiet = ["--non-interactive", "--no-state", "--mav20", "--streamrate=-1", "--heartbeat-rate=0"]
        masters = [f"--master=tcp:{place}" for place in gateways]
        return [sys.executable, "-u", program, *quiet, "--default-modules=", *masters, f"--out=udpin:{stations}"]
    if router == "mavlink-router":
        # A file of the machine's own must not add endpoints.
        own = ["-c", "/nonexistent/main.conf", "-d", "/nonexistent", "-t", "0"]
        return [program, *own, *(word for place in gateways for word in ("-p", place)), stations]
    silent = ["--hb-disable", "--streamreq-disable"]
    return [program, *silent, *(f"tcpc:{place}" for place in gateways), f"udps:{stations}"]
