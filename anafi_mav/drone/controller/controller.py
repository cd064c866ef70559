"""Element controller: the Skycontroller between us and the drone, and its piloting source.

It arbitrates between the Skycontroller's pilot and our user. The sticks normally have control. When a user commands
a take-off or motion, the piloting source is acquired and the four axes of the sticks are grabbed, so that stick input
of the pilot is seen; when the motion is over, both are released. A pilot who moves a stick has control at once and
keeps it until the user has sent no motion for a while. The return-home and the take-off/land button are never grabbed:
they are the pilot's. A Skycontroller takes both back by itself when the connection ends (skyctrl.xml 4-20-0).

Without a Skycontroller the state is empty, its verbs raise `NotSupported`, and motion is not restricted.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import (
    animation,
    ardrone3,
    common,
    drone_manager,
    flight_plan,
    follow_me,
    mapper,
    move,
    skyctrl,
)
from anafi_mav.arsdk.messages.drone_manager import DroneManagerConnectionState as Connection
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.messages.proto import controller_network, device_manager
from anafi_mav.arsdk.messages.skyctrl import Source
from anafi_mav.clock import Alarm
from anafi_mav.drone.controller.state import REDUCERS, ControllerState, KnownDrone
from anafi_mav.drone.element import Element, Reducer
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Commander, Expectation, loop_time
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, LinkLost, LocalProtocolError, NotSupported

log = logging.getLogger("anafi_mav")

MODELS: Mapping[int, str] = {
    0x0918: "Skycontroller 3",
    0x091C: "Skycontroller UA",
    0x091D: "Skycontroller 4",
    0x0921: "Skycontroller 4 Black",
}
"""Controllers by the number they announce themselves with; what is not here is a drone."""

PROTOBUF = frozenset({0x091D, 0x0921})
"""Those that speak protobuf too."""

YAW, THROTTLE, ROLL, PITCH, TILT, ZOOM = range(6)
"""Axes."""
STICKS = 1 << YAW | 1 << THROTTLE | 1 << ROLL | 1 << PITCH
"""The axes that are grabbed while a user flies. The wheels of camera and zoom stay the pilot's."""
RETURN_HOME, TAKEOFF_LAND, RESET_CAMERA, RESET_ZOOM = range(4)
"""Buttons; 4 to 15 are the ends of the axes."""
ALWAYS_THE_PILOTS = 1 << RETURN_HOME | 1 << TAKEOFF_LAND
"""Buttons that are never grabbed."""

DEFLECTION = 10
"""Percent beyond which a stick is meant, and not just touched."""

LOOK_EVERY = 0.1
"""s between looks whether something of ours still flies."""

QUIET_LOOKS = 5
"""Looks in a row that find no command of motion and no move under way, after which sticks and source go back: within
half a second of the end. No time, for a host that stalled sends no command either, and its task flies on."""

CLAIM_EVERY = 1.0
"""s between two attempts to give back a source, or sticks, that are ours by the Skycontroller's report only."""

GOODBYE = 0.5
"""s to wait for the controller's answer when the connection is about to be closed."""

PILOT_KEEPS = 2.0
"""s that a pilot who moved a stick keeps the drone. A user who goes on commanding without a pause does not get it
back: the time begins again with every command, so that a forgotten joystick does not win."""


