"""The parameter protocol over a small true table.

Every name is either a setting of the drone (written through it, answered with what it confirmed), a setting of the
gateway, or a fact that QGroundControl wants to see before it calls a vehicle set up (conformance A5). Encoding is
bytewise: an INT32 travels as the bits of the float field (MAVLink parameter.md).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any

from anafi_mav.drone import Range
from anafi_mav.drone.events import RthEndingBehavior
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import Host, MessageHandler, Service
from anafi_mav.services.statustext import Severity
from anafi_mav.services.vehicle import LOWEST, Vehicle

INT32, REAL32 = dialect.MAV_PARAM_TYPE_INT32, dialect.MAV_PARAM_TYPE_REAL32

MAX_WRITES = 16
"""PARAM_SETs under way at once: a client writes one after the other, several clients a few."""

TYPE_MISMATCH = 7
"""MAV_PARAM_ERROR_TYPE_MISMATCH of upstream's common.xml; pymavlink 2.4.50 stops at 5."""


@dataclass(frozen=True)
class Parameter:
    """One named value. `read` never fails; a value that the drone has not reported is NaN or 0."""

    name: str
    type: int
    read: Callable[[], float]
    write: Callable[[float], Awaitable[float]] | None = None
    """Sets it and returns the confirmed value; None: read only."""
    limits: Callable[[], tuple[float, float]] | None = None
    """(min, max) that may be written."""


def encode(value: float, kind: int) -> float:
    """The float whose bits carry `value`."""
    if kind == INT32:
        (carrier,) = struct.unpack("<f", struct.pack("<i", int(value)))
        return float(carrier)
    return value


def decode(carrier: float, kind: int) -> float:
    """The value that a float field of this type carries."""
    if kind == INT32:
        (value,) = struct.unpack("<i", struct.pack("<f", carrier))
        return float(value)
    return carrier


def _known(setting: Range | None) -> float:
    return math.nan if setting is None else setting.current


def _range(setting: Range | None) -> tuple[float, float]:
    return (math.nan, math.nan) if setting is None else (setting.min, setting.max)


def table(vehicle: Vehicle, sysid: int) -> list[Parameter]:
    """The parameters of a vehicle, sorted by name; the same ones for as long as the vehicle exists."""
    drone = vehicle.drone
    piloting = drone.piloting

    async def set_takeoff_height(value: float) -> float:
        vehicle.takeoff_height = value
        return value

    def takeoff_limits() -> tuple[float, float]:
        ceiling = piloting.state.max_altitude
        return LOWEST, math.inf if ceiling is None else ceiling.current

    def fact(name: str, value: float, kind: int = INT32) -> Parameter:
        return Parameter(name, kind, lambda: value)

    def calibrated() -> float:
        return 0.0 if drone.calibration.state.magneto_required else 1.0

    def land_delay() -> float:
        # PX4: -1 hovers at home for ever, 0 lands at once.
        return 0.0 if drone.home.state.ending == RthEndingBehavior.LANDING else -1.0

    async def set_hand_launch(value: float) -> float:
        vehicle.hand_launch = bool(value)
        return value

    parameters = [
        Parameter("ANF_HAND_LAUNCH", INT32, lambda: float(vehicle.hand_launch), set_hand_launch, lambda: (0.0, 1.0)),
        Parameter("MIS_TAKEOFF_ALT", REAL32, lambda: vehicle.takeoff_height, set_takeoff_height, takeoff_limits),
        Parameter(
            "RTL_RETURN_ALT",
            REAL32,
            lambda: _known(drone.home.state.min_altitude),
            piloting.set_min_altitude,
            lambda: _range(drone.home.state.min_altitude),
        ),
        Parameter("RTL_DESCEND_ALT", REAL32, lambda: _known(drone.home.state.ending_altitude)),
        Parameter("RTL_LAND_DELAY", REAL32, land_delay),
        Parameter(
            "MPC_TILTMAX_AIR",
            REAL32,
            lambda: _known(piloting.state.max_tilt),
            piloting.set_max_tilt,
            lambda: _range(piloting.state.max_tilt),
        ),
        Parameter(
            "MPC_Z_VEL_MAX_UP",
            REAL32,
            lambda: _known(piloting.state.max_vertical_speed),
            piloting.set_max_vertical_speed,
            lambda: _range(piloting.state.max_vertical_speed),
        ),
        Parameter("MPC_Z_VEL_MAX_DN", REAL32, lambda: _known(piloting.state.max_vertical_speed)),
        Parameter(
            "MPC_MAN_Y_MAX",
            REAL32,
            lambda: _known(piloting.state.max_rotation_speed),
            piloting.set_max_rotation_speed,
            lambda: _range(piloting.state.max_rotation_speed),
        ),
        Parameter(
            "GF_MAX_VER_DIST",
            REAL32,
            lambda: _known(piloting.state.max_altitude),
            piloting.set_max_altitude,
            lambda: _range(piloting.state.max_altitude),
        ),
        Parameter(
            "GF_MAX_HOR_DIST",
            REAL32,
            lambda: _known(piloting.state.max_distance) if piloting.state.geofence else 0.0,
        ),
        fact("MAV_SYS_ID", sysid),
        fact("SYS_AUTOSTART", 4001),
        Parameter("CAL_GYRO0_ID", INT32, lambda: 1.0),
        Parameter("CAL_ACC0_ID", INT32, lambda: 1.0),
        Parameter("CAL_MAG0_ID", INT32, calibrated),
        fact("CAL_MAG1_ID", 0),
        fact("CAL_MAG2_ID", 0),
        fact("COM_RC_IN_MODE", 1),
        fact("NAV_DLL_ACT", 0),
        fact("COM_DL_LOSS_T", 10),
        fact("SYS_HAS_MAG", 1),
        fact("SYS_HAS_BARO", 1),
    ]
    return sorted(parameters, key=lambda parameter: parameter.name)


