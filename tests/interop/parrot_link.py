"""Parrot's libarsdk as a process: a controller's end of ARSDK links, over UDP.

``parrot_link.py VERSION ...`` makes one link of each protocol version. One JSON object per line on stdin:
``{"version": 3, "datagrams": ["hex", ...], "commands": [[acknowledged, "hex"], ...]}``: the datagrams arrive, then the
commands are sent. On stdout what this causes: ``{"commands": ["hex", ...], "datagrams": ["hex", ...]}``, received by
libarsdk and sent by it. An empty request waits for its timers: they send acknowledgements and repetitions, and in
versions 2 and 3 each frame behind one that was acknowledged.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import socket
import sys
from typing import Any

import olympe_deps as parrot

Pointer = ctypes.c_void_p
library = ctypes.CDLL("libarsdk.so")  # loaded with the import
LOOPBACK = "127.0.0.1"
NOACK, WITHACK = 2, 4
CONTROLLER_QUEUES = ((NOACK, 10), (WITHACK, 11))
ACK_OFFSET = 128
ACK_TIMEOUT = 5
"""ms; 150 in Parrot's programs."""
WAIT = 10
"""ms that libarsdk's loop waits at a time."""


class Config(ctypes.Structure):
    """arsdk_transport_net_cfg; the layouts here are those of libarsdk's headers."""

    _fields_ = (
        ("version", ctypes.c_uint32),
        ("address", ctypes.c_uint32),
        ("qos_mode", ctypes.c_int),
        ("stream_supported", ctypes.c_int),
        ("rx_port", ctypes.c_uint16),
        ("tx_port", ctypes.c_uint16),
    )


OnSocket = ctypes.CFUNCTYPE(None, Pointer, ctypes.c_int, ctypes.c_int, Pointer)
OnFrame = ctypes.CFUNCTYPE(None, Pointer, Pointer, Pointer, Pointer)
OnStatus = ctypes.CFUNCTYPE(None, Pointer, ctypes.c_int, Pointer)
OnDispose = ctypes.CFUNCTYPE(ctypes.c_int, Pointer, Pointer)


class SocketCallbacks(ctypes.Structure):
    """arsdk_transport_net_cbs."""

    _fields_ = (("userdata", Pointer), ("on_socket", OnSocket))


class FrameCallbacks(ctypes.Structure):
    """arsdk_transport_cbs."""

    _fields_ = (("userdata", Pointer), ("on_frame", OnFrame), ("on_status", OnStatus), ("on_log", Pointer))


class InternalCallbacks(ctypes.Structure):
    """arsdk_cmd_itf_internal_cbs."""

    _fields_ = (("userdata", Pointer), ("on_dispose", OnDispose))


class Queue(ctypes.Structure):
    """arsdk_cmd_queue_info."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("id", ctypes.c_uint8),
        ("max_tx_rate_ms", ctypes.c_int),
        ("ack_timeout_ms", ctypes.c_int),
        ("overwrite", ctypes.c_int),
        ("max_retries", ctypes.c_int32),
    )


def check(result: int) -> None:
    if result < 0:
        raise OSError(-result, "libarsdk")


class Link:
    """One end of a link, and the socket of its peer."""

    def __init__(self, version: int) -> None:
        self.received: list[str] = []
        self._is_received = False
        self.loop = parrot.pomp_loop_new()
        self.peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.peer.bind((LOOPBACK, 0))
        self.peer.setblocking(False)
        address = int.from_bytes(socket.inet_aton(LOOPBACK), "big")
        config = Config(version, address, 0, 0, 0, self.peer.getsockname()[1])
        net, self.interface = Pointer(), Pointer()
        self._held: list[Any] = [
            SocketCallbacks(None, OnSocket(lambda *_: None)),
            FrameCallbacks(None, OnFrame(self._frame), OnStatus(lambda *_: None), None),
            InternalCallbacks(None, OnDispose(lambda *_: 0)),
            parrot.struct_arsdk_cmd_itf_cbs.bind({"recv_cmd": self._command}),
        ]
        sockets, frames, internal, commands = map(ctypes.byref, self._held)
        loop = ctypes.cast(self.loop, Pointer)
        check(library.arsdk_transport_net_new(loop, ctypes.byref(config), sockets, ctypes.byref(net)))
        library.arsdk_transport_net_get_parent.restype = Pointer
        transport = Pointer(library.arsdk_transport_net_get_parent(net))
        check(library.arsdk_transport_net_get_cfg(net, ctypes.byref(config)))
        self.address = (LOOPBACK, config.rx_port)
        queues = (Queue * 2)(*(Queue(type, id, 0, ACK_TIMEOUT, 0, -1) for type, id in CONTROLLER_QUEUES))
        check(
            library.arsdk_cmd_itf_new(
                transport, commands, internal, queues, len(queues), ACK_OFFSET, ctypes.byref(self.interface)
            )
        )
        check(library.arsdk_transport_start(transport, frames))

    def _frame(self, transport: int, header: int, payload: int, userdata: int) -> None:
        self._is_received = True
        library.arsdk_cmd_itf_recv_data(self.interface, Pointer(header), Pointer(payload))

    def _command(self, interface: Any, command: Any, userdata: Any) -> None:
        data, size = ctypes.POINTER(None)(), ctypes.c_uint64()
        check(parrot.pomp_buffer_get_cdata(command.contents.buf, ctypes.byref(data), ctypes.byref(size), None))
        self.received.append(ctypes.string_at(data, size.value).hex())

    def receive(self, datagram: bytes) -> None:
        self.peer.sendto(datagram, self.address)
        self._is_received = False
        while not self._is_received:  # a timer may be due first
            parrot.pomp_loop_wait_and_process(self.loop, WAIT)

    def send(self, acknowledged: bool, command: bytes) -> None:
        buffer = parrot.pomp_buffer_new_with_data(ctypes.cast(ctypes.c_char_p(command), Pointer), len(command))
        kind = parrot.ARSDK_CMD_BUFFER_TYPE_ACK if acknowledged else parrot.ARSDK_CMD_BUFFER_TYPE_NON_ACK
        ids = command[0], command[1], int.from_bytes(command[2:4], "little")
        filled = parrot.struct_arsdk_cmd(*ids, 0, buffer, None, kind)
        check(library.arsdk_cmd_itf_send(self.interface, ctypes.byref(filled), None, None))
        parrot.pomp_buffer_unref(buffer)

    def taken(self) -> dict[str, list[str]]:
        """Return and forget what was received and sent."""
        commands, self.received = self.received, []
        datagrams = []
        with contextlib.suppress(BlockingIOError):
            while True:
                datagrams.append(self.peer.recv(1 << 16).hex())
        return {"commands": commands, "datagrams": datagrams}


def main(*versions: str) -> None:
    links = {int(version): Link(int(version)) for version in versions}
    for line in sys.stdin:
        request = json.loads(line)
        link = links[request["version"]]
        for datagram in request["datagrams"]:
            link.receive(bytes.fromhex(datagram))
        for acknowledged, command in request["commands"]:
            link.send(acknowledged, bytes.fromhex(command))
        if not request["datagrams"] and not request["commands"]:
            parrot.pomp_loop_wait_and_process(link.loop, WAIT)
        sys.stdout.write(json.dumps(link.taken()) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
