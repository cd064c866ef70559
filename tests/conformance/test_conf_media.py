"""Items 113 and 115 on component 100: the drone's photos and videos over MAVLink FTP."""

from __future__ import annotations

import asyncio
import struct
import zlib

import pytest
from support.flavours import both
from support.ftp import (
    ACK,
    CRC,
    EOF,
    FAIL,
    LIST,
    LIST_TIMED,
    NO_SESSION,
    NOT_FOUND,
    OPEN,
    PROTECTED,
    READ,
    REMOVE,
    RESET,
    SESSIONS_FULL,
    Ftp,
    taken_apart,
)
from support.media import DAY, TIME, add_photo, add_video
from support.world import World, world

from anafi_mav.arsdk.messages.mediastore import MediastoreState
from anafi_mav.drone.payload.camera_enums import CameraMode
from anafi_mav.drone.payload.media_index import UNHEARD
from anafi_mav.services.ftp.ftp import MAX_SESSIONS
from anafi_mav.sim.world.quirks import Quirk

CAMERA = 100
VIDEO = 1_500_000


def camera(w: World) -> Ftp:
    return Ftp(w.client, component=CAMERA)


@both
@pytest.mark.parametrize("model", ["4k", "thermal", "usa", "ai"])
async def test_conf_113_media_is_listed_read_and_removed(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model, web=True) as w:
        photo, video = add_photo(w.drone), add_video(w.drone, VIDEO)
        later = add_photo(w.drone, "20261122T000000+0000")
        ftp = camera(w)
        assert {"Dmedia", "Dthumb"} <= {*await ftp.names("/")}
        assert await ftp.names("/media") == [f"D{DAY}", "D2026-11-22"]
        assert await ftp.names(f"/media/{DAY}") == [f"F{photo.id}\t{photo.size}", f"F{video.id}\t{video.size}"]
        timed = await ftp.ask(LIST_TIMED, f"/media/{DAY}".encode())
        assert timed.data.startswith(f"F{photo.id}\t{photo.size}\t{TIME}\0".encode())

        path = f"/media/{DAY}/{photo.id}"
        assert await ftp.download(path) == photo.content()
        assert await ftp.download(f"/thumb/{DAY}/{photo.id}.jpg") == photo.thumbnail()
        for name, file in ((path, photo), (f"/media/{DAY}/{video.id}", video)):
            (crc,) = struct.unpack("<I", (await ftp.ask(CRC, name.encode())).data)
            assert crc == zlib.crc32(file.content(), 0xFFFFFFFF) ^ 0xFFFFFFFF

        assert (await ftp.ask(REMOVE, path.encode())).opcode == ACK
        assert w.drone.firmware.payload.media.resource(photo.id) is None
        assert await ftp.names(f"/media/{DAY}") == [f"F{video.id}\t{video.size}"]
        assert (await ftp.ask(OPEN, path.encode())).error == NOT_FOUND
        assert await ftp.names("/media/2026-11-22") == [f"F{later.id}\t{later.size}"]
        # The autopilot's files are as they were.
        assert (await Ftp(w.client).ask(LIST, b"/media")).error == NOT_FOUND


