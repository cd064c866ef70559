"""Commands to the camera component, and the simulator's own state of camera and photos."""

from __future__ import annotations

from typing import Any

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.mavlink import dialect
from anafi_mav.sim.payload.media import Media
from support.mav import CAMERA, Client
from support.world import World

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
PHOTO, VIDEO = dialect.CAMERA_MODE_IMAGE, dialect.CAMERA_MODE_VIDEO


async def command(client: Client, id: int, *params: float, **others: Any) -> int:
    """Send a command to component 100; return its result."""
    return int((await client.command(id, *params, target=(1, CAMERA), **others)).result)


async def request(client: Client, kind: str, *params: float) -> Any:
    """A message of component 100, by MAV_CMD_REQUEST_MESSAGE."""
    mark = client.mark()
    id = getattr(dialect, f"MAVLINK_MSG_ID_{kind}")
    assert await command(client, dialect.MAV_CMD_REQUEST_MESSAGE, id, *params) == ACCEPTED
    message = await client.wait(kind, since=mark)
    assert message.get_srcComponent() == CAMERA
    return message


async def enter(client: Client, mode: int) -> None:
    """Change between photos and videos."""
    assert await command(client, dialect.MAV_CMD_SET_CAMERA_MODE, 0, mode) == ACCEPTED


async def shoot(client: Client) -> Any:
    """Take a photo; return its message."""
    mark = client.mark()
    assert await command(client, dialect.MAV_CMD_IMAGE_START_CAPTURE, 0, 0, 1) == ACCEPTED
    return await client.wait("CAMERA_IMAGE_CAPTURED", since=mark)


def photos(w: World) -> list[Media]:
    """The photos, bursts and series on the simulator's card."""
    return [media for media in w.drone.firmware.payload.media if not media.video]


def videos(w: World) -> list[Media]:
    """The videos on the simulator's card."""
    return [media for media in w.drone.firmware.payload.media if media.video]


def press(w: World, message: Message) -> None:
    """Operate the camera as a pilot does at the Skycontroller."""
    for event in w.drone.firmware.payload.operate(message, w.drone.firmware.time):
        w.drone.inject(event)


def texts(client: Client, since: int) -> list[str]:
    """The STATUSTEXTs since a mark."""
    return [message.text for _, message in client.since(since, "STATUSTEXT")]
