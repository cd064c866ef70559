"""The vehicle's files: MAVLink FTP, and the messages with the addresses of its metadata.

The protocol is `ftp`; the files belong to the services that make them, except general.json, which lists them.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Hashable, Iterator, Mapping, Sequence
from functools import partial

from anafi_mav.clock import NEVER
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import char_field
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services import component_metadata
from anafi_mav.services.capabilities import capability_bits
from anafi_mav.services.checksum import crc32
from anafi_mav.services.commands import Command
from anafi_mav.services.component_metadata import COMPRESSED, GENERAL
from anafi_mav.services.files import FileError, FileRefused, FileTree, Folder, Query, ServedFile, absolute
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.ftp.ftp import FtpServer, Wait, protected
from anafi_mav.services.paced_sender import PacedSender
from anafi_mav.services.service import Host, MessageHandler, Request, Service, channel_of
from anafi_mav.vehicle.base.severity import Severity

logger = logging.getLogger(__name__)

WAIT_TIMEOUT = 60.0
"""s that a request waits for a file. The drone's web server ends a silent read after 10 s, not one that drips."""

CHECKSUM_TIMEOUT = 1800.0
"""s that a checksum waits for a whole file: 4 GiB at 2.4 MB/s."""

BURST_PACE = 12_000.0
"""Parts of a burst in a second where the line is fast: 2.8 MB/s."""


class FtpService(Service):
    """Serves the files of all services of the system; those of plans can be written."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._server = FtpServer(channel_of)
        self._sender = PacedSender(host)
        self._files: Mapping[str, ServedFile] = {}
        self._folders: Mapping[str, Folder] = {}
        self._trees: dict[str, FileTree] = {}
        """By name of the flavour; made for its first client."""
        self._made: dict[tuple[str, str], bytes] = {}
        """Metadata by flavour and path: the same for as long as the drone is connected."""

    def take_tables(self, files: Mapping[str, ServedFile], folders: Mapping[str, Folder]) -> None:
        """Take the files and folders of all services, by path."""
        self._files, self._folders = files, folders

    def _tree(self, flavour: Flavour) -> FileTree:
        """Return the files as clients of a flavour see them."""
        tree = self._trees.get(flavour.name)
        if tree is None:
            files = self._files
            makers = {
                path: partial(self._content, path, flavour)
                for path, file in files.items()
                if flavour.packed_files or not file.packed
            }
            lasting = [path for path, file in files.items() if file.metadata is not None]
            makers |= {path + COMPRESSED: partial(self._content, path + COMPRESSED, flavour) for path in lasting}
            makers |= {path: partial(self._general, path, flavour) for path in (GENERAL, GENERAL + COMPRESSED)}
            tree = self._trees[flavour.name] = FileTree(makers, self._folders)
        return tree

    def capabilities(self) -> int:
        return dialect.MAV_PROTOCOL_CAPABILITY_FTP

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: self._receive}

    def denials(self) -> Mapping[int, MessageHandler]:
        def deny(inbound: Inbound) -> None:
            answer = protected(bytes(inbound.message.payload))
            if answer is not None:
                self.host.send(_message(answer, inbound), inbound.channel)

        return {dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: deny}

    def requests(self) -> Mapping[int, Request]:
        return {
            dialect.MAVLINK_MSG_ID_COMPONENT_METADATA: self._component_metadata,
            dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION: self._component_information,
            dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC: self._component_basic,
        }

    def link_up(self) -> None:
        self._made.clear()

    def link_down(self) -> None:
        self._sender.clear()
        self._server.forget(lambda who: True)  # after a reboot the drone's files may be others

    def heartbeat(self, inbound: Inbound) -> None:
        self._server.heartbeat(inbound.client, inbound.now)

    def tick(self, now: float) -> float:
        self._server.expire(now)
        return NEVER

    def channel_closed(self, channel: Channel) -> None:
        self._sender.closed(channel)
        self._server.forget(lambda who: isinstance(who, tuple) and who[0] is channel)

    # FTP.

    def _receive(self, inbound: Inbound) -> None:
        who = inbound.client
        files = _ClientFiles(self._tree(flavour_of(inbound.channel)), self._files, inbound, self.host)
        answer = self._server.receive(who, bytes(inbound.message.payload), files, inbound.now)
        if isinstance(answer, Wait):
            answer.abandon = self.host.spawn(self._wait(answer, inbound)).cancel
        elif answer is not None:
            self._send([answer], who, inbound)

    async def _wait(self, wait: Wait, inbound: Inbound) -> None:
        """Answer when the file that the request waits for has arrived."""
        value: object
        try:
            value = await asyncio.wait_for(wait.value, CHECKSUM_TIMEOUT if wait.is_checksum else WAIT_TIMEOUT)
        except asyncio.TimeoutError:
            logger.warning("%s: a file of the drone does not arrive", self.host.drone.name)
            value = FileRefused(FileError.FAIL)
        except FileRefused as refusal:
            value = refusal
        except Exception:
            logger.exception("%s: a file cannot be read", self.host.drone.name)
            value = FileRefused(FileError.FAIL)
        self._send(self._server.finish(wait, value), wait.who, inbound)

    def _send(self, answers: Sequence[bytes], who: Hashable, inbound: Inbound) -> None:
        for answer in answers:
            self.host.send(_message(answer, inbound), inbound.channel)
        if self._server.bursting(who):
            self._sender.start(inbound.channel, who, self._burst(who, inbound), BURST_PACE)

    def _burst(self, who: Hashable, inbound: Inbound) -> Iterator[dialect.MAVLink_message]:
        """Yield the remaining messages of a burst."""
        while (part := self._server.burst(who, self.host.clock.monotonic())) is not None:
            yield _message(part, inbound)

    # Metadata.

    def _content(self, path: str, flavour: Flavour, query: Query) -> bytes | None:
        """Return a file's content; metadata are made once."""
        file = self._files.get(path)
        if file is None:  # the compressed form of metadata
            return self._once(path, flavour, lambda: _compressed(self._content(path[: -len(COMPRESSED)], flavour, {})))
        if file.metadata is None:
            return file.make(flavour, query)
        return self._once(path, flavour, lambda: file.make(flavour, {}))

    def _general(self, path: str, flavour: Flavour, query: Query) -> bytes | None:
        if path.endswith(COMPRESSED):
            return self._once(path, flavour, lambda: _compressed(self._general(GENERAL, flavour, {})))

        def make() -> bytes:
            others = {}
            for plain, file in self._files.items():
                content = self._content(plain + COMPRESSED, flavour, {}) if file.metadata is not None else None
                if content is not None and file.metadata is not None:
                    others[plain + COMPRESSED] = (file.metadata, content)
            return component_metadata.to_json(component_metadata.general_file(self.host.drone.identity, others))

        return self._once(path, flavour, make)

    def _once(self, path: str, flavour: Flavour, make: Callable[[], bytes | None]) -> bytes | None:
        key = (flavour.name, path)
        if key not in self._made:
            content = make()
            if content is None:
                return None
            self._made[key] = content
        return self._made[key]

    def _where(self, inbound: Inbound) -> tuple[bytes, int]:
        """Return URI and CRC of the general metadata file."""
        content = self._general(GENERAL + COMPRESSED, flavour_of(inbound.channel), {})
        assert content is not None
        return component_metadata.uri(GENERAL + COMPRESSED).encode(), crc32(content)

    def _component_metadata(self, inbound: Inbound, command: Command) -> dialect.MAVLink_message:
        uri, crc = self._where(inbound)
        return dialect.MAVLink_component_metadata_message(self.host.times().boot_ms, crc, uri)

    def _component_information(self, inbound: Inbound, command: Command) -> dialect.MAVLink_message:
        """Return the predecessor of that message, for older clients."""
        uri, crc = self._where(inbound)
        return dialect.MAVLink_component_information_message(self.host.times().boot_ms, crc, uri, 0, b"")

    def _component_basic(self, inbound: Inbound, command: Command) -> dialect.MAVLink_message:
        """Return COMPONENT_INFORMATION_BASIC of the autopilot, which names the drone's maker."""
        identity = self.host.drone.identity
        return dialect.MAVLink_component_information_basic_message(
            self.host.times().boot_ms,
            capability_bits(self.host.capabilities, flavour_of(inbound.channel)),
            0,
            b"Parrot",
            identity.model.title.encode()[:31],
            char_field(identity.firmware, 23),
            char_field(identity.hardware, 23),
            char_field(identity.serial, 31),
        )


