"""The size of socket reads."""

from __future__ import annotations

import asyncio
import socket
from typing import Any

from anafi_mav.arsdk.link.interface import open_connection
from anafi_mav.drone.rest import Rest
from anafi_mav.receive_buffer import MOST, SIZE, OpenSocket, limit_reads, read_waiting


class _Peer(asyncio.DatagramProtocol):
    def __init__(self) -> None:
        self.received: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        limit_reads(transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self.received.set_result(data)


async def test_longest_datagram_fits_a_limited_read() -> None:
    transport, peer = await asyncio.get_running_loop().create_datagram_endpoint(_Peer, local_addr=("127.0.0.1", 0))
    data = bytes(range(256)) * 255 + bytes(227)  # 65 507 bytes, the most that UDP over IPv4 can carry
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(data, transport.get_extra_info("sockname"))
        assert await asyncio.wait_for(peer.received, 5.0) == data
    transport.close()
    assert len(data) < SIZE


async def test_read_of_a_stream_is_at_most_the_limit() -> None:
    ours, theirs = socket.socketpair()
    sizes: list[int] = []
    done = asyncio.get_running_loop().create_future()

    class Reader(asyncio.Protocol):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            limit_reads(transport)

        def data_received(self, data: bytes) -> None:
            sizes.append(len(data))
            if sum(sizes) == 3 * SIZE // 2 and not done.done():
                done.set_result(None)

    theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 * SIZE)
    theirs.sendall(bytes(3 * SIZE // 2))
    transport, _ = await asyncio.get_running_loop().create_connection(Reader, sock=ours)
    await asyncio.wait_for(done, 5.0)
    transport.close()
    theirs.close()
    assert max(sizes) <= SIZE


class _Reader(asyncio.DatagramProtocol):
    def __init__(self) -> None:
        self.batches: list[list[bytes]] = []
        """The datagrams of each iteration."""
        self.failures: list[Exception] = []
        self.ends_after = -1
        self.answer = b""

    def connection_made(self, transport: Any) -> None:
        self.transport = transport

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self.batches.append([data])
        if self.answer:
            self.transport.sendto(self.answer)
        read_waiting(self.transport, self._more, self.failures.append)

    def _more(self, data: bytes, address: tuple[str, int]) -> None:
        self.batches[-1].append(data)
        if len(self.batches[-1]) == self.ends_after:
            self.transport.close()


async def _sent(reader: _Reader, count: int) -> list[bytes]:
    """Send datagrams to the reader before the event loop runs again."""
    data = [bytes([number]) for number in range(count)]
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: reader, local_addr=("127.0.0.1", 0)
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for one in data:
            sender.sendto(one, transport.get_extra_info("sockname"))
    return data


async def test_waiting_datagrams_are_read_in_order_with_their_turns_limited() -> None:
    reader = _Reader()
    data = await _sent(reader, 2 * MOST + 1)
    while sum(map(len, reader.batches)) < len(data):  # noqa: ASYNC110
        await asyncio.sleep(0)
    assert reader.batches == [data[:MOST], data[MOST : 2 * MOST], data[2 * MOST :]]
    assert reader.failures == []
    reader.transport.close()


async def test_transport_that_is_closed_meanwhile_is_read_no_further() -> None:
    reader = _Reader()
    reader.ends_after = 3
    data = await _sent(reader, 10)
    while not reader.batches:  # noqa: ASYNC110
        await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert reader.batches == [data[:3]]


async def test_error_of_a_connected_socket_is_reported() -> None:
    """No program has the peer's port any more: the second read finds what became of the answer to the first."""
    reader = _Reader()
    reader.answer = b"refused"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: reader, remote_addr=peer.getsockname()
        )
        peer.sendto(b"last", transport.get_extra_info("sockname"))
    while not reader.batches:  # noqa: ASYNC110
        await asyncio.sleep(0)
    transport.close()
    assert [type(failure) for failure in reader.failures] == [ConnectionRefusedError]


class _NotingLoop(asyncio.SelectorEventLoop):
    """Notes the sockets that are to be read after those of clients."""

    def __init__(self) -> None:
        self.last: set[int] = set()
        """Their ports."""
        super().__init__()

    def read_after_clients(self, sock: OpenSocket) -> None:
        with socket.socket(fileno=socket.dup(sock.fileno())) as copy:
            self.last.add(copy.getsockname()[1])


def test_connections_to_a_drone_are_read_after_those_of_clients() -> None:
    """Those of ARSDK and RTSP, and of the drone's web server."""
    loop = _NotingLoop()
    peers: list[int] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        peers.append(writer.get_extra_info("peername")[1])
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\nConnection: close\r\n\r\n{}")
        writer.close()

    async def talk() -> None:
        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        reader, writer = await open_connection("127.0.0.1", port)
        writer.write(b"\r\n\r\n")
        await reader.read()
        writer.close()
        rest = Rest("127.0.0.1", port)
        assert await rest.json("GET", "/media") == {}
        await rest.close()
        server.close()

    try:
        loop.run_until_complete(talk())
        assert len(peers) == 2
        # That of the web server has no port of its own yet when it is made.
        assert loop.last == {peers[0], 0}
    finally:
        loop.close()
