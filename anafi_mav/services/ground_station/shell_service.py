"""SERIAL_CONTROL's shell: a few words about the gateway for clients that have only MAVLink.

Conformance F 153. It answers questions and changes nothing. Lines arrive in pieces of up to 70 bytes; the answer is
sent in such pieces to the client of the request. Other serial devices do not exist: a request for them gets no
answer.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping

from anafi_mav import __version__
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import Host, MessageHandler, Service

PIECE = 70
"""Bytes that one SERIAL_CONTROL carries."""

LONGEST_LINE = 256
"""Bytes of a line that is not finished; the longest command has ten."""

MAX_CLIENTS = 16
"""Clients whose unfinished line is kept."""

PROMPT = "anafi> "


def _status(host: Host) -> list[str]:
    drone, vehicle = host.drone, host.vehicle
    state = drone.battery.state
    lines = [
        f"mode {vehicle.mode.name.lower()}, {'armed' if vehicle.armed else 'disarmed'}",
        f"battery {'?' if state.percent is None else state.percent} %",
        f"link quality {drone.link.state.quality or '?'} of 5, {drone.link.state.rssi_dbm or '?'} dBm",
    ]
    problems = vehicle.prearm_problems()
    return [*lines, "ready" if not problems else "not ready: " + "; ".join(problems)]


def _version(host: Host) -> list[str]:
    identity = host.drone.identity
    return [
        f"anafi-mav {__version__}, system {host.sysid}",
        f"{identity.model.title} {identity.serial}, firmware {identity.firmware}, hardware {identity.hardware}",
    ]


def _counters(host: Host) -> list[str]:
    return [f"{name} {count}" for name, count in sorted(host.drone.counters.items())]


def _features(host: Host) -> list[str]:
    return [f"{feature.value}: {support.value}" for feature, support in host.drone.features.items()]


def _help(host: Host) -> list[str]:
    return [f"{name:<10}{what}" for name, (what, _) in COMMANDS.items()]


COMMANDS: Mapping[str, tuple[str, Callable[[Host], list[str]]]] = {
    "help": ("this list", _help),
    "version": ("gateway and drone", _version),
    "status": ("how the drone is", _status),
    "features": ("what the drone has", _features),
    "counters": ("what was counted on the link to the drone", _counters),
}


def answer(host: Host, line: str) -> str:
    """Return the shell's answer to a line."""
    word = line.strip().lower()
    if not word:
        return PROMPT
    command = COMMANDS.get(word)
    lines = [f"no such command: {word[:PIECE]}; try help"] if command is None else command[1](host)
    return "\n".join([*lines, PROMPT])


class ShellService(Service):
    """The shell of one system, for any number of clients."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._begun: dict[Hashable, bytes] = {}
        """Text of each client since its last newline."""

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_SERIAL_CONTROL: self._receive}

    def link_down(self) -> None:
        self._begun.clear()

    def _receive(self, inbound: Inbound) -> None:
        message = inbound.message
        if message.device != dialect.SERIAL_CONTROL_DEV_SHELL or message.flags & dialect.SERIAL_CONTROL_FLAG_REPLY:
            return
        client = inbound.client
        typed = self._begun.pop(client, b"") + bytes(message.data[: min(message.count, PIECE)])
        *lines, rest = typed.replace(b"\r", b"\n").split(b"\n")
        if rest:
            self._begun[client] = rest[-LONGEST_LINE:]
            if len(self._begun) > MAX_CLIENTS:
                del self._begun[next(iter(self._begun))]
        for line in lines:
            self._say(inbound, answer(self.host, line.decode(errors="replace")))

    def _say(self, inbound: Inbound, text: str) -> None:
        data = text.encode()
        for start in range(0, len(data), PIECE):
            piece = data[start : start + PIECE]
            self.host.send(
                dialect.MAVLink_serial_control_message(
                    dialect.SERIAL_CONTROL_DEV_SHELL,
                    dialect.SERIAL_CONTROL_FLAG_REPLY,
                    0,
                    0,
                    len(piece),
                    list(piece.ljust(PIECE, b"\0")),
                    inbound.sysid,
                    inbound.compid,
                ),
                inbound.channel,
            )