class _ClientFiles:
    """The files of one client's flavour, and the client, for what it writes."""

    def __init__(self, tree: FileTree, files: Mapping[str, ServedFile], inbound: Inbound, host: Host) -> None:
        self.open = tree.open
        self.list = tree.list
        self.checksum = tree.checksum
        self._tree = tree
        self._files = files
        self._inbound = inbound
        self._host = host

    def remove(self, path: str) -> Awaitable[None] | None:
        return self._tree.remove(path, self._may_change)

    def _may_change(self) -> bool:
        return self._host.change_objection(self._inbound) is None

    def room(self, path: str) -> int | None:
        file = self._writable(path)
        return None if file is None else file.room

    def write(self, path: str, content: bytes) -> bool | Awaitable[bool]:
        file = self._writable(path)
        if file is None or file.write is None or not self._may_change():
            return False
        return file.write(self._inbound, content)

    def refused(self, refusal: FileRefused) -> None:
        if refusal.text is not None:
            self._host.text(Severity.WARNING, refusal.text, self._inbound.channel)

    def _writable(self, path: str) -> ServedFile | None:
        file = self._files.get(absolute(path) or "") if self._tree.has(path) else None
        return None if file is None or file.write is None else file


def _compressed(content: bytes | None) -> bytes | None:
    return None if content is None else component_metadata.compress(content)


def _message(payload: bytes, inbound: Inbound) -> dialect.MAVLink_message:
    """Return a FILE_TRANSFER_PROTOCOL to the sender of the request."""
    return dialect.MAVLink_file_transfer_protocol_message(0, inbound.sysid, inbound.compid, payload)