class ParameterService(Service):
    """Answers PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET for one vehicle."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._table = table(host.vehicle, host.sysid)
        self._index = {parameter.name: index for index, parameter in enumerate(self._table)}
        self._writes = 0

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._param_list,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._param_read,
            dialect.MAVLINK_MSG_ID_PARAM_SET: self._param_set,
        }

    def _param_list(self, inbound: Inbound) -> None:
        for message in self.all_values():
            self.host.send(message, inbound.channel)

    def _param_read(self, inbound: Inbound) -> None:
        self.host.send(self.read(inbound.message, inbound.sysid, inbound.compid), inbound.channel)

    def _param_set(self, inbound: Inbound) -> None:
        if self._writes < MAX_WRITES:  # otherwise the client says it again
            self._writes += 1
            self.host.spawn(self._write_param(inbound))

    async def _write_param(self, inbound: Inbound) -> None:
        try:
            answers, changed = await self.write(inbound.message, inbound.sysid, inbound.compid)
        finally:
            self._writes -= 1
        for message in answers:
            self.host.send(message, None if changed else inbound.channel)

    def all_values(self) -> list[dialect.MAVLink_message]:
        """A PARAM_VALUE for each parameter, in the order of their index."""
        return [self._value(index) for index in range(len(self._table))]

    def read(
        self, message: dialect.MAVLink_param_request_read_message, sysid: int, compid: int
    ) -> dialect.MAVLink_message:
        """The PARAM_VALUE, or PARAM_ERROR for a name or index that does not exist."""
        index = message.param_index
        if index < 0:
            index = self._index.get(_name(message.param_id), -1)
        if 0 <= index < len(self._table):
            return self._value(index)
        return self._error(message, sysid, compid, dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST)

    async def write(
        self, message: dialect.MAVLink_param_set_message, sysid: int, compid: int
    ) -> tuple[list[dialect.MAVLink_message], bool]:
        """(answers, changed): a PARAM_VALUE with the value that holds now; before it a PARAM_ERROR when refused."""
        index = self._index.get(_name(message.param_id))
        if index is None:
            return [self._error(message, sysid, compid, dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST)], False
        parameter = self._table[index]
        if message.param_type != parameter.type:
            return self._refuse(message, sysid, compid, TYPE_MISMATCH, index), False
        value = decode(message.param_value, parameter.type)
        before = parameter.read()
        if parameter.write is None:
            if value == before:
                return [self._value(index)], False
            return self._refuse(message, sysid, compid, dialect.MAV_PARAM_ERROR_READ_ONLY, index), False
        low, high = parameter.limits() if parameter.limits is not None else (-math.inf, math.inf)
        if not (math.isfinite(value) and low <= value <= high):
            return self._refuse(message, sysid, compid, dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE, index), False
        try:
            await parameter.write(value)
        except AnafiMavError as error:
            self.host.text(Severity.WARNING, f"{parameter.name} not set: {error}")
            return [self._value(index)], False
        return [self._value(index)], True

    def _value(self, index: int) -> dialect.MAVLink_message:
        parameter = self._table[index]
        return dialect.MAVLink_param_value_message(
            parameter.name.encode(), encode(parameter.read(), parameter.type), parameter.type, len(self._table), index
        )

    def _refuse(self, message: Any, sysid: int, compid: int, error: int, index: int) -> list[dialect.MAVLink_message]:
        return [self._error(message, sysid, compid, error), self._value(index)]

    @staticmethod
    def _error(message: Any, sysid: int, compid: int, error: int) -> dialect.MAVLink_message:
        return dialect.MAVLink_param_error_message(
            sysid, compid, _name(message.param_id).encode(), getattr(message, "param_index", -1), error
        )


def _name(param_id: str | bytes) -> str:
    """The name in a param_id field: 16 characters fill it without a NUL."""
    text = param_id.decode(errors="replace") if isinstance(param_id, bytes) else param_id
    return text.split("\0", 1)[0]
