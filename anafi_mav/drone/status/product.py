"""Element product: which drone this is. The models of the family are in `anafi_mav.models`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.drone.element import Element, Reducer
from anafi_mav.models import BY_ID, Model

MODELS: Mapping[int, Model] = BY_ID
"""The models by the number in their announcement."""


class ProductState(msgspec.Struct, frozen=True):
    """Names and numbers of the drone."""

    name: str | None = None
    """The name its owner gave it, also the name of its Wi-Fi."""
    firmware: str | None = None
    hardware: str | None = None
    serial_high: str | None = None
    serial_low: str | None = None
    board: str | None = None
    flights: int | None = None
    last_flight_s: int | None = None
    total_flight_s: int | None = None
    boot_id: str | None = None
    """The same from power on to power off."""
    run_id: str | None = None
    flight_id: str | None = None
    """A new one at each take-off; empty on the ground."""
    date_time: str | None = None
    """The drone's clock as it was set last, "YYYYMMDDTHHMMSS+hhmm"."""

    @property
    def serial(self) -> str | None:
        """The whole serial number: its high part followed by its low one."""
        if self.serial_high is None or self.serial_low is None:
            return None
        return self.serial_high + self.serial_low


class Identity(msgspec.Struct, frozen=True):
    """Model, serial number and versions of a drone."""

    model: Model
    serial: str
    firmware: str | None
    hardware: str | None
    name: str

    def __str__(self) -> str:
        return f"{self.model.title} {self.serial}, firmware {self.firmware or 'not reported'}"


class Product(Element[ProductState]):
    """The drone as a product. No verbs: `Drone.identity` sums it up."""

    NOTHING = ProductState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        common.ProductNameChanged: lambda state, message: replace(state, name=message.name),
        common.ProductVersionChanged: lambda state, message: replace(
            state, firmware=message.software, hardware=message.hardware
        ),
        common.ProductSerialHighChanged: lambda state, message: replace(state, serial_high=message.high),
        common.ProductSerialLowChanged: lambda state, message: replace(state, serial_low=message.low),
        common.BoardIdChanged: lambda state, message: replace(state, board=message.id),
        ardrone3.MotorFlightsStatusChanged: lambda state, message: replace(
            state,
            flights=message.nbFlights,
            last_flight_s=message.lastFlightDuration,
            total_flight_s=message.totalFlightDuration,
        ),
        common.BootId: lambda state, message: replace(state, boot_id=message.bootId),
        common.RunIdChanged: lambda state, message: replace(state, run_id=message.runId),
        common.FlightId: lambda state, message: replace(state, flight_id=message.flightId),
        common.CurrentDateTimeChanged: lambda state, message: replace(state, date_time=message.datetime),
    }
