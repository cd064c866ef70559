"""Parameters of the fence and the rally points, with their aliases.

They are the gateway's own settings, stored per drone.
"""

from __future__ import annotations

from anafi_mav import texts
from anafi_mav.drone import events
from anafi_mav.services.parameter.parameter import Parameter, alias, mapped, own
from anafi_mav.services.parameter.parameter_codec import ParamType
from anafi_mav.services.parameter.parameter_table import GEOFENCE, OFF_ON
from anafi_mav.services.service import Host
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.fence.fence_watch import (
    ARDUPILOT_ACTIONS,
    CEILING,
    EVERYTHING,
    FLOOR,
    HIGHEST_FLOOR,
    HOME_CIRCLE,
    PX4_ACTIONS,
    ZONES,
    Reaction,
)
from anafi_mav.vehicle.fence.rally import DEFAULT_TYPE, RTL_TYPES

GROUP = "Fence and rally points"

_NUMBERS = {action: number for number, action in PX4_ACTIONS.items()}


def _put_action(host: Host, value: float) -> None:
    action = PX4_ACTIONS[int(value)]
    if action is Reaction.TERMINATE and not host.vehicle.allow_kill:
        host.text(Severity.WARNING, texts.FENCE_NO_MOTOR_CUT)
        action = Reaction.HOLD
    host.vehicle.fence.action = action


async def _set_action(host: Host, value: float) -> None:
    if PX4_ACTIONS[int(value)] is Reaction.TERMINATE and not host.vehicle.allow_kill:
        raise Refused(texts.FENCE, texts.KILL_FENCE, lasting=True)
    _put_action(host, value)


FENCE_ACTION = Parameter(
    "ANF_FENCE_ACTION",
    ParamType.INT32,
    "Action at the fence",
    read=lambda host: float(_NUMBERS[host.vehicle.fence.action]),
    write=_set_action,
    put=_put_action,
    values={number: action.value.capitalize() for number, action in PX4_ACTIONS.items()},
    polled=True,
    group=GROUP,
    long="Nothing: a breach is in FENCE_STATUS and SYS_STATUS only, and no target is refused. A motor cut requires "
    "allow_kill.",
    default=float(_NUMBERS[Reaction.HOLD]),
    source="gateway",
)


async def _enable(host: Host, value: float) -> None:
    with host.vehicle.changing_fence():
        if value == 1:
            host.vehicle.fence.enable()
        else:
            host.vehicle.fence.disable()


FENCE_ENABLED = Parameter(
    "ANF_FENCE_ON",
    ParamType.INT32,
    "An uploaded fence is in force, with the kinds of boundaries in ANF_FENCE_TYPES",
    read=lambda host: float(host.vehicle.fence.is_on),
    write=_enable,
    values=OFF_ON,
    polled=True,
    group=GROUP,
    long="The drone's own ceiling is always in force. MAV_CMD_DO_FENCE_ENABLE sets the same value.",
    default=1.0,
    source="gateway",
)


def _put_types(host: Host, value: float) -> None:
    host.vehicle.fence.choose(int(value))


async def _set_types(host: Host, value: float) -> None:
    with host.vehicle.changing_fence():
        _put_types(host, value)


FENCE_TYPES = Parameter(
    "ANF_FENCE_TYPES",
    ParamType.INT32,
    "Kinds of boundaries of the fence, in force while it is on",
    read=lambda host: float(host.vehicle.fence.types),
    write=_set_types,
    put=_put_types,
    limits=lambda host: (0.0, float(EVERYTHING)),
    polled=True,
    group=GROUP,
    long="Bits: 1 the drone's own ceiling, which is always in force, 2 circles around home, 4 all other zones, "
    "8 the floor.",
    default=float(EVERYTHING),
    source="gateway",
)


def _put_predict(host: Host, value: float) -> None:
    host.vehicle.fence.predict = value == 1


FENCE_AHEAD = Parameter(
    "ANF_FENCE_AHEAD",
    ParamType.INT32,
    "Act before the fence when the drone is too fast to stop",
    read=lambda host: float(host.vehicle.fence.predict),
    write=own(_put_predict),
    put=_put_predict,
    values=OFF_ON,
    polled=True,
    group=GROUP,
    long="Only for flight by sticks or setpoints: other moves end at their target.",
    default=1.0,
    source="gateway",
)


def _put_floor(host: Host, value: float) -> None:
    host.vehicle.fence.floor = value


async def _set_floor(host: Host, value: float) -> None:
    with host.vehicle.changing_fence():
        _put_floor(host, value)


