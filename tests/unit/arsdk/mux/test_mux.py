"""Parrot's mux: bytes by hand, streams cut anywhere, noise, and a session over it."""

from __future__ import annotations

import asyncio
import contextlib
import random
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.listener import Listener, MessageListener

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link.handshake import DeviceInfo
from anafi_mav.arsdk.link.session import OnMessage
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.arsdk.mux import mux, mux_link, mux_proxy
from anafi_mav.arsdk.mux.mux import (
    Decoder,
    MuxControl,
    MuxFrame,
    decode_control,
    decode_pomp,
    encode_frame,
    encode_pomp,
)
from anafi_mav.errors import LinkLost, LocalProtocolError

INFO = DeviceInfo(0x091D, "PI040443AA9K754503", 0, "SC4")


def test_frames_by_hand() -> None:
    # libmux: magic, channel, size with the header of 12 bytes.
    data = bytes.fromhex("4d555821 01000000 0f000000 616263")
    assert encode_frame(1, b"abc") == data
    assert Decoder().feed(data) == [MuxFrame(1, b"abc")]


def test_the_handshake_by_hand() -> None:
    frame = mux.encode_control(mux.HANDSHAKE, 0, 1, mux.VERSION)
    words = "7f000000 00000000 01000000 02000000 00000000 00000000 00000000 00000000"
    assert frame == bytes.fromhex("4d555821 00000000 2c000000 " + words)
    assert decode_control(frame[12:]) == MuxControl(127, 0, (1, 2, 0, 0, 0, 0))
    assert decode_control(frame[12:-1]) is None


def test_pomp_by_hand() -> None:
    # Strings: 09, their length with the NUL as varint; u32: 06 varint; i32: 05 zigzag varint (libpomp pomp_encoder.c).
    # 12 bytes of header, 6 of "SC4", 3 of 0x091d = 0x12 * 128 + 0x1d, 4 of "P".
    data = bytes.fromhex("504f4d50 02000000 19000000 09 04 53433400 06 9d12 09 02 5000")
    assert encode_pomp(2, [("%s", "SC4"), ("%u", 0x091D), ("%s", "P")]) == data
    assert decode_pomp(data) == (2, ["SC4", 0x091D, "P"])
    assert encode_pomp(1) == bytes.fromhex("504f4d50 01000000 0c000000")
    assert encode_pomp(2, [("%d", -1)])[12:] == bytes.fromhex("05 01")
    assert decode_pomp(encode_pomp(2, [("%d", -1), ("%d", 1), ("%d", -(1 << 31))])) == (2, [-1, 1, -(1 << 31)])


@pytest.mark.parametrize(
    "argument", [("%u", -1), ("%u", 1 << 32), ("%s", "a\0b"), ("%s", "a" * 70000), ("%x", 1), ("%s", 1)]
)
def test_our_own_wrong_arguments_raise(argument: tuple[str, mux.Argument]) -> None:
    with pytest.raises(LocalProtocolError):
        encode_pomp(1, [argument])


FRAMES = st.lists(st.builds(MuxFrame, st.integers(0, 0xFFFFFFFF), st.binary(max_size=80)), max_size=8)


@given(frames=FRAMES, cuts=st.lists(st.integers(0, 2000), max_size=12), noise=st.binary(max_size=10))
def test_mux_stream_is_decoded_in_any_split(frames: list[MuxFrame], cuts: list[int], noise: bytes) -> None:
    noise = noise.replace(b"M", b"m")
    data = noise + b"".join(encode_frame(*frame) for frame in frames)
    decoder, found, position = Decoder(), [], 0
    for cut in [*sorted(min(cut, len(data)) for cut in cuts), len(data)]:
        found += decoder.feed(data[position:cut])
        position = cut
    assert found == frames
    assert decoder.skipped == (len(noise) if frames else max(0, len(noise) - 3))


def test_noise_neither_raises_nor_piles_up() -> None:
    rng = random.Random(1)
    decoder = Decoder()
    whole = encode_frame(1, rng.randbytes(50)) + mux.encode_control(mux.HANDSHAKE) + encode_pomp(2, [("%s", "SC4")])
    tracemalloc.start()
    try:
        for number in range(30_000):
            data = bytearray(whole)
            for _ in range(rng.randrange(4)):
                data[rng.randrange(len(data))] = rng.randrange(256)
            for frame in decoder.feed(bytes(data[: rng.randrange(len(data))])):
                decode_control(frame.payload)
                decode_pomp(frame.payload)
            decode_pomp(bytes(data[44 + 62 :]))
            if number == 3000:
                base = tracemalloc.get_traced_memory()[0]
        # A frame that was begun may be kept, not more.
        assert tracemalloc.get_traced_memory()[0] - base < 2 * mux.MAX_FRAME
    finally:
        tracemalloc.stop()


# -- sessions


