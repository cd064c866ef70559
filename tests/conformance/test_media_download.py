"""Media over the gateway's web server, `anafi-mav media`, and the folder that photos are copied to after a landing."""

from __future__ import annotations

import argparse
import asyncio
import fcntl
import hashlib
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fabric import free_port
from support.ftp import Ftp
from support.media import DAY, SCENE, add_photo, add_video
from support.product import program
from support.world import World, world

from anafi_mav.access_token import AccessToken, load_token
from anafi_mav.arsdk.messages.mediastore import MediastoreState
from anafi_mav.cli import main
from anafi_mav.cli.media import add_arguments
from anafi_mav.cli.media_transfer import delete_media, download_media, list_media
from anafi_mav.config import MediaConfig
from anafi_mav.drone.payload.camera_enums import CameraMode
from anafi_mav.drone.payload.media import MediaClient
from anafi_mav.drone.payload.media_copy import copy
from anafi_mav.drone.payload.media_index import SORTED_IN_LOOP
from anafi_mav.drone.rest import Rest
from anafi_mav.errors import AnafiMavError, CommandRejected, ConfigError
from anafi_mav.sim.world.quirks import Quirk

VIDEO = 1_500_000


def gateway_of(w: World) -> str:
    assert w.gateway.web is not None
    return f"127.0.0.1:{w.gateway.web.port}"


