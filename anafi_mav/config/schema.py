"""Keys of a configuration file, as data. No I/O.

Reading and checking is `anafi_mav.config.load`. Each key carries its meaning (`description`) and, as `expected`, what
a value must be. Both are used twice: the first makes docs/configuration.md, the second makes that page and the error
messages.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from anafi_mav import models
from anafi_mav.documents import expected
from anafi_mav.endpoint_options import MAX_URL, EndpointConfig

MAX_ENDPOINTS = 32
"""Each endpoint is a socket and gets every message: more than this is a mistake, not a fleet."""

MAX_SYSID = 250
"""Largest system ID of a drone: stations and tools have those above."""

MAX_DRONES = 250
"""As many as there are system ids."""

MAX_TEXT = 200
"""Characters of a URL or host name; DNS ends at 253, no sensible one comes near."""

MAX_PATH = 4096
"""Bytes of a path on Linux (limits.h, PATH_MAX)."""

MAVSDK_SYSID = 245
"""MAVSDK's default system ID of a ground station (MAVSDK mavsdk.h, DEFAULT_SYSTEM_ID_GCS)."""


def alternatives(values: Sequence[str]) -> str:
    """["a", "b", "c"] → "a, b or c"."""
    *first, last = values
    return f"{', '.join(first)} or {last}" if first else last


Port = Annotated[int, Meta(ge=1, le=65535)]


class WindConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The wind around a simulated drone, with gusts."""

    speed: Annotated[
        float,
        Meta(ge=0, le=40, description="Metres per second.", extra=expected("a speed from 0 to 40 m/s")),
    ]
    direction: Annotated[
        float,
        Meta(
            ge=0,
            le=360,
            description="Direction from which the wind blows, degrees clockwise from north.",
            extra=expected("degrees from 0 to 360"),
        ),
    ] = 0.0
    gusts: Annotated[
        Annotated[float, Meta(ge=0, le=1)] | None,
        Meta(
            description="Standard deviation of the gusts as a share of the speed. Default: 0.15, the value of open "
            "country in daytime.",
            extra=expected("a share from 0 to 1"),
        ),
    ] = None


class SimConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A simulated drone.

    `anafi-mav run` starts all simulated drones in one separate process.
    """

    model: Annotated[
        str,
        Meta(description="Model of the simulated drone.", extra=expected(alternatives(models.simulated()))),
    ] = "4k"
    home: Annotated[
        tuple[
            Annotated[float, Meta(ge=-90, le=90, extra=expected("a latitude from -90 to 90 degrees"))],
            Annotated[float, Meta(ge=-180, le=180, extra=expected("a longitude from -180 to 180 degrees"))],
            Annotated[float, Meta(ge=-500, le=9000, extra=expected("a height of -500 to 9000 m above sea level"))],
        ],
        Meta(
            description="Place at the start: latitude and longitude (WGS 84, degrees) and height of the ground "
            "(metres above mean sea level).",
            extra=expected("[latitude, longitude, height]"),
        ),
    ] = (48.8789, 2.3677, 35.0)
    address: Annotated[
        Annotated[str, Meta(max_length=MAX_TEXT)] | None,
        Meta(
            description="Address that the simulated drone binds. Default: the first of 127.0.42.1, 127.0.42.2, … with "
            "free ports.",
            extra=expected("an IPv4 address of this machine, like 127.0.42.1"),
        ),
    ] = None
    speed: Annotated[
        float,
        Meta(
            ge=0.1,
            le=20,
            description="Simulated seconds per second. All simulated drones share one clock: it must be equal for all.",
            extra=expected("a number from 0.1 to 20"),
        ),
    ] = 1.0
    telemetry_rate: Annotated[
        float,
        Meta(
            ge=1,
            le=200,
            description="Rate of attitude, speed and altitude, Hz. The aircraft sends them at 5 Hz.",
            extra=expected("a number of events per second from 1 to 200"),
        ),
    ] = 5.0
    seed: Annotated[
        Annotated[int, Meta(ge=0, le=2**32 - 1)] | None,
        Meta(
            description="Seed of the random numbers, for a flight that can be repeated. Must be equal for all "
            "simulated drones that set it. Default: a new seed at each start.",
            extra=expected("a whole number from 0 to 4294967295"),
        ),
    ] = None
    protocol: Annotated[
        Literal[1, 2, 3],
        Meta(
            description="Newest version of Parrot's transport that the simulated drone offers.",
            extra=expected("1, 2 or 3"),
        ),
    ] = 3
    skycontroller: Annotated[
        Literal[3, 4] | None,
        Meta(
            description="Generation of a simulated Skycontroller between gateway and drone; `address` is then the "
            "Skycontroller's. Default: no Skycontroller.",
            extra=expected("3 or 4"),
        ),
    ] = None
    storage: Annotated[
        Annotated[int, Meta(ge=0, le=2**63 - 1)] | Annotated[str, Meta(pattern=r"\A[0-9]{1,9}[kMG]?\Z")] | None,
        Meta(
            description="Size of the memory card, bytes. Default: the size of the model's card.",
            extra=expected("a number of bytes like 500k or 16G"),
        ),
    ] = None
    wind: Annotated[
        WindConfig | None,
        Meta(
            description="Wind from the start. Default: no wind.",
            extra=expected("a mapping like {speed: 8, direction: 270}"),
        ),
    ] = None
    firmware_quirks: Annotated[
        tuple[Annotated[str, Meta(max_length=MAX_TEXT, extra=expected("the name of a quirk"))], ...],
        Meta(
            description="Firmware quirks to simulate; docs/simulator.md lists them.",
            extra=expected("a list of names like [no-flight-id]"),
        ),
    ] = ()
    scenario: Annotated[
        Annotated[str, Meta(min_length=1, max_length=MAX_PATH)] | None,
        Meta(
            description="Scenario file with timed faults (docs/simulator.md), relative to the folder of the "
            "configuration. Its steps for this drone and those for all drones are executed.",
            extra=expected("the path of a scenario file"),
        ),
    ] = None
    http_port: Annotated[
        Port | None,
        Meta(
            description="TCP port of the simulated web server. Default: 80 as on the aircraft, or 8080 if this user "
            "may not open port 80.",
            extra=expected("a port from 1 to 65535"),
        ),
    ] = None
    rtsp_port: Annotated[
        Port | None,
        Meta(
            description="TCP port of the simulated RTSP server. Default: 554 as on the aircraft, or 8554 if this user "
            "may not open port 554.",
            extra=expected("a port from 1 to 65535"),
        ),
    ] = None


class DroneConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A drone is one MAVLink system. It has either an `address` or a `sim`."""

    name: Annotated[
        str,
        Meta(
            pattern=r"\A[A-Za-z0-9][A-Za-z0-9_.-]{0,31}\Z",
            description="Name of the drone in messages and logs.",
            extra=expected("1 to 32 letters, digits, '-', '_' or '.', beginning with a letter or digit"),
        ),
    ]
    sysid: Annotated[
        int,
        Meta(
            ge=1,
            le=MAX_SYSID,
            description="MAVLink system id, different for each drone. 245 is allowed with a warning: it is the default "
            "system id of MAVSDK.",
            extra=expected(f"a whole number from 1 to {MAX_SYSID}"),
        ),
    ]
    serial: Annotated[
        Annotated[str, Meta(pattern=r"\A[A-Za-z0-9]{5,32}\Z")] | None,
        Meta(
            description="Serial number of the aircraft, as `anafi-mav info` prints it. The `sysid` is then that "
            "aircraft's: another one at this address is not connected, also behind a Skycontroller. Default: any "
            "aircraft.",
            extra=expected("5 to 32 letters and digits"),
        ),
    ] = None
    address: Annotated[
        Annotated[str, Meta(max_length=MAX_TEXT)] | None,
        Meta(
            description="Network address of the drone. In its own Wi-Fi an ANAFI is 192.168.42.1.",
            extra=expected("an IPv4 address or a host name, like 192.168.42.1"),
        ),
    ] = None
    interface: Annotated[
        Annotated[str, Meta(pattern=r"\A[^\s/\0]{1,15}\Z")] | None,
        Meta(
            description="Network interface to which every socket for this drone is bound. Several drones, each in its "
            "own Wi-Fi, may then have the same address. Linux only. Default: the interface of the system's routes.",
            extra=expected("the name of a network interface, like wlan1"),
        ),
    ] = None
    sim: Annotated[
        SimConfig | None,
        Meta(
            description="Settings of a simulated drone; `{}` for all defaults.",
            extra=expected("a mapping with the keys of a simulated drone, or {}"),
        ),
    ] = None
    discovery_port: Annotated[
        Port,
        Meta(
            description="TCP port of ARSDK discovery, where the drone sends its identity and its handshake port.",
            extra=expected("a port from 1 to 65535"),
        ),
    ] = 44445
    http_port: Annotated[
        Port | None,
        Meta(
            description="TCP port of the drone's web server. Default: 80.",
            extra=expected("a port from 1 to 65535"),
        ),
    ] = None
    rtsp_port: Annotated[
        Port | None,
        Meta(
            description="TCP port of the drone's RTSP server. Default: 554.",
            extra=expected("a port from 1 to 65535"),
        ),
    ] = None
    allow_kill: Annotated[
        bool | None,
        Meta(
            description="The same for this drone only. Default: the value for all drones.",
            extra=expected("true or false"),
        ),
    ] = None


class HttpConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The gateway's web server: pages for browsers, the status, and files for ground stations.

    Open to the network, it needs a token (docs/web.md).
    """

    host: Annotated[
        str,
        Meta(
            min_length=1,
            max_length=MAX_TEXT,
            description="The address that it listens on: 127.0.0.1 for this computer alone, 0.0.0.0 for every network "
            "that this computer is in.",
            extra=expected("an IPv4 address or a host name of this computer, like 0.0.0.0"),
        ),
    ] = "127.0.0.1"
    port: Annotated[
        Annotated[int, Meta(ge=0, le=65535)] | None,
        Meta(
            description="Its TCP port; 0 is a free one. Left out: 8088, or a free one where that is in use. The "
            "gateway prints it.",
            extra=expected("a port from 0 to 65535"),
        ),
    ] = None


class MediaConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Photos and videos of the drones."""

    download_folder: Annotated[
        Annotated[str, Meta(min_length=1, max_length=MAX_PATH)] | None,
        Meta(
            description="Folder into which each drone's photos and videos are copied after a landing, as "
            "`<drone>/<day>/<file>` with a JSON file for each. `~` is the user's home. Left out: they are not copied.",
            extra=expected("the path of a folder"),
        ),
    ] = None


class RecordingConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Recording of sessions: what passes both sides of the gateway (docs/operation.md)."""

    folder: Annotated[
        Annotated[str, Meta(min_length=1, max_length=MAX_PATH)] | None,
        Meta(
            description="Folder in which each run of the gateway records itself, in a folder of its own. It holds "
            "positions and serial numbers. `~` is the user's home. Default: nothing is recorded.",
            extra=expected("the path of a folder"),
        ),
    ] = None
    max_megabytes: Annotated[
        int,
        Meta(
            ge=200,
            le=1_000_000,
            description="Most megabytes of all sessions in the folder; one takes a quarter at most. The oldest files "
            "are deleted.",
            extra=expected("a whole number from 200 to 1000000"),
        ),
    ] = 2000


class WarningsConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Limits of the texts about dangerous settings of a drone (docs/failsafes.md)."""

    return_height: Annotated[
        float,
        Meta(
            ge=0,
            le=500,
            description="A return that climbs to less than this is reported, metres above take-off.",
            extra=expected("a height from 0 to 500 m"),
        ),
    ] = 20.0
    radio_range: Annotated[
        Annotated[float, Meta(ge=10, le=100_000)] | None,
        Meta(
            description="Range of the radio, metres. A drone without geofence whose MaxDistance is larger is reported. "
            "Default: 4000 behind a Skycontroller, else 100.",
            extra=expected("a distance from 10 to 100000 m"),
        ),
    ] = None


class VideoConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The gateway's video server (RTSP), which passes on the live video of every drone.

    Viewers on other computers need a token as password (docs/video.md).
    """

    host: Annotated[
        str,
        Meta(
            min_length=1,
            max_length=MAX_TEXT,
            description="The address that it listens on: 127.0.0.1 for this computer alone, 0.0.0.0 for every network "
            "that this computer is in.",
            extra=expected("an IPv4 address or a host name of this computer, like 0.0.0.0"),
        ),
    ] = "127.0.0.1"
    rtsp_port: Annotated[
        Annotated[int, Meta(ge=0, le=65535)] | None,
        Meta(
            description="Its TCP port; 0 is a free one. Left out: 8555, or a free one where that is in use. The "
            "gateway prints it.",
            extra=expected("a port from 0 to 65535"),
        ),
    ] = None
    public_host: Annotated[
        Annotated[str, Meta(min_length=1, max_length=64)] | None,
        Meta(
            description="The host in the URIs that stations receive, where it is not the address that their link "
            "shows: behind a MAVLink router, NAT or a container, or for stations on serial lines.",
            extra=expected("an IPv4 address or a host name, like 10.0.0.7"),
        ),
    ] = None