FENCE_FLOOR = Parameter(
    "ANF_FENCE_FLOOR",
    ParamType.REAL32,
    "Lowest height of the fence above the take-off point; 0: none",
    read=lambda host: host.vehicle.fence.floor,
    write=_set_floor,
    put=_put_floor,
    limits=lambda host: (0.0, HIGHEST_FLOOR),
    polled=True,
    unit="m",
    step=1.0,
    decimals=1,
    group=GROUP,
    long="In force once the drone has been above it.",
    default=0.0,
    source="gateway",
)


def _put_rtl_type(host: Host, value: float) -> None:
    host.vehicle.rally.rtl_type = int(value)


RTL_TYPE = Parameter(
    "ANF_RTL_TYPE",
    ParamType.INT32,
    "Place where a return ends",
    read=lambda host: float(host.vehicle.rally.rtl_type),
    write=own(_put_rtl_type),
    put=_put_rtl_type,
    values={number: purpose.value.capitalize() for number, purpose in RTL_TYPES.items()},
    polled=True,
    group=GROUP,
    long="The numbers are PX4's. If rally points are used, the gateway sets the drone's custom home in flight.",
    default=float(DEFAULT_TYPE),
    source="gateway",
)

FENCE_NATIVE: tuple[Parameter, ...] = (FENCE_ACTION, FENCE_ENABLED, FENCE_TYPES, FENCE_AHEAD, FENCE_FLOOR, RTL_TYPE)

FENCE_PX4: tuple[Parameter, ...] = (
    mapped(FENCE_ACTION, "GF_ACTION", ParamType.INT32, FENCE_ACTION.values, {number: number for number in PX4_ACTIONS}),
    mapped(FENCE_AHEAD, "GF_PREDICT", ParamType.INT32, OFF_ON, {0: 0, 1: 1}),
    mapped(RTL_TYPE, "RTL_TYPE", ParamType.INT32, RTL_TYPE.values, {number: number for number in RTL_TYPES}),
)

_ARDUPILOT_WORDS = {0: "Report only", 1: "RTL", 2: "Land", 3: "SmartRTL: RTL", 4: "Brake", 5: "SmartRTL: RTL"}


def _types(host: Host) -> float:
    watch = host.vehicle.fence
    geofence = HOME_CIRCLE if host.drone.piloting.state.geofence else 0
    return float(CEILING | geofence | watch.types & (ZONES | FLOOR))


async def _set_ardupilot_types(host: Host, value: float) -> None:
    types = int(value)
    if not types & CEILING:
        raise Refused(texts.FENCE, texts.CEILING_BIT, lasting=True)
    # Circles around home that were uploaded are zones like others; bit 1 is the drone's own circle of FENCE_RADIUS.
    chosen = CEILING | (ZONES | HOME_CIRCLE if types & ZONES else 0) | types & FLOOR
    with host.vehicle.changing_fence():
        host.vehicle.fence.choose(chosen)
    await host.drone.piloting.set_geofence(bool(types & HOME_CIRCLE))


_TYPE_WORDS = {CEILING: "ceiling", HOME_CIRCLE: "circle", ZONES: "polygon", FLOOR: "floor"}

FENCE_TYPE = Parameter(
    "FENCE_TYPE",
    ParamType.INT8,
    "Kinds of boundaries of the fence, and the drone's own circle",
    read=_types,
    write=_set_ardupilot_types,
    values={
        types: ", ".join(word for bit, word in _TYPE_WORDS.items() if types & bit).capitalize()
        for types in range(CEILING, EVERYTHING + 1, 2)
    },
    updates=(events.NoFlyOverMaxDistanceChanged,),
    polled=True,
    present=GEOFENCE.present,
    group=GROUP,
    native=GEOFENCE.name,
    source="gateway",
)

FENCE_ARDUPILOT: tuple[Parameter, ...] = (
    mapped(
        FENCE_ACTION,
        "FENCE_ACTION",
        ParamType.INT8,
        _ARDUPILOT_WORDS,
        # Of several numbers with one meaning the last is the one that is read: the plain RTL.
        {number: _NUMBERS[ARDUPILOT_ACTIONS[number]] for number in (0, 2, 3, 4, 5, 1)},
    ),
    mapped(FENCE_ENABLED, "FENCE_ENABLE", ParamType.INT8, OFF_ON, {0: 0, 1: 1}),
    alias(FENCE_FLOOR, "FENCE_ALT_MIN"),
    FENCE_TYPE,
)