class Device:
    """A device behind the mux that answers AllStates and keeps what it hears."""

    def __init__(self) -> None:
        self.heard: list[Message | UnknownMessage] = []
        self.sessions: list[object] = []

    def on_session(self, session: mux_link.DeviceSession) -> OnMessage:
        self.sessions.append(session)

        def receive(message: Message | UnknownMessage, now: float) -> None:
            self.heard.append(message)
            if isinstance(message, common.AllStates):
                session.send(ardrone3.AltitudeChanged(1.5))
                session.send(common.AllStatesChanged())

        return receive


@pytest.mark.parametrize("version", [1, 2, 3])
async def test_a_session_over_the_mux(version: int) -> None:
    device, ear = Device(), MessageListener()
    server = await mux_link.MuxServer.start(
        "127.0.0.1", port=0, info=INFO, versions=(1, version), on_session=device.on_session
    )
    try:
        session = await mux_link.connect("127.0.0.1", port=server.discovery_port, on_message=ear)
        assert session.device == DeviceInfo(INFO.model_id, INFO.serial, server.discovery_port, INFO.name)
        assert session.version == version
        session.send(common.AllStates())
        await ear.until(lambda: common.AllStatesChanged() in ear.heard)
        assert ardrone3.AltitudeChanged(1.5) in ear.heard
        assert device.heard == [common.AllStates()]
        # A new connection ends the one before.
        second = await mux_link.connect("127.0.0.1", port=server.discovery_port, on_message=lambda message, now: None)
        assert await asyncio.wait_for(asyncio.shield(session.lost), 3.0) == "the Skycontroller closed the connection"
        await session.close()
        await second.close()
        assert server.session is not None
        await asyncio.wait_for(asyncio.shield(server.session.lost), 5.0)
    finally:
        await server.close()


async def test_discovery_through_the_mux_disturbs_no_connection() -> None:
    device, ear = Device(), MessageListener()
    server = await mux_link.MuxServer.start("127.0.0.1", port=0, info=INFO, on_session=device.on_session)
    port = server.discovery_port
    try:
        session = await mux_link.connect("127.0.0.1", port=port, on_message=ear)
        assert await mux_link.look("127.0.0.1", port=port) == DeviceInfo(INFO.model_id, INFO.serial, port, INFO.name)
        session.send(common.AllStates())
        await ear.until(lambda: common.AllStatesChanged() in ear.heard)
        assert len(device.sessions) == 1
        await session.close()
    finally:
        await server.close()
    with pytest.raises(LinkLost, match=f"cannot connect to 127.0.0.1:{port}"):
        await mux_link.look("127.0.0.1", port=port)


async def test_silence_is_noticed_on_the_mux_too() -> None:
    device = Device()
    server = await mux_link.MuxServer.start("127.0.0.1", port=0, info=INFO, on_session=device.on_session)
    try:
        session = await mux_link.connect(
            "127.0.0.1",
            port=server.discovery_port,
            on_message=lambda message, now: None,
            silence_limit=0.6,
            ping_after=0.2,
        )
        server.mute = True
        assert "nothing received" in await asyncio.wait_for(asyncio.shield(session.lost), 3.0)
        await session.close()
    finally:
        await server.close()


async def test_versions_without_a_common_one_are_refused() -> None:
    device = Device()
    server = await mux_link.MuxServer.start(
        "127.0.0.1", port=0, info=INFO, versions=(3, 3), on_session=device.on_session
    )
    try:
        with pytest.raises(LinkLost, match="refused the connection"):
            await mux_link.connect(
                "127.0.0.1", port=server.discovery_port, versions=(1, 2), on_message=lambda message, now: None
            )
        assert device.sessions == []
    finally:
        await server.close()


async def test_garbage_at_the_port_ends_nothing() -> None:
    device = Device()
    server = await mux_link.MuxServer.start("127.0.0.1", port=0, info=INFO, on_session=device.on_session)
    rng = random.Random(3)
    try:
        for _ in range(20):
            _, writer = await asyncio.open_connection("127.0.0.1", server.discovery_port)
            for channel in (0, 1, 2, 3, 9):
                writer.write(encode_frame(channel, rng.randbytes(rng.randrange(60))))
            for _ in range(10):
                words = [rng.choice([0, 1, 1024, rng.getrandbits(32)]) for _ in range(7)]
                writer.write(mux.encode_control(rng.randrange(20), *words, payload=rng.randbytes(rng.randrange(9))))
            writer.write(encode_frame(1024, b"x") + encode_frame(0x80000400, b"y"))
            texts = [("%s", rng.choice(["", "{", "[]", '{"proto_v_min": "x"}', "[" * 3000])) for _ in range(4)]
            writer.write(encode_frame(mux.BACKEND, encode_pomp(mux.CONN_REQ, texts)))
            await writer.drain()
            writer.close()
        session = await mux_link.connect("127.0.0.1", port=server.discovery_port, on_message=lambda message, now: None)
        await session.close()
    finally:
        await server.close()


# -- datagrams