class Config(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The whole file.

    Every key is optional: an empty file equals `anafi-mav` without a configuration.
    """

    endpoints: Annotated[
        tuple[
            Annotated[
                Annotated[str, Meta(min_length=1, max_length=MAX_URL)] | EndpointConfig,
                Meta(extra=expected("a URL like udpout://127.0.0.1:14550, or a mapping with a url and options")),
            ],
            ...,
        ],
        Meta(
            min_length=1,
            max_length=MAX_ENDPOINTS,
            description="MAVLink endpoints: URLs, or mappings with a `url` and options. Every drone sends and receives "
            "on every endpoint, unless its options limit that. [More below](#endpoint-urls).",
            extra=expected(f"a list of 1 to {MAX_ENDPOINTS} URLs"),
        ),
    ] = ("udpout://127.0.0.1:14550", "udpout://127.0.0.1:14540", "tcpin://127.0.0.1:5760?flavour=ardupilot")
    drones: Annotated[
        tuple[DroneConfig, ...],
        Meta(
            min_length=1,
            max_length=MAX_DRONES,
            description="The drones; each is one MAVLink system.",
            extra=expected(f"a list of 1 to {MAX_DRONES} drones"),
        ),
    ] = (DroneConfig(name="anafi", sysid=1, sim=SimConfig()),)
    sysids: Annotated[
        Annotated[str, Meta(pattern=r"\A\d{1,3}-\d{1,3}\Z")] | None,
        Meta(
            description="Range of the system ids of this gateway, where several share a [network](fabric.md): each "
            "drone's `sysid` must be in it. Default: none.",
            extra=expected("a range like 1-80"),
        ),
    ] = None
    allow_kill: Annotated[
        bool,
        Meta(
            description="Allow clients to cut the motors in flight. A drone whose motors are cut falls.",
            extra=expected("true or false"),
        ),
    ] = False
    pose: Annotated[
        Literal["video", "events"],
        Meta(
            description="Source of attitude, position and speed for a client that requests them more than ten times a "
            "second: the metadata of the live video, up to 30 times a second, or the drone's events, 5 times a second. "
            "The video costs the radio some Mbit/s while such a client has its streams.",
            extra=expected("video or events"),
        ),
    ] = "video"
    state: Annotated[
        Annotated[str, Meta(min_length=1, max_length=MAX_PATH)] | None,
        Meta(
            description="Folder of the gateway's stored state. Each drone has a file with its mission, fence, rally "
            "points, the take-off point of its last flight and the gateway's settings for it. `~` is the user's home. "
            "Default: `$XDG_STATE_HOME/anafi-mav`, or `~/.local/state/anafi-mav` without that variable.",
            extra=expected("the path of a folder"),
        ),
    ] = None
    media: Annotated[
        MediaConfig,
        Meta(
            description="Photos and videos of the drones.", extra=expected("a mapping like {download_folder: ~/drone}")
        ),
    ] = MediaConfig()
    recording: Annotated[
        RecordingConfig,
        Meta(description="Recording of sessions.", extra=expected("a mapping like {folder: ~/flights}")),
    ] = RecordingConfig()
    warnings: Annotated[
        WarningsConfig,
        Meta(
            description="Limits of the texts about dangerous settings.",
            extra=expected("a mapping like {return_height: 30}"),
        ),
    ] = WarningsConfig()
    http: Annotated[
        HttpConfig | bool,
        Meta(
            description="The gateway's web server; `off` for none.",
            extra=expected("a mapping like {host: 127.0.0.1, port: 8088}, or off"),
        ),
    ] = HttpConfig()
    video: Annotated[
        VideoConfig | bool,
        Meta(
            description="The gateway's video server; `off` for none.",
            extra=expected("a mapping like {host: 0.0.0.0, rtsp_port: 8555}, or off"),
        ),
    ] = VideoConfig()

    @property
    def http_server(self) -> HttpConfig | None:
        """The web server as configured; None: off."""
        if isinstance(self.http, HttpConfig):
            return self.http
        return HttpConfig() if self.http else None

    @property
    def video_server(self) -> VideoConfig | None:
        """The video server as configured; None: off."""
        if isinstance(self.video, VideoConfig):
            return self.video
        return VideoConfig() if self.video else None


SECTIONS: dict[str, type[msgspec.Struct]] = {
    "the file": Config,
    "endpoints[…]": EndpointConfig,
    "drones[…]": DroneConfig,
    "drones[…].sim": SimConfig,
    "drones[…].sim.wind": WindConfig,
    "media": MediaConfig,
    "recording": RecordingConfig,
    "warnings": WarningsConfig,
    "http": HttpConfig,
    "video": VideoConfig,
}
"""Place in the file of each group of keys, in the order of the manual."""
