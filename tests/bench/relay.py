"""The video relay: added delay, processor time per viewer, and the time to the first picture.

    .venv/bin/python tests/bench/relay.py [SECONDS]

Simulator, gateway and viewers are three processes. Each drone's stream has the size of an ANAFI's: 5 Mbit/s and a key
picture each second, filled with NAL units of type 12, which players skip. The added delay of a picture is the time from
the simulator's send of its last datagram until the system has received the last datagram for a viewer (SO_TIMESTAMPNS);
over TCP until the viewer has read it, with the wake-up of its process. A first picture is timed from the connection,
so it holds DESCRIBE, SETUP and PLAY. Of a closed session the simulator's first picture is a key picture; a real drone's
encoder may take up to a second more. On a machine with other work, `chrt -r 5` before the command keeps that out of the
figures.
"""

from __future__ import annotations

import selectors
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from common import ROOT, loopback, machine, product, quantile, usage

BIT_RATE = 5e6
KEY_BYTES = 100_000
OTHER_BYTES = round((BIT_RATE / 8 - KEY_BYTES) / 29)
"""Of each of the 29 pictures between two key pictures."""

OTHERS = 20
"""Drones whose telemetry runs beside the watched ones in the large run."""

LINGER = 5.0
"""s that the relay keeps a drone's session without a viewer (anafi_mav.relay.source)."""
SETTLE = 3.0
"""s before a measurement: beyond the connections' own work."""

RTSP_PORT, RELAY_PORT = 8554, 8555
SO_TIMESTAMPNS = 35
"""Linux socket option (asm-generic/socket.h); Python 3.11 has no name for it."""
TIMESPEC = struct.Struct("@ll")
FILLER, MARK = 12, 16
"""Type of the NAL units that fill a picture, and the length of the drone and picture numbers in them."""


# -- the simulator, with pictures of real size


def simulate(log: str, arguments: list[str]) -> None:
    """Run `anafi-mav sim`; note in `log` when the last datagram of each picture was sent."""
    from anafi_mav.arsdk.video.rtp_h264 import PictureSender
    from anafi_mav.cli import main as command

    sent = Path(log).open("w", encoding="ascii", buffering=1)  # noqa: SIM115  # until the process ends
    numbers: dict[int, int] = {}
    send = PictureSender.send

    def send_large(self: PictureSender, units: Any, *rest: Any) -> Iterator[bytes]:
        number = numbers[self.ssrc] = numbers.get(self.ssrc, 0) + 1
        size = KEY_BYTES if any(unit[0] & 0x1F == 5 for unit in units) else OTHER_BYTES
        mark = f"{self.ssrc:08x}{number:08x}"
        filler = bytes((FILLER,)) + mark.encode() + b"\xff" * (size - sum(map(len, units)) - MARK - 2) + b"\x80"
        yield from send(self, [*units, filler], *rest)
        sent.write(f"{mark} {time.time()}\n")  # the last one has left

    PictureSender.send = send_large  # type: ignore[method-assign,assignment]
    sys.exit(command(["sim", *arguments]))


# -- viewers


