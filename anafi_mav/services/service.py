"""Interface between a MAVLink service and its host, a component of a system.

A component is the sum of its services. Each lists in tables which messages, commands and requests are its own; the host
sorts what arrives into them, and nothing else connects the two.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Protocol

from anafi_mav.clock import NEVER, Clock
from anafi_mav.drone import Drone
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import Packed
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Action, ActionGroup, Command
from anafi_mav.services.definition_link import DefinitionLink
from anafi_mav.services.dropped_inputs import InputStream
from anafi_mav.services.files import Folder, ServedFile
from anafi_mav.services.flavours import Flavour
from anafi_mav.services.gateway_uris import GatewayUris
from anafi_mav.services.memory import Memory
from anafi_mav.services.payload_history import PayloadHistory
from anafi_mav.services.pose import UNKNOWN_POSE, VehiclePose
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.services.system_position import PositionOf
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions, ValueSubscriptions
from anafi_mav.vehicle.failsafe_settings import FailsafeLimits
from anafi_mav.vehicle.operator_control import Need
from anafi_mav.vehicle.vehicle import Vehicle, VehicleStatus

LOOK_EVERY = 0.1
"""s between two looks of the services at what may have changed."""

MessageHandler = Callable[[Inbound], None]
"""Takes a message that is addressed to our autopilot, or to all systems."""

Query = Callable[[Inbound, Command], int]
"""Answers a command at once, every time it comes; returns the MAV_RESULT."""

Answer = dialect.MAVLink_message | Sequence[dialect.MAVLink_message] | int
Request = Callable[[Inbound, Command], Answer]
"""Makes the message, or messages, that MAV_CMD_REQUEST_MESSAGE asks for; or the MAV_RESULT that says why not."""


class Host(Protocol):
    """Interface of a component for its services."""

    sysid: int
    compid: int
    drone: Drone
    vehicle: Vehicle
    clock: Clock
    capabilities: int
    """MAV_PROTOCOL_CAPABILITY bits of all services of the component."""
    memory: Memory
    download_folder: Path | None
    """Folder for copies of the drone's media after a landing; None: they are not copied."""
    uris: GatewayUris
    """What the gateway serves beside MAVLink."""
    position_of: PositionOf
    """Finds the other systems of this gateway, whose messages do not arrive here."""
    has_picture_pose: bool
    """True when the configuration allows pose from the live video."""
    failsafe_limits: FailsafeLimits
    """Values beyond which a setting of the drone is reported as dangerous."""
    payload_history: PayloadHistory
    """Newest actions of camera and gimbal, of all components."""
    notices: dict[OperatorText, None]
    """Critical texts that are true whatever the drone does."""
    definition: DefinitionLink
    """Camera definition of the component."""
    camera_flags: int
    """CAMERA_CAP_FLAGS of all services of the component that do not depend on the drone."""

    @property
    def channels(self) -> Sequence[Channel]:
        """The open channels without the muted ones."""

    def send(self, message: dialect.MAVLink_message, to: Channel | Sequence[Channel] | None = None) -> None:
        """Send as this component to one channel, to some, or to all but those where it is off.

        Nothing is sent while the link is down.
        """

    def send_streams(self, messages: Sequence[Packed], to: Sequence[Channel]) -> None:
        """Send messages of streams as this component, together, to channels that have these streams.

        Nothing is sent while the link is down.
        """

    def send_heartbeat(self, status: VehicleStatus | None = None) -> None:
        """Send one more HEARTBEAT of the autopilot to all.

        `status`: that of this moment, where it is known.
        """

    def send_by_flavour(
        self, build: Callable[[Flavour], dialect.MAVLink_message | None], to: Sequence[Channel] | None = None
    ) -> None:
        """Send to each of these channels the message that `build` makes for its flavour.

        None: all that have not switched the message off. If `build` returns None, nothing is sent.
        """

    def text(self, severity: Severity, text: OperatorText, to: Channel | None = None) -> None:
        """A STATUSTEXT to all channels, and a line in the log; or to one channel alone.

        It is the autopilot's, whatever the component: every station shows those.
        """

    def warn_throttled(self, text: OperatorText) -> None:
        """Send a warning on a frequent event, at most once per five seconds.

        Such an event arrives many times a second.
        """

    def drop_input(self, client: Hashable, stream: InputStream, reason: OperatorText) -> None:
        """Note that an input of a stream is not flown; its sender alone gets a text, if due."""

    def change_objection(self, inbound: Inbound) -> OperatorText | None:
        """Return the reason for which a change that takes effect now is refused, and count it.

        None: it may be made. Another station may have become the operator since the change began.
        """

    def use_input(self, client: Hashable, stream: InputStream) -> None:
        """Note that an input of a stream is flown: what was reported of earlier ones is over."""

    def spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Run in the background; cancelled when the drone's link goes down."""

    def run_action(
        self,
        client: Hashable,
        work: Coroutine[Any, Any, None],
        *,
        is_order: bool = True,
        group: ActionGroup = ActionGroup.FLIGHT,
    ) -> asyncio.Task[None]:
        """Run an action that a message without COMMAND_ACK requests, as one of the commands.

        It replaces the active action of its group, and newer ones replace it. A refusal becomes a text.

        `is_order`: a client has commanded it; neither the gateway began it, nor a stream of setpoints."""

    def end_others(self, group: ActionGroup) -> list[asyncio.Task[None]]:
        """Cancel the system's running actions of a group.

        Those that are older than the calling one. Their senders receive CANCELLED. Returns them, to be awaited.
        """

    @property
    def replaced_by_order(self) -> bool:
        """True in an action that a newer order of a client has ended."""

    def look_soon(self) -> None:
        """Have the services tick within `LOOK_EVERY`."""

    def times(self, at: float | None = None, pose: VehiclePose = UNKNOWN_POSE) -> Times:
        """A moment of the monotonic clock (None: now) in the clock of this system's messages."""

    @property
    def needs_pictures(self) -> bool:
        """True while a client requests pose more often than events are reported."""

    @property
    def needs_video(self) -> bool:
        """True while a client has a stream whose fields are in the live video only."""

    def show_picture(self, pose: VehiclePose, shot: float, now: float) -> None:
        """Send the pose that a picture reports; `shot`: when it was taken (s, monotonic)."""

    def mark_updated(self, id: int, at: float) -> None:
        """Send a streamed message for a value that no event reports.

        `at`: when it was true (s, monotonic).
        """

    def heard_channels(self) -> list[Channel]:
        """Return the channels on which a client has been heard that is not gone."""

    def set_muted(self, channel: Channel, *, muted: bool) -> None:
        """Send only answers on this channel; with False everything again."""