class Controller(Element[ControllerState]):
    """The Skycontroller, if there is one."""

    NOTHING = ControllerState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = REDUCERS

    def __init__(
        self,
        commander: Commander,
        moving: Callable[[], bool],
        take_over: Callable[[], None] | None = None,
        stand_by: Callable[[Sequence[Message]], None] = lambda messages: None,
    ) -> None:
        """Store the callbacks for moves, for a takeover by the pilot and for a stall of the host.

        `moving` returns True while a move that a user commanded is under way; `take_over` ends the user's commands.

        `stand_by` receives the messages to send when the host stalls; an empty sequence while the axes are the
        pilot's.
        """
        super().__init__()
        self.present = False
        """There is a Skycontroller between us and the drone."""
        self.model = 0
        """Its number in `MODELS`; 0 while there is none."""
        self.taken = False
        """The user of ours flies: source and axes are taken, or about to be."""
        self.takeovers = 0
        """Times that the pilot took the drone from our user."""
        self.takeover_reason = ""
        """Why the newest of them, in two words."""
        self._confirmed = False
        """The controller has said that the source is ours."""
        self._kept = False
        """Sticks and source stay ours while nothing moves, too."""
        self._commander = commander
        self._moving = moving
        self._take_over = take_over
        self._stand_by = stand_by
        self._gave_back = -math.inf
        self._quiet_looks = 0
        self._pilot_keeps_until = -math.inf
        self._extra_axes = 0
        self._extra_buttons = 0
        """Masks of the last `grab` that the controller has confirmed."""
        self._grabbing: mapper.Grab | None = None
        """The newest `grab` while it waits for its confirmation."""
        self._watching = Alarm(self._look)

    # -- the connection

    def reset(self) -> None:
        super().reset()
        self.link_lost()

    def link_lost(self) -> None:
        """The controller has taken everything back by itself."""
        self.present = self.taken = self._confirmed = self._kept = False
        self.model = 0
        self._extra_axes = self._extra_buttons = 0
        self._pilot_keeps_until = -math.inf
        self._watching.cancel()

    def link_silent(self) -> None:
        """The Skycontroller is not heard; what it is stays known, what we took is not ours any more."""
        present, model = self.present, self.model
        self.link_lost()
        self.present, self.model = present, model

    def link_heard(self) -> None:
        """It is heard again, and may not have missed us: what we took goes back."""
        if self.present:
            self._send_back()

    # -- control

    @property
    def pilot_acquired_control(self) -> bool:
        """True while our motion is refused because the pilot acquired control.

        That lasts for `PILOT_KEEPS` s after the pilot moved a stick, and longer while our user keeps moving the
        sticks.
        """
        return self.present and loop_time() < self._pilot_keeps_until

    @property
    def pilot_has_source(self) -> bool:
        """True while the Skycontroller's sticks fly the drone, whether a pilot holds it or not.

        A source that is not reported is the pilot's: it is his after each connection (skyctrl.xml 4-20-0).
        """
        return self.present and not self.taken and self.state.source != Source.CONTROLLER

    def refuse_sticks(self) -> bool:
        """Note a deflected stick of our user; return True when it must not fly.

        That is while the pilot keeps control. The pilot's time begins again with each: a stick that is held, or a
        joystick that was forgotten, never gets the drone back.
        """
        if not self.pilot_acquired_control:
            return False
        self._pilot_keeps_until = max(self._pilot_keeps_until, loop_time() + PILOT_KEEPS)
        return True

    def allows(self, message: Message) -> bool:
        """Shown every command before it is sent.

        A command of motion takes sticks and source for our user, and so does a take-off.

        False: a stick position that must not be sent, since the pilot flies; a level one while he has the source is
        among them. Raises `CommandRejected` for any other motion then.
        """
        if not self.present:
            return True
        if isinstance(message, ardrone3.TakeOff) and not self.pilot_acquired_control:
            self._begin_motion()  # a climb follows: the pilot's stick ends it from the start of the motors on
        if not is_motion(message):
            return not (isinstance(message, ardrone3.PCMD) and self.pilot_has_source)
        if isinstance(message, ardrone3.PCMD):
            if self.refuse_sticks():
                return False
        elif self.pilot_acquired_control:
            raise CommandRejected("the pilot at the Skycontroller flies")
        self._begin_motion()
        return True

    def _begin_motion(self) -> None:
        """Take sticks and source, if they are not ours, until the motion is over."""
        self._quiet_looks = 0
        if not self.taken:
            self._take()
        if self._watching.at is None:
            self._watching.set_in(LOOK_EVERY)

    def _take(self) -> None:
        """Take sticks and source for our user."""
        self.taken, self._confirmed = True, False
        log.info("the source of piloting is ours, the axes of the Skycontroller are grabbed")
        self._commander.send(self._grab_message(self._extra_axes, self._extra_buttons))
        self._commander.send(skyctrl.SetPilotingSource(Source.CONTROLLER))
        self._stand_by(self._hand_back())

    def give_back(self) -> None:
        """Return sticks and piloting source to the pilot now; inputs of `grab` stay grabbed."""
        self._watching.cancel()
        self._kept = False
        if not self.taken:
            return
        self.taken = False
        self._send_back()
        log.info("sticks and source of piloting are given back to the pilot")

    def _send_back(self) -> None:
        self._gave_back = loop_time()
        with contextlib.suppress(LinkLost):  # then the controller does it by itself
            deliveries = [self._commander.deliver(message) for message in self._hand_back()]
            deliveries[-1].add_done_callback(self._is_back)

    def _is_back(self, delivery: asyncio.Future[None]) -> None:
        """Stand down once it is received; an Emergency may have taken its place."""
        if self.taken:
            return
        if delivery.exception() is None:
            self._stand_by(())
        else:
            self._watching.set_in(LOOK_EVERY)

    def _hand_back(self) -> tuple[Message, ...]:
        """Commands that give sticks and source back; what is grabbed by `grab` stays so."""
        return (skyctrl.SetPilotingSource(Source.SKY_CONTROLLER), mapper.Grab(self._extra_buttons, self._extra_axes))

    @property
    def hand_back_due(self) -> Sequence[Message]:
        """Commands that give the pilot sticks and source; empty while both are the pilot's."""
        return self._hand_back() if self.taken else ()

    def stalled(self) -> None:
        """The host stalled while the axes were grabbed, and they were given back for us."""
        self._yield("gateway stalled")

    async def release(self) -> None:
        """`give_back` for good, before the connection is closed.

        Waits for `GOODBYE` s at most for the controller to confirm it.
        """
        if not self.taken:
            return
        self._pilot_keeps_until = math.inf
        with contextlib.suppress(CommandTimeout, LinkLost):
            await self.hand_back(GOODBYE)

    def questions(self) -> tuple[Message, ...]:
        """Return the queries for a Skycontroller that speaks protobuf.

        Empty for other models, which do not answer.
        """
        if self.model not in PROTOBUF:
            return ()
        return (device_manager.GetState(), controller_network.GetState())

    def reactions(self) -> Mapping[type[Message], Callable[[Any, float], None]]:
        """Events to be shown to this element beyond its reducers."""
        return {
            mapper.GrabAxisEvent: self._on_axis,
            mapper.GrabState: self._on_grab,
            skyctrl.PilotingSource: self._on_source,
        }

    def _on_axis(self, message: mapper.GrabAxisEvent, now: float) -> None:
        if self.taken and STICKS >> message.axis & 1 and abs(message.value) > DEFLECTION:
            self._yield("stick moved")

    def _on_grab(self, message: mapper.GrabState, now: float) -> None:
        if not self.taken and message.axes & STICKS and loop_time() - self._gave_back >= CLAIM_EVERY:
            # By an earlier connection or another program: nothing of ours flies, and the pilot's sticks are dead.
            log.warning("the sticks of the Skycontroller were grabbed without a flight: released")
            self._send_back()

    def _on_source(self, message: skyctrl.PilotingSource, now: float) -> None:
        if not self.taken:
            if message.source == Source.CONTROLLER and loop_time() - self._gave_back >= CLAIM_EVERY:
                # Of an earlier connection: nothing of ours flies, and the pilot's sticks are dead.
                log.warning("the source of piloting was ours without a flight: given back")
                self._send_back()
        elif message.source == Source.CONTROLLER:
            self._confirmed = True
        elif self._confirmed:  # otherwise it answers a `give_back` that was followed by a new motion
            self._yield("source taken")

    def _yield(self, why: str) -> None:
        """The pilot has the drone, and what the user ordered ends."""
        log.warning("the pilot at the Skycontroller has control: %s", why)
        self.takeovers += 1
        self.takeover_reason = why
        self.give_back()
        if self._take_over is not None:
            self._take_over()
        self._pilot_keeps_until = loop_time() + PILOT_KEEPS

    def _look(self) -> None:
        """Is the motion over?"""
        if self._kept:
            return
        if not self.taken:  # the Skycontroller has not received that
            self._send_back()
            return
        self._quiet_looks = 0 if self._moving() else self._quiet_looks + 1
        if self._quiet_looks < QUIET_LOOKS:
            self._watching.set_in(LOOK_EVERY)
        else:
            self.give_back()

    def _grab_message(self, axes: int, buttons: int) -> mapper.Grab:
        """Return the command that grabs these inputs, and the sticks while they are ours."""
        return mapper.Grab(buttons, axes | (STICKS if self.taken else 0))

    # -- verbs

    async def keep(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Take sticks and piloting source until `hand_back`, also while nothing moves.

        Returns when the Skycontroller has confirmed it. The pilot's stick ends it, as it ends a motion. Raises
        `CommandRejected` while the pilot has control.
        """
        self._require()
        if self.pilot_acquired_control:
            raise CommandRejected("the pilot at the Skycontroller flies")
        self._kept = True
        if self.taken and self._confirmed:
            return
        try:
            taken = self._expect_source(Source.CONTROLLER)
            if not self.taken:
                self._take()
            taken.expire_after(timeout, skyctrl.SetPilotingSource.NAME)
            await taken.wait()
        except BaseException:
            self.keep_no_longer()
            raise
        if not self._kept:
            raise CommandRejected("the pilot at the Skycontroller flies")

    def keep_no_longer(self) -> None:
        """End `keep`: sticks and source go back to the pilot once nothing moves."""
        self._kept = False
        if self.taken and self._watching.at is None:
            self._watching.set_in(LOOK_EVERY)

    async def hand_back(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Do `give_back`, and wait for its confirmation; at once when the pilot has both."""
        if not self.taken:
            self._kept = False
            return
        back = self._expect_source(Source.SKY_CONTROLLER)
        self.give_back()
        back.expire_after(timeout, skyctrl.SetPilotingSource.NAME)
        await back.wait()

    def _expect_source(self, source: Source) -> Expectation[bool]:
        return self._commander.expect(
            (skyctrl.PilotingSource,), lambda message: True if message.source == source else None
        )

    async def grab(self, axes: int = 0, buttons: int = 0, timeout: float = ANSWER_TIMEOUT) -> None:
        """Grab axes and buttons: they are reported in the state instead of acting.

        `axes` and `buttons` are masks, bit n = number n; zeros release them. The axes of the sticks, which are
        grabbed during motion, are not changed.

        Without a confirmation what was grabbed before stays so. Raises `LocalProtocolError` for the sticks, which are
        grabbed by motion alone, and for the buttons that stay the pilot's.
        """
        self._require()
        if axes & ~(1 << TILT | 1 << ZOOM):
            raise LocalProtocolError("the sticks are grabbed while a user flies and not otherwise")
        if buttons & ALWAYS_THE_PILOTS or not 0 <= buttons <= 0xFFFF:
            raise LocalProtocolError("return home and take-off/land are the pilot's buttons")
        wanted = self._grabbing = self._grab_message(axes, buttons)
        try:
            await self._commander.confirm(
                wanted,
                (mapper.GrabState,),
                lambda message: True if (message.buttons, message.axes) == (wanted.buttons, wanted.axes) else None,
                timeout,
            )
        except BaseException:
            if self._grabbing is wanted:  # the command may have been received all the same
                with contextlib.suppress(AnafiMavError):
                    self._commander.send(self._grab_message(self._extra_axes, self._extra_buttons))
            raise
        else:
            current = self._grab_message(axes, buttons)
            if current != wanted:  # the sticks were taken or given back meanwhile, which sent the former masks
                self._commander.send(current)
            self._extra_axes, self._extra_buttons = axes, buttons
            if self.taken:
                self._stand_by(self._hand_back())
        finally:
            if self._grabbing is wanted:
                self._grabbing = None

    async def discover_drones(self, timeout: float = ANSWER_TIMEOUT) -> Mapping[str, KnownDrone]:
        """Search for drones; return those in sight, by serial number."""
        self._require()
        if self.state.protobuf:
            await self._commander.confirm(
                device_manager.DiscoverDevices(), (device_manager.DiscoveredDevices,), lambda message: True, timeout
            )
            return self.state.visible
        last = 1 << ListFlags.LAST | 1 << ListFlags.EMPTY
        await self._commander.confirm(
            drone_manager.DiscoverDrones(),
            (drone_manager.DroneListItem,),
            lambda message: True if message.list_flags & last else None,
            timeout,
        )
        return self.state.visible

    async def connect_drone(self, serial: str, key: str = "", timeout: float = 30.0) -> None:
        """Connect the Skycontroller to another drone.

        Its connection to this program ends: connect again.
        """
        self._require()

        if self.state.protobuf:
            await self._connect_device(serial, key, timeout)
            return

        def judge(message: Any) -> bool | AnafiMavError | None:
            if message.serial != serial:
                return None
            if isinstance(message, drone_manager.AuthenticationFailed):
                return CommandRejected("the passphrase is wrong")
            if isinstance(message, drone_manager.ConnectionRefused):
                return CommandRejected("the drone refuses the controller")
            return True if message.state == Connection.CONNECTED else None

        answers = (
            drone_manager.ConnectionState,
            drone_manager.AuthenticationFailed,
            drone_manager.ConnectionRefused,
        )
        await self._commander.confirm(drone_manager.Connect(serial, key), answers, judge, timeout)

    async def _connect_device(self, serial: str, key: str, timeout: float) -> None:
        def judge(message: Any) -> bool | AnafiMavError | None:
            if isinstance(message, device_manager.State):
                connected = self.state.link == Connection.CONNECTED and self.state.drone_serial == serial
                return True if connected else None
            if message.device is None or message.device.uid != serial:
                return None
            wrong = message.reason == device_manager.ConnectionFailureReason.AUTHENTICATION_FAILED
            return CommandRejected("the passphrase is wrong" if wrong else "the drone refuses the controller")

        wifi = device_manager.ConnectDeviceWifi(security_key=key)
        answers = (device_manager.State, device_manager.ConnectionFailure)
        await self._commander.confirm(device_manager.ConnectDevice(uid=serial, wifi=wifi), answers, judge, timeout)

    async def forget_drone(self, serial: str, timeout: float = ANSWER_TIMEOUT) -> None:
        """Remove a drone from those the Skycontroller knows."""
        self._require()
        if serial not in self.state.known:
            raise CommandRejected(f"the Skycontroller knows no drone {serial}")
        modern = self.state.protobuf
        await self._commander.confirm(
            device_manager.ForgetDevice(uid=serial) if modern else drone_manager.Forget(serial),
            (device_manager.State if modern else drone_manager.KnownDroneItem,),
            lambda message: True if serial not in self.state.known else None,
            timeout,
        )

    def _require(self) -> None:
        if not self.present:
            raise NotSupported("Skycontroller")


_ANIMATIONS = animation.Cancel.ID.project

_MOVES: frozenset[type[Message]] = frozenset(
    {
        flight_plan.StartAt,
        flight_plan.StartAtV2,
        ardrone3.MoveTo,
        move.ExtendedMoveTo,
        ardrone3.StartPilotedPOI,
        ardrone3.StartPilotedPOIV2,
        common.Start,
        follow_me.Start,
        move.ExtendedMoveBy,
    }
)


def is_motion(message: Message) -> bool:
    """Return True when this command moves the drone.

    Centring the sticks does not, and neither do commands that stop, land, take off or return: the pilot's sticks do
    not conflict with these.
    """
    kind = type(message)  # isinstance takes some ten times as long for these classes
    if kind in _MOVES:
        return True
    if isinstance(message, ardrone3.PCMD):
        return bool(message.roll or message.pitch or message.yaw or message.gaz)
    if isinstance(message, ardrone3.MoveBy):
        return bool(message.dX or message.dY or message.dZ or message.dPsi)
    return message.ID.project == _ANIMATIONS and kind is not animation.Cancel
