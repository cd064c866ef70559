"""A stream: a message that a vehicle sends by itself, and how often.

Intervals per channel are in `mavlink.streams`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import msgspec
from msgspec.structs import replace

from anafi_mav.drone.events import Message
from anafi_mav.endpoint_options import EndpointOptions
from anafi_mav.mavlink import dialect
from anafi_mav.services.flavours import PX4, Flavour
from anafi_mav.services.pose import UNKNOWN_POSE, VehiclePose
from anafi_mav.vehicle.vehicle import Vehicle

FASTEST = 1.0 / 30.0
"""s. A message that is also repeated leaves no more often, whatever updates it; a picture comes as often."""

INPUT_FASTEST = 0.01
"""s between two messages of the Skycontroller's inputs: anafi_ros publishes its sticks a hundred times a second."""


class Times(msgspec.Struct, frozen=True):
    """Time at which the newest field of a message was true, with the pose then; and its flavour.

    The time counts from the start of the gateway.
    """

    boot_ns: int
    boot_us: int
    boot_ms: int
    """An uint32 that wraps after 49.7 days, as on every autopilot."""
    flavour: Flavour = PX4
    pose: VehiclePose = UNKNOWN_POSE
    """Motion at that time, for a message with `from_pictures`; unknown for others."""

    def for_flavour(self, flavour: Flavour) -> Times:
        """Return the same moment for clients of another flavour."""
        return replace(self, flavour=flavour)


Builder = Callable[[Vehicle, Times], "dialect.MAVLink_message | None"]


@dataclass(frozen=True)
class MessageStream:
    """One message that a vehicle sends by itself.

    When a channel is full it gives way to answers.
    """

    build: Builder
    updates: tuple[type[Message], ...] = ()
    """The drone's events that update it. It leaves with each of them, and carries its time."""
    every: float | None = None
    """s, the shortest interval by default: what stations need to look alive, and a radio of 57600 baud can carry. None:
    the message is streamed only to a client that asks for it."""
    repeated: bool = False
    """A state message: it also leaves at its interval without an update, and then carries the time of sending. A
    message without `updates` is one in any case."""
    on_change: bool = False
    """A state message that also leaves at once when the vehicle's mode, armed or landed state changes, except to a
    client that has switched it off."""
    fastest: float = FASTEST
    """s, the shortest interval that a client gets of a message that is also repeated."""
    from_pictures: bool = False
    """True when it is made of `Times.pose`, of events or of a picture. A client that requests it by
    SET_MESSAGE_INTERVAL more often than events arrive opens the live video."""
    needs_video: bool = False
    """True when the live video runs for as long as a client has the stream: events do not report its fields. With
    `from_pictures` that client's pose is made of pictures, too, so that both have one time."""
    spared: bool = False
    """True when other streams have its values as well: on a small line it is streamed to a client that requests it."""
    flavoured: bool = False
    """True when its content depends on the flavour of the receiver."""
    is_offered: Callable[[EndpointOptions], bool] = lambda options: True
    """Returns True for endpoints whose clients get it; for the others it does not exist."""
    is_supported: Callable[[Vehicle], bool] = lambda vehicle: True
    """Returns True for drones whose model can fill it; for the others it does not exist. A value that such a drone has
    not reported is None from `build` instead."""

    @property
    def is_repeated(self) -> bool:
        """It leaves without an update, too."""
        return self.repeated or not (self.updates or self.from_pictures)