class Viewer:
    """A viewer of one stream: notes when the last packet of each picture arrived."""

    def __init__(self, host: str, path: str, transport: str) -> None:
        self.arrived: dict[str, float] = {}
        """By the mark of a picture, s since 1970."""
        self.first: float | None = None
        """s from the connection to the first complete picture."""
        self.gaps = 0
        """Packets missing."""
        self._began = time.time()
        self._mark = ""
        self._sequence: int | None = None
        self._data = bytearray()
        self._rtsp = socket.create_connection((host, RELAY_PORT))
        self._url = f"rtsp://{host}:{RELAY_PORT}/{path}"
        self._cseq = 0
        self._rtp: socket.socket | None = None
        self._ask("DESCRIBE", self._url, "Accept: application/sdp")
        if transport == "udp":
            self._rtp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._rtp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
            self._rtp.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            self._rtp.bind((self._rtsp.getsockname()[0], 0))
            port = self._rtp.getsockname()[1]
            spec = f"RTP/AVP;unicast;client_port={port}-{port + 1}"
        else:
            spec = "RTP/AVP/TCP;unicast;interleaved=0-1"
        session = self._ask("SETUP", f"{self._url}/video", f"Transport: {spec}")
        self._session = next(
            line.partition(":")[2].partition(";")[0].strip()
            for line in session.splitlines()
            if line.lower().startswith("session:")
        )
        self._ask("PLAY", self._url, f"Session: {self._session}")
        self.socket = self._rtsp if self._rtp is None else self._rtp
        self.socket.setblocking(False)

    def _ask(self, method: str, url: str, header: str) -> str:
        self._cseq += 1
        self._rtsp.sendall(f"{method} {url} RTSP/1.0\r\nCSeq: {self._cseq}\r\n{header}\r\n\r\n".encode())
        text = bytearray()
        while (end := text.find(b"\r\n\r\n")) < 0:
            text += self._rtsp.recv(65536)
        head = text[:end].decode()
        if not head.startswith("RTSP/1.0 200"):
            raise SystemExit(f"{method} {url}: {head.splitlines()[0]}")
        length = next((int(s[15:]) for s in head.splitlines() if s.lower().startswith("content-length:")), 0)
        while len(text) < end + 4 + length:
            text += self._rtsp.recv(65536)
        self._data = text[end + 4 + length :]  # pictures inside the connection follow the answer to PLAY
        return head

    def read(self) -> None:
        """Take what has arrived."""
        try:
            while True:
                self._read_datagram() if self._rtp is not None else self._read_stream()
        except BlockingIOError:
            pass

    def _read_datagram(self) -> None:
        assert self._rtp is not None
        data, extra, _, _ = self._rtp.recvmsg(2048, 64)
        seconds, nanoseconds = TIMESPEC.unpack(extra[0][2])
        self._take(data, seconds + nanoseconds / 1e9)

    def _read_stream(self) -> None:
        data = self._rtsp.recv(1 << 18)
        if not data:
            raise SystemExit("the relay has closed a connection")
        now = time.time()
        self._data += data
        at = 0
        while len(self._data) - at >= 4:
            length = int.from_bytes(self._data[at + 2 : at + 4], "big")
            if self._data[at] != ord("$") or len(self._data) - at < 4 + length:
                break
            if self._data[at + 1] == 0:
                self._take(bytes(self._data[at + 4 : at + 4 + length]), now)
            at += 4 + length
        del self._data[:at]

    def _take(self, packet: bytes, now: float) -> None:
        sequence = int.from_bytes(packet[2:4], "big")
        if self._sequence is not None:
            self.gaps += sequence - self._sequence - 1 & 0xFFFF
        self._sequence = sequence
        if packet[12] & 0x1F == 28 and packet[13] == 0x80 | FILLER:
            self._mark = packet[14 : 14 + MARK].decode()
        if packet[1] & 0x80:
            self.arrived[self._mark] = now
            if self.first is None:
                self.first = now - self._began

    def close(self) -> None:
        self._rtsp.close()
        if self._rtp is not None:
            self._rtp.close()


def watch(viewers: list[Viewer], seconds: float) -> None:
    """Let the viewers read for a while."""
    with selectors.DefaultSelector() as ready:
        for viewer in viewers:
            ready.register(viewer.socket, selectors.EVENT_READ, viewer)
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            for key, _ in ready.select(left):
                key.data.read()


# -- measurements