def arguments(w: World, *words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args([*words, "--gateway", gateway_of(w)])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder for copies; the gateway keeps its state beside it."""
    return tmp_path / "copies"


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


async def ask(w: World, method: str, path: str, **headers: str) -> tuple[int, bytes, dict[str, str]]:
    url = f"http://{gateway_of(w)}/drone/1{path}"
    async with aiohttp.ClientSession() as session, session.request(method, url, headers=headers) as answer:
        return answer.status, await answer.read(), {name.lower(): value for name, value in answer.headers.items()}


async def client_of(w: World) -> MediaClient:
    host, port = gateway_of(w).split(":")
    return MediaClient(Rest(host, int(port), prefix="/drone/1"))


@pytest.mark.parametrize("quirks", [(), (Quirk.NO_HTTP_RANGE,)])
async def test_media_over_http_has_the_drones_paths_and_ranges(quirks: tuple[Quirk, ...]) -> None:
    async with world(web=True) as w:
        w.drone.faults.quirks = frozenset(quirks)
        photo, video = add_photo(w.drone), add_video(w.drone, VIDEO)
        content, path = video.content(), f"/data/media/{video.id}"
        status, body, _ = await ask(w, "GET", "/api/v1/media/medias")
        record = json.loads(body)
        assert (status, [media["resources"][0]["resource_id"] for media in record]) == (200, [photo.id, video.id])
        assert record[1]["resources"][0]["url"] == path
        assert (await ask(w, "GET", path))[:2] == (200, content)
        head = await ask(w, "HEAD", path)
        assert (head[0], head[1], head[2]["content-length"]) == (200, b"", str(len(content)))
        for wanted, expected, place in (
            ("bytes=700000-", content[700_000:], f"bytes 700000-{len(content) - 1}/{len(content)}"),
            ("bytes=9-12", content[9:13], f"bytes 9-12/{len(content)}"),
            ("bytes=-5", content[-5:], f"bytes {len(content) - 5}-{len(content) - 1}/{len(content)}"),
        ):
            status, body, headers = await ask(w, "GET", path, Range=wanted)
            assert (status, body == expected, headers["content-range"]) == (206, True, place)
        assert (await ask(w, "GET", path, Range="bytes=9999999999-"))[0] == 416
        assert (await ask(w, "GET", path, Range="bytes=-0"))[0] == 416
        assert (await ask(w, "GET", path, Range="lines=1-2"))[:2] == (200, content)
        assert (await ask(w, "GET", f"/data/thumb/{photo.id}"))[:2] == (200, photo.thumbnail())
        md5 = json.loads((await ask(w, "GET", f"/api/v1/media/md5/{video.id}"))[1])["md5"]
        assert md5 == hashlib.md5(content).hexdigest()
        for nothing in ("/data/media/..%2F..%2Fetc%2Fpasswd", "/data/media/nothing", "/api/v1/upload/flightplans"):
            assert (await ask(w, "GET", nothing))[0] == 404
        w.drone.firmware.payload.media.state = MediastoreState.INDEXING
        await w.gateway.systems[0].drone.media.close()  # forgets the list
        assert (await ask(w, "GET", "/api/v1/media/medias"))[0] == 541


async def test_file_over_4_gib_is_read_over_http() -> None:
    async with world(web=True) as w:
        video = add_video(w.drone, 5_000_000_000)
        for first in (2**32 - 3, video.size - 9):
            status, body, _ = await ask(w, "GET", f"/data/media/{video.id}", Range=f"bytes={first}-{first + 8}")
            assert (status, body) == (206, b"".join(video.parts(first, first + 9)))


async def test_file_without_a_byte_is_an_empty_answer(folder: Path) -> None:
    async with world(web=True) as w:
        photo = add_photo(w.drone)
        object.__setattr__(photo, "size", 0)
        for headers in ({}, {"Range": "bytes=5-"}):
            assert (await ask(w, "GET", f"/data/media/{photo.id}", **headers))[:2] == (200, b"")
        assert "content-length" not in (await ask(w, "HEAD", f"/data/media/{photo.id}"))[2]
        assert await download_media(arguments(w, "download", str(folder))) == 1
        assert names(folder) == []


async def test_long_list_over_http_follows_the_card() -> None:
    async with world(web=True) as w:
        ids = [add_photo(w.drone).id for _ in range(SORTED_IN_LOOP)]
        for query in ("", "?sort_order=newest"):
            listed = json.loads((await ask(w, "GET", f"/api/v1/media/medias{query}"))[1])
            assert [media["resources"][0]["resource_id"] for media in listed] == ids
            ids.reverse()
        w.drone.firmware.payload.media.remove(listed[0]["media_id"])
        await asyncio.sleep(0.1)  # until the gateway has received it
        assert len(json.loads((await ask(w, "GET", "/api/v1/media/medias"))[1])) == SORTED_IN_LOOP - 1


async def test_delete_over_http_is_for_programs_of_this_computer() -> None:
    async with world(web=True) as w:
        photo, drone = add_photo(w.drone), w.gateway.systems[0].drone
        path = f"/api/v1/media/resources/{photo.id}"
        proxied = {"X-Forwarded-For": "203.0.113.5"}  # by a reverse proxy on this computer
        for header in ({"Origin": f"http://{gateway_of(w)}"}, {"Sec-Fetch-Site": "same-origin"}, proxied):
            assert (await ask(w, "DELETE", path, **header))[0] == 403
        await drone.camera.set_mode(CameraMode.RECORDING)
        await drone.camera.start_recording()
        status, body, _ = await ask(w, "DELETE", path)
        assert (status, json.loads(body)) == (409, {"error": "a camera is recording"})
        assert w.drone.firmware.payload.media.resource(photo.id) is photo
        await drone.camera.stop_recording()
        assert (await ask(w, "DELETE", path))[0] == 200
        assert w.drone.firmware.payload.media.resource(photo.id) is None


async def test_listed_place_without_a_height_has_none(capsys: pytest.CaptureFixture[str]) -> None:
    """The drone reports 500 for each coordinate that it does not know."""
    async with world(web=True) as w:
        add_photo(w.drone, scene=replace(SCENE, altitude=500.0))
        assert await list_media(arguments(w, "list", "--json")) == 0
        (facts,) = json.loads(capsys.readouterr().out)
        assert facts["place"] == {"latitude": SCENE.latitude, "longitude": SCENE.longitude, "altitude_amsl": None}
        assert await list_media(arguments(w, "list")) == 0
        assert "500 m" not in capsys.readouterr().out


async def test_media_command_lists_downloads_and_deletes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    async with world(web=True) as w:
        photo, video = add_photo(w.drone), add_video(w.drone, VIDEO)
        other = add_photo(w.drone, "20261122T000000+0000")
        assert await list_media(arguments(w, "list", "--json")) == 0
        assert [one["file"] for one in json.loads(capsys.readouterr().out)] == [photo.id, video.id, other.id]
        assert await list_media(arguments(w, "list", DAY)) == 0
        assert capsys.readouterr().out.splitlines()[-1].startswith("2 files, 1.")

        assert await download_media(arguments(w, "download", str(folder))) == 0
        copies = [f"{DAY}/{photo.id}", f"{DAY}/{video.id}", f"2026-11-22/{other.id}"]
        assert names(folder) == sorted([*copies, *(f"{name}.json" for name in copies)])
        for name, file in zip(copies, (photo, video, other), strict=True):
            assert (folder / name).read_bytes() == file.content()
        assert capsys.readouterr().out.splitlines()[-1] == "3 files copied, 0 were there already"
        assert await download_media(arguments(w, "download", str(folder), video.id)) == 0
        assert capsys.readouterr().out == "0 files copied, 1 were there already\n"

        with pytest.raises(ConfigError, match="has no file or day nothing"):
            await download_media(arguments(w, "download", str(folder), "nothing"))
        with pytest.raises(ConfigError, match="--sysid: expected the system id of a connected drone"):
            await list_media(arguments(w, "list", "--sysid", "7"))
        with pytest.raises(ConfigError, match="--all"):
            await delete_media(arguments(w, "delete", "--yes"))
        assert await delete_media(arguments(w, "delete", "--yes", DAY)) == 0
        assert await Ftp(w.client, component=100).names("/media") == ["D2026-11-22"]


async def test_media_command_uses_the_token_of_this_computers_gateway(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    async with world(web=True) as w:
        assert w.gateway.web is not None
        add_photo(w.drone)
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
        w.gateway.web.token = load_token(tmp_path / "anafi-mav")
        await list_media(arguments(w, "list"))
        assert "1 files" in capsys.readouterr().out
        w.gateway.web.token = AccessToken("t" * 43)
        with pytest.raises(AnafiMavError, match="401"):
            await list_media(arguments(w, "list"))
        monkeypatch.setenv("ANAFI_MAV_TOKEN", "t" * 43)
        await list_media(arguments(w, "list"))
        assert "1 files" in capsys.readouterr().out


async def test_download_of_a_busy_file_fails_and_goes_on(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    async with world(web=True) as w:
        photo, good = add_photo(w.drone), add_photo(w.drone)
        part = folder / DAY / f"{photo.id}.{photo.md5()[:12]}.part"
        part.parent.mkdir(parents=True)
        with part.open("ab") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            assert await download_media(arguments(w, "download", str(folder))) == 1
        output = capsys.readouterr()
        assert f"{photo.id}: {part.name} is written by another download" in output.err
        assert output.out.splitlines()[-1] == "1 files copied, 0 were there already, 1 failed"
        assert (folder / DAY / good.id).read_bytes() == good.content()
        assert not (folder / DAY / photo.id).exists()


async def test_download_to_a_full_disk_fails_and_continues_later(folder: Path) -> None:
    async with world(web=True) as w:
        video = add_video(w.drone, 20 * VIDEO)
        command = f"{sys.executable} -m anafi_mav media download {folder} --gateway {gateway_of(w)}"
        # A limit of the size of files, in KiB, is an error of writing like a full disk.
        async with program("bash", "-c", f"ulimit -f 10000; exec {command}") as limited:
            assert await limited.end(60.0) == 2
            assert limited.complaints == [f"anafi-mav: FOLDER: cannot write to {folder}: File too large"]
        (part,) = names(folder)
        assert part.endswith(".part")
        assert 0 < (folder / part).stat().st_size <= 10_000 * 1024
        async with program(*command.split()) as whole:
            assert await whole.end(60.0) == 0
        assert (folder / DAY / video.id).read_bytes() == video.content()
        assert names(folder) == [f"{DAY}/{video.id}", f"{DAY}/{video.id}.json"]


async def test_download_continues_after_the_drone_restarts(folder: Path) -> None:
    async with world(web=True) as w:
        video, client = add_video(w.drone, 20 * VIDEO), await client_of(w)
        (item,) = await client.list()
        assert w.drone.web is not None
        begun, pauses = asyncio.Event(), []

        def progress(done: int, size: int) -> None:
            if not begun.is_set():
                begun.set()
                w.drone.faults.mute = w.drone.web.mute = True  # type: ignore[union-attr]

        def interrupted(error: AnafiMavError, pause: float) -> None:
            pauses.append((str(error), pause))
            if len(pauses) == 2:
                w.drone.faults.mute = w.drone.web.mute = False  # type: ignore[union-attr]

        path = await copy(client, item.resources[0], folder, progress, interrupted)
        assert path is not None
        assert path.read_bytes() == video.content()
        assert [pause for _, pause in pauses][:2] == [2.0, 4.0]
        assert names(folder) == [f"{DAY}/{video.id}", f"{DAY}/{video.id}.json"]


async def test_photo_of_a_flight_is_copied_after_landing(folder: Path) -> None:
    async with world(web=True, media=MediaConfig(download_folder=str(folder))) as w:
        old, drone = add_photo(w.drone), w.gateway.systems[0].drone
        mark = w.client.mark()
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Media copied: 1 file(s)", since=mark, timeout=20.0)
        assert names(folder) == [f"alpha/{DAY}/{old.id}", f"alpha/{DAY}/{old.id}.json"]

        await w.take_off()
        await drone.camera.set_mode(CameraMode.PHOTO)
        media_id = await drone.camera.take_photo()
        mark = w.client.mark()
        ack = await w.client.command(dialect.MAV_CMD_NAV_LAND)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        copied = await w.client.wait(
            "STATUSTEXT", lambda m: m.text.startswith("Media copied"), since=mark, timeout=40.0
        )
        assert copied.text == "Media copied: 1 file(s)"
        (name,) = [name for name in names(folder) if name.endswith(".JPG") and old.id not in name]
        path = folder / name
        photo = w.drone.firmware.payload.media.resource(path.name)
        assert photo is not None
        assert path.read_bytes() == photo.content()
        record: dict[str, Any] = json.loads(path.with_name(f"{path.name}.json").read_text())
        assert record["media_id"] == media_id
        scene = photo.scene
        assert record["place"]["latitude"] == pytest.approx(scene.latitude, abs=1e-6)
        assert record["place"]["longitude"] == pytest.approx(scene.longitude, abs=1e-6)
        assert record["place"]["altitude_amsl"] == pytest.approx(scene.altitude, abs=0.01)
        assert scene.altitude == pytest.approx(w.drone.spec.home[2] + 5.0, abs=1.0)
        attitude = record["camera_attitude"]
        assert attitude["yaw"] == pytest.approx((scene.heading + 180.0) % 360.0 - 180.0, abs=1e-3)
        assert (attitude["pitch"], attitude["roll"]) == pytest.approx((scene.pitch, scene.roll), abs=1e-3)
        assert record["time"] is not None


async def test_copying_after_landing_ends_with_a_takeoff(folder: Path) -> None:
    async with world(web=True, media=MediaConfig(download_folder=str(folder))) as w:
        assert w.drone.web is not None
        w.drone.web.mute = True
        photo = add_photo(w.drone)
        await w.take_off()
        w.drone.web.mute = False
        mark = w.client.mark()
        await w.client.silence("STATUSTEXT", 10.0)
        assert names(folder) == []
        await w.client.command(dialect.MAV_CMD_NAV_LAND)
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Media copied: 1 file(s)", since=mark, timeout=40.0)
        assert (folder / "alpha" / DAY / photo.id).read_bytes() == photo.content()


async def test_copying_waits_for_the_index_and_names_the_problem() -> None:
    async with world(web=True, media=MediaConfig(download_folder="/dev/null/copies")) as w:
        store, mark = w.drone.firmware.payload.media, w.client.mark()
        store.state = MediastoreState.INDEXING
        add_photo(w.drone)
        await w.client.silence("STATUSTEXT", 8.0)
        store.state = MediastoreState.INDEXED
        text = await w.client.wait("STATUSTEXT", since=mark, timeout=20.0)
        assert text.text.startswith("Media not copied: ")


async def test_download_from_a_gateway_without_the_drone_is_refused() -> None:
    async with world(web=True) as w:
        add_photo(w.drone)
        client = await client_of(w)
        (item,) = await client.list()
        w.drone.firmware.payload.media.remove(item.media_id)
        await w.drone.wait_log(
            lambda entry: entry.name == "mediastore.counters" and entry.args["photo_media_count"] == 0
        )
        await asyncio.sleep(0.1)  # until the gateway has received it
        with pytest.raises(CommandRejected, match="no such file"):
            async for _ in client.read_from(item.resources[0]):
                pass


def test_media_command_with_a_wrong_host_names_the_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["media", "list", "--gateway", "a..b:8088"]) == 2
    assert capsys.readouterr().err == "anafi-mav: --gateway: expected HOST:PORT, got 'a..b'\n"


def test_media_command_without_a_gateway_names_it_alone(capsys: pytest.CaptureFixture[str]) -> None:
    """No drone is involved: the address is that of the gateway."""
    assert main(["media", "list", "--gateway", f"127.0.0.1:{free_port()}"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("anafi-mav: no gateway answers at 127.0.0.1:")
    assert "drone" not in error
