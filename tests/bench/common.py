"""What the measuring scripts share: the product's processes, a MAVLink client, and how figures are said."""

from __future__ import annotations

import io
import ipaddress
import os
import platform
import random
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pymavlink import mavutil

ROOT = Path(__file__).resolve().parents[2]

TICKS = os.sysconf("SC_CLK_TCK")


def frames_option(words: list[str]) -> tuple[list[str], str]:
    """The words of a command line without `many`, and the query of an endpoint that it stands for."""
    return [word for word in words if word != "many"], "?frames=many" if "many" in words else ""


def machine() -> str:
    """The machine in one line, as far as it says what it is."""
    model = platform.machine()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            model = line.partition(":")[2].strip()
            break
    return f"{os.cpu_count()} cores of {model}, {platform.system()}, Python {platform.python_version()}"


def loopback() -> str:
    """A loopback address that no one is likely to use."""
    return f"127.{random.randint(64, 126)}.{random.randint(1, 250)}.{random.randint(1, 100)}"


def consecutive(first: str, count: int) -> list[str]:
    """Addresses from `first` on."""
    return [str(ipaddress.IPv4Address(first) + number) for number in range(count)]


@contextmanager
def product(*arguments: str, program: Sequence[str] = ("-m", "anafi_mav")) -> Iterator[subprocess.Popen[str]]:
    """`anafi-mav ...` from its line that begins with "ready" to the end of the block.

    `program` is another script that runs it.
    """
    with subprocess.Popen([sys.executable, *program, *arguments], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            while not (line := process.stdout.readline()).startswith("ready"):
                if not line:
                    raise SystemExit(f"anafi-mav {' '.join(arguments)} ended before it was ready")
            yield process
        finally:
            process.terminate()


@contextmanager
def tree_of(commit: str) -> Iterator[Path]:
    """The files of a commit in a temporary folder, with its generated modules."""
    with tempfile.TemporaryDirectory() as root:
        archive = subprocess.run(["git", "-C", str(ROOT), "archive", commit], check=True, stdout=subprocess.PIPE).stdout
        with tarfile.open(fileobj=io.BytesIO(archive)) as files:
            files.extractall(root, filter="data")
        generate = [sys.executable, str(Path(root) / "dialect" / "generate.py")]
        subprocess.run(generate, check=True, stdout=subprocess.DEVNULL)
        yield Path(root)


def quantile(values: Sequence[float], share: float) -> float:
    """The value that `share` of all are not above."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]


def usage(process: subprocess.Popen[str]) -> tuple[float, float]:
    """(s of processor time so far, MiB of memory in use)."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    pages = int(Path(f"/proc/{process.pid}/statm").read_text().split()[1])
    return (int(fields[11]) + int(fields[12])) / TICKS, pages * os.sysconf("SC_PAGE_SIZE") / 2**20


class Client:
    """A MAVLink client of system 1, over pymavlink's own connection."""

    def __init__(self, url: str, system: int = 255) -> None:
        self.link: Any = mavutil.mavlink_connection(url, source_system=system, source_component=190)
        self.expect("HEARTBEAT", 10.0)

    def expect(self, kind: str, timeout: float, accept: Callable[[Any], bool] = lambda message: True) -> Any:
        """The next message of a kind that `accept` likes."""
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            message = self.link.recv_match(type=kind, blocking=True, timeout=left)
            if message is not None and accept(message):
                return message
        raise SystemExit(f"no such {kind} within {timeout:g} s")

    def drain(self) -> None:
        """Read what has come, so that no buffer fills."""
        while self.link.recv_match(blocking=False) is not None:
            pass

    def command(self, id: int, *params: float) -> None:
        """Send COMMAND_LONG and wait until it is accepted."""
        values = [*params, *[0.0] * (7 - len(params))]
        self.link.mav.command_long_send(1, 1, id, 0, *values)
        self.expect("COMMAND_ACK", 20.0, lambda ack: ack.command == id and ack.result == 0)

    def take_off(self, height: float) -> None:
        """Arm, climb to `height` m, and wait until the vehicle holds there."""
        self.command(mavutil.mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        self.command(
            mavutil.mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, float("nan"), float("nan"), float("nan"), float("nan")
        )
        self.expect("HEARTBEAT", 30.0, lambda beat: beat.custom_mode == 0x02040000)
        self.expect("HEARTBEAT", 30.0, lambda beat: beat.custom_mode == 0x03040000)