@pytest.mark.parametrize("quirks", [(), (Quirk.NO_HTTP_RANGE,)])
async def test_conf_113_media_is_read_in_any_sequence(quirks: tuple[Quirk, ...]) -> None:
    async with world(web=True) as w:
        w.drone.faults.quirks = frozenset(quirks)
        video, ftp = add_video(w.drone, VIDEO), camera(w)
        content = video.content()
        await ftp.ask(OPEN, f"/media/{DAY}/{video.id}".encode())
        for offset in (VIDEO // 2, 5, video.size - 9, VIDEO // 3):
            part = await ftp.ask(READ, size=239, offset=offset)
            assert part.data == content[offset : offset + 239]
        for offset in (video.size, 2**32 - 1):
            assert (await ftp.ask(READ, size=239, offset=offset)).error == EOF


async def test_conf_113_late_drone_is_answered_late_and_once() -> None:
    async with world(web=True) as w:
        photo, ftp = add_photo(w.drone), camera(w)
        assert w.drone.web is not None
        w.drone.web.mute = True
        mark = w.client.mark()
        for _ in range(4):
            ftp.send(LIST, b"/media", seq=8)
            await asyncio.sleep(0.5)
        assert w.client.since(mark, "FILE_TRANSFER_PROTOCOL") == []
        w.drone.web.mute = False
        await w.client.wait("FILE_TRANSFER_PROTOCOL", lambda m: taken_apart(m).seq == 9, since=mark)
        assert (await ftp.ask(LIST, b"/media", seq=10)).opcode == ACK
        answers = [taken_apart(m).seq for _, m in w.client.since(mark, "FILE_TRANSFER_PROTOCOL")]
        assert answers == [9, 11]
        assert await ftp.download(f"/media/{DAY}/{photo.id}") == photo.content()


async def test_conf_113_media_paths_lead_nowhere_else() -> None:
    async with world(web=True) as w:
        photo, ftp = add_photo(w.drone), camera(w)
        for path in (
            "/media/../media",
            f"/media/{DAY}/../../etc/passwd",
            "/media//etc/passwd",
            "/media/nothing",
            f"/media/{DAY}/{photo.id}.JPG",
            f"/thumb/{DAY}/{photo.id}",
            f"/media/2026-11-20/{photo.id}",
            "/media/api/v1/media/medias",
        ):
            for opcode in (OPEN, CRC, LIST, REMOVE):
                reply = await ftp.ask(opcode, path.encode())
                assert reply.error in (NOT_FOUND, PROTECTED), (path, opcode)
        for opcode in (6, 9, 10, 11, 12, 13):  # create, make and remove directory, open to write, truncate, rename
            assert (await ftp.ask(opcode, f"/media/{DAY}/{photo.id}".encode())).error == PROTECTED
        assert (await ftp.ask(REMOVE, f"/thumb/{DAY}/{photo.id}.jpg".encode())).error == PROTECTED
        assert await ftp.download(f"/media/{DAY}/{photo.id}") == photo.content()


async def test_conf_115_media_sessions_are_bounded_per_client() -> None:
    async with world(web=True, clients=2) as w:
        photo, ftp = add_photo(w.drone), camera(w)
        path = f"/media/{DAY}/{photo.id}".encode()
        for session in range(MAX_SESSIONS):
            assert (await ftp.ask(OPEN, path, session=session)).opcode == ACK
        assert (await ftp.ask(OPEN, path, session=99)).error == SESSIONS_FULL
        assert await Ftp(w.clients[1], component=CAMERA).download(path.decode()) == photo.content()
        assert (await ftp.ask(RESET)).opcode == ACK
        assert (await ftp.ask(OPEN, path, session=99)).opcode == ACK


async def test_media_is_not_deleted_while_recording() -> None:
    async with world(web=True) as w:
        photo, ftp = add_photo(w.drone), camera(w)
        path, drone = f"/media/{DAY}/{photo.id}", w.gateway.systems[0].drone
        await drone.camera.set_mode(CameraMode.RECORDING)
        await drone.camera.start_recording()
        mark = w.client.mark()
        assert (await ftp.ask(REMOVE, path.encode())).error == FAIL
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Delete refused: camera is recording", since=mark)
        assert await ftp.download(path) == photo.content()  # what is finished can be read
        await drone.camera.stop_recording()
        assert (await ftp.ask(REMOVE, path.encode())).opcode == ACK


async def test_media_that_is_not_indexed_is_refused_with_a_text() -> None:
    async with world(web=True) as w:
        store, ftp = w.drone.firmware.payload.media, camera(w)
        store.state = MediastoreState.INDEXING  # the drone has not reported it yet
        mark = w.client.mark()
        assert (await ftp.ask(LIST, b"/media")).error == FAIL
        await w.client.wait(
            "STATUSTEXT", lambda m: m.text == "Media unavailable: drone indexes its storage", since=mark
        )
        store.state = MediastoreState.INDEXED
        assert (await ftp.ask(LIST, b"/media")).error == EOF  # empty


@pytest.mark.parametrize(
    ("size", "text"),
    [
        (5_000_000_000, "File too large for FTP: use media download"),
        (0, "File size unknown: use media download"),
    ],
)
async def test_file_over_4_gib_or_unsized_is_listed_and_refused(size: int, text: str) -> None:
    async with world(web=True) as w:
        video, ftp = add_video(w.drone, size or 1000), camera(w)
        object.__setattr__(video, "size", size)
        assert await ftp.names(f"/media/{DAY}") == [f"F{video.id}\t{video.size}"]
        mark = w.client.mark()
        assert (await ftp.ask(OPEN, f"/media/{DAY}/{video.id}".encode())).error == FAIL
        await w.client.wait("STATUSTEXT", lambda m: m.text == text, since=mark)


async def test_listing_is_kept_until_the_drone_reports_a_change() -> None:
    async with world(web=True) as w:
        web, ftp = w.drone.web, camera(w)
        assert web is not None
        add_photo(w.drone)
        await asyncio.sleep(0.1)  # until its counters have been received
        for _ in range(3):
            assert len(await ftp.names(f"/media/{DAY}")) == 1
        assert web.served["medias"] == 1
        add_photo(w.drone)
        await asyncio.sleep(0.1)
        assert len(await ftp.names(f"/media/{DAY}")) == 2
        assert web.served["medias"] == 2
        # Without the websocket it is kept for a few seconds.
        await web.close_sockets()
        web.refuses_sockets = True
        await asyncio.sleep(UNHEARD)
        for _ in range(2):
            assert len(await ftp.names(f"/media/{DAY}")) == 2
        assert web.served["medias"] == 3
        await asyncio.sleep(UNHEARD)
        assert len(await ftp.names(f"/media/{DAY}")) == 2
        assert web.served["medias"] == 4


async def test_drone_that_reboots_during_a_download_ends_its_session() -> None:
    async with world(web=True) as w:
        video, ftp = add_video(w.drone, VIDEO), camera(w)
        path = f"/media/{DAY}/{video.id}"
        await ftp.ask(OPEN, path.encode())
        assert (await ftp.ask(READ, size=9)).opcode == ACK
        mark = w.client.mark()
        w.drone.faults.mute = True
        ftp.send(READ, size=9, offset=VIDEO // 2, seq=100)
        await w.client.silence("HEARTBEAT", 1.5)
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: True, since=w.client.mark(), timeout=20.0)
        assert (await ftp.ask(READ, size=9, seq=102)).error == NO_SESSION
        late = [taken_apart(m) for _, m in w.client.since(mark, "FILE_TRANSFER_PROTOCOL") if taken_apart(m).seq == 101]
        assert all(reply.data == video.content()[VIDEO // 2 :][:9] for reply in late)  # what was on the way
        assert await ftp.download(path) == video.content()


async def test_drone_without_a_web_server_has_no_media() -> None:
    async with world() as w:
        mark = w.client.mark()
        assert (await camera(w).ask(LIST, b"/media", timeout=15.0)).error == FAIL
        text = await w.client.wait("STATUSTEXT", since=mark)
        assert text.text.startswith("Media unavailable: ")


@pytest.mark.parametrize("opcode", [READ, CRC])
async def test_silent_web_server_fails_the_request(opcode: int) -> None:
    async with world(web=True) as w:
        video, ftp = add_video(w.drone, VIDEO), camera(w)
        path = f"/media/{DAY}/{video.id}".encode()
        await ftp.ask(OPEN, path)
        assert w.drone.web is not None
        w.drone.web.mute = True
        data = path if opcode == CRC else b""
        size = len(path) if opcode == CRC else 9
        assert (await ftp.ask(opcode, data, size=size, offset=0, timeout=30.0)).error == FAIL


async def test_request_for_a_file_that_never_arrives_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("anafi_mav.services.ftp.ftp_service.WAIT_TIMEOUT", 3.0)
    async with world(web=True) as w:
        add_photo(w.drone)
        assert w.drone.web is not None
        w.drone.web.mute = True
        assert (await camera(w).ask(LIST, b"/media", timeout=8.0)).error == FAIL
