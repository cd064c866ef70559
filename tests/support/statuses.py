"""A status record with every kind of value, among them texts that a peer could have chosen."""

from __future__ import annotations

from anafi_mav.status_record import (
    VERSION,
    ClientStatus,
    CommandsStatus,
    DroneStatus,
    EndpointStatus,
    GatewayStatus,
    Quantiles,
    RefusedCommand,
    ServerStatus,
)

NASTY = '<b>"x\\y"</b>\x1b[31m\nnext'
"""HTML, a quotation mark, a backslash, a terminal escape and a line end."""

REFUSED = RefusedCommand(
    age_s=4.0, sender="255/190", client="tcpin://a from b", command="NAV_TAKEOFF", result="DENIED", reason=NASTY
)

ALPHA = DroneStatus(
    name="alpha",
    sysid=1,
    address="192.168.42.1",
    interface=None,
    connected=True,
    problem="",
    connections=3,
    model="ANAFI 4K",
    serial="PI040416DA9H000001",
    firmware=NASTY,
    has_skycontroller=False,
    mode="Hold",
    armed=True,
    flying="IN_AIR",
    battery_percent=57,
    gps_fix=True,
    satellites=14,
    height_m=12.5,
    radio_quality=4,
    radio_dbm=-61,
    silence_s=0.04,
    stream="visible",
    viewers=2,
    operator=255,
    secondaries=(251, 253),
    warnings=("Return delay 0 s: each link loss is a return",),
    commands=CommandsStatus(
        results={"ACCEPTED": 7, "DENIED": 1},
        latency=Quantiles(count=7, p50_ms=20.0, p99_ms=250.0, max_ms=300.0),
        refused=(REFUSED,),
    ),
    counters={"received": 900},
)

BRAVO = DroneStatus(
    name="bravo",
    sysid=2,
    address="192.168.42.1",
    interface="wlan1",
    connected=False,
    problem="no answer yet",
    connections=0,
    model="",
    serial="",
    firmware="",
    has_skycontroller=None,
    mode=None,
    armed=None,
    flying=None,
    battery_percent=None,
    gps_fix=None,
    satellites=None,
    height_m=None,
    radio_quality=None,
    radio_dbm=None,
    silence_s=None,
    stream="",
    viewers=0,
    warnings=(),
    commands=CommandsStatus(results={}, latency=Quantiles(), refused=()),
    counters={},
)

CLIENT = ClientStatus(
    name=f"tcpin://127.0.0.1:5760 from {NASTY}",
    systems=("255/190",),
    silence_s=0.3,
    sent_bytes=123456,
    received_bytes=789,
    dropped_bytes=10,
    sent_rate=2500.0,
    received_rate=21.0,
    counters={"sent_frames": 3000},
)

STATUS = GatewayStatus(
    version=VERSION,
    program="1.2.3",
    pid=4711,
    time=1.79e9,
    uptime_s=3600.0,
    loop_delay=Quantiles(count=600, p50_ms=0.2, p99_ms=4.0, max_ms=9.0),
    problems=(),
    drones=(ALPHA, BRAVO),
    endpoints=(
        EndpointStatus(
            url="tcpin://127.0.0.1:5760",
            state="1 client",
            clients=(CLIENT,),
            refused={"all places taken": 2},
            counters={"refused_peers": 2},
        ),
    ),
    video=ServerStatus(url="rtsp://127.0.0.1:8555/", clients=2, counters={"sessions": 2}),
    web=ServerStatus(url="http://127.0.0.1:8088/", clients=1, counters={"token": 5}),
    counters={"alpha.received": 900, "sent_frames": 3000},
)