class Echo(asyncio.DatagramProtocol):
    """What a Skycontroller's video server is to a socket: sends to the port it was given, hears who is aimed at it."""

    def __init__(self) -> None:
        self.ear: Listener[tuple[bytes, int]] = Listener()

    def connection_made(self, transport: asyncio.DatagramTransport) -> None:  # type: ignore[override]
        self.transport = transport
        self.port = transport.get_extra_info("sockname")[1]

    def datagram_received(self, data: bytes, address: tuple[str, int]) -> None:
        self.ear.hear((data, address[1]))


async def test_datagrams_over_the_mux() -> None:
    device = Device()
    ear: Listener[bytes] = Listener()
    server = await mux_link.MuxServer.start("127.0.0.1", port=0, info=INFO, on_session=device.on_session)
    loop = asyncio.get_running_loop()
    _, video = await loop.create_datagram_endpoint(Echo, local_addr=("127.0.0.1", 0))
    _, stranger = await loop.create_datagram_endpoint(Echo, local_addr=("127.0.0.2", 0))
    session = await mux_link.connect("127.0.0.1", port=server.discovery_port, on_message=lambda message, now: None)
    try:
        tunnel = await session.open_udp("skycontroller", ear.hear)
        assert 1024 <= tunnel.port <= 65535
        stranger.transport.sendto(b"not for us", ("127.0.0.1", tunnel.port))
        video.transport.sendto(b"frame", ("127.0.0.1", tunnel.port))
        await ear.until(lambda: bool(ear.heard))
        tunnel.send(b"nowhere yet")
        await tunnel.aim(video.port)
        tunnel.send(b"report")
        await video.ear.until(lambda: bool(video.ear.heard))
        assert video.ear.heard == [(b"report", tunnel.port)]
        assert ear.heard == [b"frame"]

        tunnel.close()
        tunnel.close()
        tunnel.send(b"too late")
        again = await session.open_udp("skycontroller", ear.hear)  # behind the closing, so that it is through
        video.transport.sendto(b"too late", ("127.0.0.1", tunnel.port))
        video.transport.sendto(b"second", ("127.0.0.1", again.port))
        await ear.until(lambda: len(ear.heard) > 1)
        assert ear.heard == [b"frame", b"second"]
        assert len(video.ear.heard) == 1
        with pytest.raises(LocalProtocolError):
            await again.aim(0)
        with pytest.raises(LinkLost, match="knows no moon"):
            await session.open_udp("moon", ear.hear)
    finally:
        await session.close()
        await server.close()
        video.transport.close()
        stranger.transport.close()
    assert again.closed
    with pytest.raises(LinkLost):
        await session.open_udp("skycontroller", ear.hear)


async def test_client_of_the_mux_that_does_not_read_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mux_proxy, "MAX_UNREAD", 1 << 20)
    disconnected = asyncio.Event()

    async def flood(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while not writer.is_closing():
                writer.write(bytes(1 << 16))
                await writer.drain()
        writer.close()
        disconnected.set()

    device = Device()
    server = await mux_link.MuxServer.start("127.0.0.1", port=0, info=INFO, on_session=device.on_session)
    web = await asyncio.start_server(flood, "127.0.0.1", 0)
    session = await mux_link.connect("127.0.0.1", port=server.discovery_port, on_message=lambda message, now: None)
    try:
        door = await session.open_tcp("drone", web.sockets[0].getsockname()[1])
        reader, writer = await asyncio.open_connection(*door)
        writer.transport.pause_reading()  # type: ignore[attr-defined]
        await asyncio.wait_for(disconnected.wait(), 5.0)
        writer.transport.resume_reading()  # type: ignore[attr-defined]
        read = 0
        with contextlib.suppress(ConnectionResetError):
            while data := await asyncio.wait_for(reader.read(1 << 20), 10.0):
                read += len(data)
        assert read < 1 << 24  # what the sockets hold, too
        writer.close()
        assert not session.lost.done()
        assert await session.open_tcp("drone", web.sockets[0].getsockname()[1]) == door
    finally:
        await session.close()
        await server.close()
        web.close()


async def test_connections_over_the_mux_end_with_the_mux() -> None:
    device = Device()
    server = await mux_link.MuxServer.start("127.0.0.1", port=0, info=INFO, on_session=device.on_session)
    web = await asyncio.start_server(lambda reader, writer: writer.close(), "127.0.0.1", 0)
    session = await mux_link.connect("127.0.0.1", port=server.discovery_port, on_message=lambda message, now: None)
    try:
        port = web.sockets[0].getsockname()[1]
        door = await session.open_tcp("drone", port)
        assert await session.open_tcp("drone", port) == door
        tunnel = await session.open_udp("skycontroller", lambda data: None)
        await server.close()
        await asyncio.wait_for(asyncio.shield(session.lost), 3.0)
        assert tunnel.closed
        with pytest.raises(ConnectionRefusedError):
            await asyncio.open_connection(*door)
    finally:
        await session.close()
        await server.close()
        web.close()