def channel_of(client: Hashable) -> Channel | None:
    """Return the channel of an `Inbound.client`; None for any other value."""
    match client:
        case (Channel() as channel, _, _):
            return channel
    return None


class Service:
    """One MAVLink microservice of one component.

    Tables are read when the system is made, `subscriptions` at link up.
    """

    is_watch: ClassVar[bool] = False
    """True when `tick` ends a flight or an input, or warns: it then waits for no other drone's messages."""

    def __init__(self, host: Host) -> None:
        self.host = host

    def capabilities(self) -> int:
        """MAV_PROTOCOL_CAPABILITY bits that this service is the reason for."""
        return 0

    def camera_flags(self) -> int:
        """CAMERA_CAP_FLAGS bits that this service is the reason for."""
        return 0

    def messages(self) -> Mapping[int, MessageHandler]:
        """By message id."""
        return {}

    def denials(self) -> Mapping[int, MessageHandler]:
        """Return the answers to messages that have no effect because of their sender, by message id.

        Their endpoint does not permit them, or another station is the operator. For messages whose sender waits for an
        answer; commands are not among them. The component sends a text besides.
        """
        return {}

    def queries(self) -> Mapping[int, Query]:
        """By MAV_CMD."""
        return {}

    def actions(self) -> Mapping[int, Action]:
        """Return the rows of the commands that change the vehicle's behaviour, by MAV_CMD."""
        return {}

    def autopilot_actions(self) -> Mapping[int, Action]:
        """Return rows that the autopilot answers for this component, by MAV_CMD.

        For commands that clients address to component 1 by their definition or by habit. Of a component that has the
        command itself, it answers those to component 0.
        """
        return {}

    def item_commands(self) -> Mapping[int, MessageHandler]:
        """Return handlers of mission items that belong to no plan, by the items' `current`."""
        return {}

    def requests(self) -> Mapping[int, Request]:
        """By message id. A stream can be requested without standing here."""
        return {}

    def streams(self) -> Mapping[int, MessageStream]:
        """By message id."""
        return {}

    def files(self) -> Mapping[str, ServedFile]:
        """Return the files that MAVLink FTP serves, by path."""
        return {}

    def folders(self) -> Mapping[str, Folder]:
        """Return the folders that MAVLink FTP serves, by path."""
        return {}

    def link_up(self) -> None:
        """The drone is connected and has sent all its states."""

    def link_down(self) -> None:
        """The drone's link is gone: nothing that was asked for outlives it."""

    def subscriptions(self) -> Subscriptions:
        """Return the handlers of the drone's events, by kind.

        Read once per connection, after `link_up`.
        """
        return {}

    def value_subscriptions(self) -> ValueSubscriptions:
        """Return the handlers of events of values (`wire.value`), with their kinds.

        Read with `subscriptions`.
        """
        return {}

    def received(self, inbound: Inbound) -> None:
        """A message that names this system as its target has arrived, before it is handled.

        Called while a station is the operator, and for channels with `operator_control`.
        """

    def client_appeared(self, channel: Channel, now: float) -> None:
        """A client is heard for the first time, or after a long silence."""

    def heartbeat(self, inbound: Inbound) -> None:
        """Handle the HEARTBEAT of a ground station or any other component.

        It is the one message that every service receives. Those of observers, who control nothing, reach none.
        """

    def uses_target(self, inbound: Inbound) -> bool:
        """Return True while this target has an effect here; its message names no drone."""
        return False

    def state_changed(self) -> None:
        """Handle a change of mode, armed state, health, flying state or another awaited state."""

    def tick(self, now: float) -> float:
        """Do what is due, while the link is up; return when more is due by itself (s), or `NEVER`.

        Called at that time, once a second, and within `LOOK_EVERY` after whatever it may depend on: a message of a
        client, an event of the drone that is not one of `SAMPLES`, a change of the vehicle, the end of a task that the
        host has spawned, and `Host.look_soon`. The ticks of a watch (`is_watch`) are first; others may be some ms
        later when many drones have something due.
        """
        return NEVER

    def host_stalled(self, seconds: float) -> None:
        """Leave out a time in which no message could be read: it is no silence of a client."""

    def channel_closed(self, channel: Channel) -> None:
        """A client's channel is gone."""


def count_refusal(inbound: Inbound) -> None:
    """Count a message that is refused because another station is the operator."""
    inbound.channel.counters["refused_operator"] += 1
    inbound.channel.counters[f"refused_operator.{inbound.message.get_type()}"] += 1


def input_objection(vehicle: Vehicle, inbound: Inbound) -> OperatorText | None:
    """Return the reason for which a stick, setpoint or target is refused, and count it.

    None: it may be flown. It is refused while another station is the operator of the aircraft.
    """
    operators = vehicle.operators
    if operators.operator in (0, inbound.sysid):
        return None
    reason = operators.objection(inbound.sysid, Need.FLY)
    if reason is not None:
        count_refusal(inbound)
    return reason
