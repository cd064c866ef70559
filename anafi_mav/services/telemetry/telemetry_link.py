"""Quality of the links: the drone's radio, the client's channel, and the gateway's host.

The drone reports a quality from 1 (a disconnection is highly probable) to 5 (very good), and the strength of the
signal in dBm. MAVLink's fields have the scale of the device, and each family of clients reads another one into them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from anafi_mav import units
from anafi_mav.drone import events
from anafi_mav.drone.controller.controller import PITCH, RESET_CAMERA, RESET_ZOOM, ROLL, THROTTLE, TILT, YAW, ZOOM
from anafi_mav.drone.controller.state import ControllerState
from anafi_mav.drone.status.link import Link
from anafi_mav.mavlink import dialect
from anafi_mav.services.stream import INPUT_FASTEST, MessageStream, Times
from anafi_mav.vehicle.vehicle import Vehicle

UNKNOWN_U8 = 255
UNUSED_CHANNEL = 0xFFFF

BEST_QUALITY = 5

STICK_CHANNELS: Mapping[int, tuple[int, int]] = {
    1: (ROLL, 1),
    2: (PITCH, -1),
    3: (THROTTLE, 1),
    4: (YAW, 1),
    5: (TILT, 1),
    6: (ZOOM, 1),
}
"""Axis and sign of each channel. The sticks are those of RC_CHANNELS_OVERRIDE, where forward is below the middle."""
BUTTON_CHANNELS: Mapping[int, int] = {7: RESET_CAMERA, 8: RESET_ZOOM}
"""Button of each channel."""
PULSE_MIDDLE, PULSE_WAY = 1500, 500
"""us: an input at rest, and its way to an end. A button is at one of the ends (ArduPilot's RCn_MIN, TRIM, MAX)."""

INPUT_EVENTS = (events.GrabState, events.GrabAxisEvent, events.GrabButtonEvent)
"""What a Skycontroller reports of its inputs."""

MEMINFO = Path("/proc/meminfo")
"""Linux reports its memory here, in KiB (proc_meminfo(5)). Other systems do not have it."""


def rc_channels(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return RC_CHANNELS of the Skycontroller's grabbed inputs.

    Its rssi is the quality of the drone's radio. It is unknown without a Skycontroller: there is no radio of sticks.
    """
    controller = vehicle.drone.controller
    quality = vehicle.drone.link.state.quality if controller.present else None
    rssi = UNKNOWN_U8 if quality is None else round(times.flavour.rssi_full * quality / BEST_QUALITY)
    read = _channels(controller.state) if controller.present else {}
    channels = {f"chan{number}_raw": read.get(number, UNUSED_CHANNEL) for number in range(1, 19)}
    count = max(*STICK_CHANNELS, *BUTTON_CHANNELS) if read else 0
    return dialect.MAVLink_rc_channels_message(time_boot_ms=times.boot_ms, chancount=count, rssi=rssi, **channels)


def _channels(state: ControllerState) -> dict[int, int]:
    """Return the pulse width of each grabbed input, us, by channel.

    An axis that is not reported yet is left out.
    """
    axes, buttons = state.grabbed_axes or 0, state.grabbed_buttons or 0
    read = {
        channel: round(PULSE_MIDDLE + sign * PULSE_WAY * state.axes[axis] / 100)
        for channel, (axis, sign) in STICK_CHANNELS.items()
        if axes >> axis & 1 and axis in state.axes
    }
    for channel, button in BUTTON_CHANNELS.items():
        if buttons >> button & 1:
            read[channel] = PULSE_MIDDLE + (PULSE_WAY if button in state.pressed else -PULSE_WAY)
    return read


def _signal(dbm: int, times: Times) -> int:
    """RADIO_STATUS.rssi of a signal strength, in the scale that the client reads."""
    if times.flavour.sik_radio:
        return units.saturate(units.clip(1.9 * (dbm + 127.0), 0.0, 254.0), 8, signed=False)
    return int(units.clip(dbm, -128, -2)) & 0xFF  # -1 would be MAVLink's "unknown"


def radio_status(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """RADIO_STATUS: what the drone receives.

    What its controller receives, noise and errors are not reported.

    MAVLink's unknown is 255, which QGroundControl shows as -1 dBm, as if a strong signal had been measured. Its
    clients
    get 0: no signal is 0 dBm, and it is what QGroundControl shows before a radio has reported. There is no buffer on
    the way that clients could overfill, hence 100 % free.
    """
    dbm = vehicle.drone.link.state.rssi_dbm
    if dbm is None or dbm >= 0:
        return None
    unknown = UNKNOWN_U8 if times.flavour.sik_radio else 0
    return dialect.MAVLink_radio_status_message(_signal(dbm, times), unknown, 100, unknown, unknown, 0, 0)


def memory_mib(meminfo: Path = MEMINFO) -> tuple[int, int] | None:
    """Return MiB of memory and of available memory, or None where no kernel reports it.

    Available is what programs can still get, page cache included.
    """
    try:
        fields = dict(line.split(":", 1) for line in meminfo.read_text("ascii").splitlines())
        total, available = (int(fields[name].split()[0]) >> 10 for name in ("MemTotal", "MemAvailable"))
    except (OSError, ValueError, LookupError):
        return None
    return total, available


def onboard_computer_status(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return ONBOARD_COMPUTER_STATUS of the gateway's host, as far as every system reports it."""
    unknown_i8, unknown_i16, unknown_u32 = 127, 0x7FFF, 0xFFFFFFFF
    total = used = unknown_u32
    if (memory := memory_mib()) is not None:
        total, available = memory
        used = total - available
    return dialect.MAVLink_onboard_computer_status_message(
        times.boot_us,
        times.boot_ms,
        0,
        [UNKNOWN_U8] * 8,
        [UNKNOWN_U8] * 10,
        [UNKNOWN_U8] * 4,
        [UNKNOWN_U8] * 10,
        unknown_i8,
        [unknown_i8] * 8,
        [unknown_i16] * 4,
        used,
        total,
        [unknown_u32] * 4,
        [unknown_u32] * 4,
        [unknown_u32] * 4,
        [unknown_u32] * 6,
        [unknown_u32] * 6,
        [unknown_u32] * 6,
        [unknown_u32] * 6,
        [unknown_u32] * 6,
    )


_UPDATES = tuple(Link.REDUCERS)

STREAMS: Mapping[int, MessageStream] = {
    dialect.MAVLINK_MSG_ID_RC_CHANNELS: MessageStream(
        rc_channels, (*_UPDATES, *INPUT_EVENTS), every=1.0, repeated=True, flavoured=True, fastest=INPUT_FASTEST
    ),
    dialect.MAVLINK_MSG_ID_RADIO_STATUS: MessageStream(
        radio_status, _UPDATES, every=1.0, repeated=True, flavoured=True
    ),
    dialect.MAVLINK_MSG_ID_ONBOARD_COMPUTER_STATUS: MessageStream(onboard_computer_status),
}
