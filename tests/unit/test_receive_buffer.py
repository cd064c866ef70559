"""The size of socket reads."""

from __future__ import annotations

import asyncio
import socket

from anafi_mav.receive_buffer import SIZE, limit_reads


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