class Fleet:
    """Simulated drones and a gateway that relays their videos."""

    def __init__(self, gateway: subprocess.Popen[str], host: str, log: Path) -> None:
        self.gateway = gateway
        self.host = host
        self.log = log

    def delays(self, drones: int, count: int, transport: str, seconds: float) -> str:
        """Return one row: `count` viewers of each of the first drones."""
        before = {mark for mark, _ in self._sent()}
        viewers = [
            Viewer(self.host, f"{drone}/visible", transport) for drone in range(1, drones + 1) for _ in range(count)
        ]
        watch(viewers, SETTLE)
        cpu, began = usage(self.gateway)[0], time.monotonic()
        from_here = time.time()
        watch(viewers, seconds)
        share = (usage(self.gateway)[0] - cpu) / (time.monotonic() - began)
        until = time.time() - 0.2
        sent = {mark: at for mark, at in self._sent() if mark not in before and from_here <= at < until}
        late = [viewer.arrived[mark] - at for viewer in viewers for mark, at in sent.items() if mark in viewer.arrived]
        of_drone = Counter(mark[:8] for mark in sent)
        expected = sum(of_drone[next(reversed(viewer.arrived), "")[:8]] for viewer in viewers)
        for viewer in viewers:
            viewer.close()
        p50, p99 = (1000 * quantile(late, part) for part in (0.5, 0.99))
        return (
            f"| {drones} | {count} | {transport.upper()} | {p50:.2f} ms | {p99:.2f} ms | {1000 * max(late):.1f} ms "
            f"| {len(late)} of {expected} | {sum(viewer.gaps for viewer in viewers)} | {share:.1%} |"
        )

    def load(self, seconds: float) -> float:
        """Return the gateway's share of a core without a viewer."""
        cpu, began = usage(self.gateway)[0], time.monotonic()
        time.sleep(seconds)
        return (usage(self.gateway)[0] - cpu) / (time.monotonic() - began)

    def firsts(self, drones: list[int], transport: str) -> list[float]:
        """Return the times to the first picture, of a viewer of each drone in turn."""
        found = []
        for drone in drones:
            viewer = Viewer(self.host, f"{drone}/visible", transport)
            while viewer.first is None:
                watch([viewer], 0.01)
            found.append(viewer.first)
            viewer.close()
        return found

    def _sent(self) -> list[tuple[str, float]]:
        whole = self.log.read_text(encoding="ascii").rpartition("\n")[0]
        return [(line[: 2 * 8], float(line[2 * 8 :])) for line in whole.splitlines()]


@contextmanager
def fleet(drones: int) -> Iterator[Fleet]:
    first, host = loopback(), loopback()
    head, _, last = first.rpartition(".")
    listed = [
        {"name": f"d{n}", "sysid": n, "address": f"{head}.{int(last) + n - 1}", "rtsp_port": RTSP_PORT}
        for n in range(1, drones + 1)
    ]
    sink = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sink.bind((host, 0))
    threading.Thread(target=_drain, args=(sink,), daemon=True).start()
    with tempfile.TemporaryDirectory() as folder:
        config, log = Path(folder) / "fleet.yaml", Path(folder) / "sent"
        settings = {
            "endpoints": [f"udpout://{host}:{sink.getsockname()[1]}"],
            "drones": listed,
            "video": {"host": host, "rtsp_port": RELAY_PORT},
            "http": False,
            "state": folder,
        }
        config.write_text(yaml.safe_dump(settings))
        options = ["--address", first, "--count", str(drones), "--telemetry-rate", "30", "--http-port", "0"]
        own = (str(ROOT / "tests" / "bench" / "relay.py"), "simulate", str(log))
        with (
            product(*options, "--rtsp-port", str(RTSP_PORT), program=own),
            product("run", "-c", str(config)) as gateway,
        ):
            time.sleep(SETTLE)
            yield Fleet(gateway, host, log)


def _drain(sink: socket.socket) -> None:
    while sink.recv(2048):
        pass


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    print(machine())
    head = "p50 | p99 | largest | pictures | packets lost | gateway, share of one core"
    print(f"| watched drones | viewers each | transport | {head} |")
    print("|---|---|---|---|---|---|---|---|---|", flush=True)
    with fleet(1) as one:
        print(f"| 1 | 0 | – | – | – | – | – | – | {one.load(seconds):.1%} |", flush=True)
        for count, transport in ((1, "udp"), (4, "udp"), (1, "tcp"), (4, "tcp")):
            print(one.delays(1, count, transport, seconds), flush=True)
    with fleet(4 + OTHERS) as many:
        print(f"| 4, beside {OTHERS} | 0 | – | – | – | – | – | – | {many.load(seconds):.1%} |", flush=True)
        closed = {"udp": many.firsts([*range(5, 15)], "udp"), "tcp": many.firsts([*range(15, 25)], "tcp")}
        time.sleep(LINGER + SETTLE)
        for transport in ("udp", "tcp"):
            print(many.delays(4, 4, transport, seconds), flush=True)
        running = {kind: many.firsts([1] * 10, kind) for kind in ("udp", "tcp")}
    for name, found in (("running", running), ("closed", closed)):
        for kind, times in found.items():
            figures = f"median {quantile(times, 0.5):.3f} s, largest {max(times):.3f} s"
            print(f"first picture over {kind}, session {name}: {figures}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["simulate"]:
        simulate(sys.argv[2], sys.argv[3:])
    else:
        main()
