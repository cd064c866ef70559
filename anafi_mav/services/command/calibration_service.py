"""MAVLink service for ground maintenance: calibration with progress texts, and restart.

Texts are PX4's own, which QGroundControl and MAVSDK read ("[cal] ...": MAVSDK plugins/calibration, conformance B2).
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping

from anafi_mav import texts
from anafi_mav.drone.events import CalibrationAxis
from anafi_mav.drone.payload.gimbal import GimbalCalibration
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.services.commands import Action, Altitude, Command, Effect, ProgressPolicy
from anafi_mav.services.service import Service
from anafi_mav.texts import OperatorText, Subject
from anafi_mav.vehicle.base.flight_task import CommandTask, Needs, maintenance
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity

_MAGNETOMETER, _HORIZON = 1.0, 2.0
"""param2 and param5 of MAV_CMD_PREFLIGHT_CALIBRATION that can be meant for an ANAFI (MAVLink common.xml)."""

VERSION = 2
"""Of the texts, and part of the first; MAVSDK believes no other."""

RESTART_WAIT = 15.0
"""s after which a drone that was to restart should have disconnected."""

_RESTART = 1.0
"""param1 of MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN."""

_SIDES: dict[CalibrationAxis | None, tuple[str, OperatorText]] = {
    CalibrationAxis.X_AXIS: ("front", texts.CAL_ROLL),
    CalibrationAxis.Y_AXIS: ("left", texts.CAL_PITCH),
    CalibrationAxis.Z_AXIS: ("down", texts.CAL_YAW),
}
"""By the axis that the drone wants to be turned about (arsdk common.xml 0-14-2): the side that is down in PX4's picture
of that turn, and what to do with the drone in hand. QGroundControl shows the pictures of CAL_MAG_SIDES."""


Work = Callable[[], Awaitable[None]]


class CalibrationService(Service):
    """Refused with turning motors, all of it."""

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_PREFLIGHT_CALIBRATION: Action(
                self._calibrate,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.CHANGE,
                progress=ProgressPolicy.FINAL_ONLY,
            ),
            dialect.MAV_CMD_GIMBAL_REQUEST_AXIS_CALIBRATION: Action(
                lambda command: self._on_ground(command, texts.CALIBRATION, self._gimbal),
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.CHANGE,
            ),
            dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: Action(
                self._reboot,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.IRREVOCABLE,
                progress=ProgressPolicy.FINAL_ONLY,
            ),
        }

    async def _calibrate(self, command: Command) -> None:
        """Run MAV_CMD_PREFLIGHT_CALIBRATION for the magnetometer or the gimbal's horizon.

        param2 1: magnetometer; param5 2: horizon. With all parameters 0 the calibration under way ends; in the air
        there is none, and what flies is not disturbed.
        """
        values = [0.0 if math.isnan(value) else value for value in (*command.params, command.x, command.y, command.z)]
        wanted = {index: value for index, value in enumerate(values, 1) if value != 0.0}
        if not wanted:
            if self.host.vehicle.on_ground:
                # The acknowledgement precedes the text, as PX4's does: MAVSDK locks its texts until it arrives, and
                # would hang.
                ending = self._acquire(command, maintenance(texts.CALIBRATION, Needs.NONE))
                self.host.run_action(command.client, ending)
        elif wanted == {2: _MAGNETOMETER}:
            await self._magnetometer(command)
        elif wanted == {5: _HORIZON}:
            await self._horizon(command)
        else:
            # MAVSDK takes a refusal alone for a success; it believes the texts. Another client would take the text for
            # the end of its own calibration.
            channel = command.client[0] if isinstance(command.client, tuple) else None
            self.host.text(Severity.ERROR, texts.CAL_FAILED.fill(error=texts.CALIBRATIONS), channel)
            raise Refused(texts.CALIBRATION, texts.CALIBRATIONS, lasting=True)

    async def _on_ground(self, command: Command, what: Subject, work: Work) -> None:
        await self._acquire(command, maintenance(what))
        await work()

    async def _acquire(self, command: Command, task: CommandTask) -> None:
        """End what is about to fly, or is calibrated."""
        async with self.host.vehicle.control.acquire(task, by=command.right):
            pass

    @contextlib.asynccontextmanager
    async def _reported(self, undo: Callable[[], Awaitable[object]]) -> AsyncIterator[None]:
        """Send the text of a calibration that fails or is cancelled, and undo it."""
        try:
            yield
        except asyncio.CancelledError:
            self._say(texts.CAL_CANCELLED)
            await self._undone(undo)
            raise
        except AnafiMavError as error:
            self.host.text(Severity.ERROR, texts.CAL_FAILED.fill(error=error))
            await self._undone(undo)
            raise

    @staticmethod
    async def _undone(undo: Callable[[], Awaitable[object]]) -> None:
        with contextlib.suppress(AnafiMavError):  # no client waits for it, and the drone reports its state
            await undo()

    async def _magnetometer(self, command: Command) -> None:
        """Start the calibration; ACCEPTED when the drone waits to be turned, as in PX4.

        The texts report the rest. QGroundControl and MAVSDK send a command only when the one before with its number is
        answered, and the one that cancels has the same number.
        """
        await self._acquire(command, maintenance(texts.CALIBRATION))
        element = self.host.drone.calibration
        self._say(texts.CAL_STARTED.fill(version=VERSION, name="mag"))
        async with self._reported(element.abort_magnetometer):
            await element.start_magnetometer()
        self.host.run_action(command.client, self._turn())

    async def _turn(self) -> None:
        """Report the calibration of the magnetometer to its end.

        A newer command ends it on the drone, too.
        """
        element = self.host.drone.calibration
        watching = self.host.spawn(self._watch_axes())
        try:
            async with self._reported(element.abort_magnetometer):
                await element.magnetometer_done()
        except AnafiMavError:
            return  # its text was sent, and the command was acknowledged before
        finally:
            watching.cancel()
        self._say(texts.CAL_DONE.fill(name="mag"))

    async def _watch_axes(self) -> None:
        """Send the direction to turn, the finished axes and the progress, whenever one changes."""
        done: frozenset[CalibrationAxis] | None = None
        axis: CalibrationAxis | None = None
        updated = asyncio.Event()
        undo = self.host.drone.subscribe(lambda message, now: updated.set())
        try:
            while True:
                state = self.host.drone.calibration.state
                now = state.turned or frozenset()
                for finished in sorted(now - (done or frozenset())):
                    self._say(texts.CAL_SIDE_DONE.fill(side=_SIDES[finished][0]))
                if done is None or len(now) != len(done):
                    self._say(texts.CAL_PROGRESS.fill(percent=100 * len(now) // len(_SIDES)))
                if state.axis != axis and state.axis in _SIDES:
                    side, what = _SIDES[state.axis]
                    self._say(what)
                    self._say(texts.CAL_ORIENTATION.fill(side=side))
                done, axis = now, state.axis
                updated.clear()
                await updated.wait()
        finally:
            undo()

    async def _horizon(self, command: Command) -> None:
        """Start the calibration; ACCEPTED when the drone calibrates, as in PX4.

        The reason is that of the magnetometer. In flavours that take `first_answer_as_final` it is ACCEPTED at the end,
        as in ArduPilot.
        """
        if command.flavour.first_answer_as_final:
            await self._on_ground(command, texts.CALIBRATION, self._gimbal)
            return
        await self._acquire(command, maintenance(texts.CALIBRATION))
        calibration = await self._begin_gimbal()
        self.host.run_action(command.client, self._watch_gimbal(calibration))

    async def _watch_gimbal(self, calibration: GimbalCalibration) -> None:
        """Report the calibration of the gimbal, whose command was acknowledged before, to its end."""
        with contextlib.suppress(AnafiMavError):  # its text was sent
            await self._end_gimbal(calibration)

    async def _gimbal(self) -> None:
        await self._end_gimbal(await self._begin_gimbal())

    async def _begin_gimbal(self) -> GimbalCalibration:
        gimbal = self.host.drone.gimbal
        self._say(texts.CAL_STARTED.fill(version=VERSION, name="level"))
        async with self._reported(gimbal.cancel_calibration):
            return await gimbal.start_calibration()

    async def _end_gimbal(self, calibration: GimbalCalibration) -> None:
        """Report the calibration of the gimbal to its end.

        A newer command ends it on the drone, too.
        """
        async with self._reported(self.host.drone.gimbal.cancel_calibration):
            await calibration.done()
        self._say(texts.CAL_DONE.fill(name="level"))

    async def _reboot(self, command: Command) -> None:
        """MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: param1 1.

        ACCEPTED once the drone has received it, as on every autopilot.

        dronekit2 waits half a second for the acknowledgement, and the link is lost later. A text follows if it is
        not.
        """
        if command.params[0] != _RESTART:
            raise Refused(texts.RESTART, texts.RESTART_ONLY, lasting=True)
        await self._on_ground(command, texts.RESTART, self._restart)

    async def _restart(self) -> None:
        await self.host.drone.request_reboot()
        self.host.text(Severity.NOTICE, texts.DRONE_RESTARTS)
        self.host.spawn(self._watch_restart())

    async def _watch_restart(self) -> None:
        """Report a drone that received the command and stays connected.

        The loss of the link cancels this.
        """
        await asyncio.sleep(RESTART_WAIT)
        self.host.text(Severity.ERROR, texts.RESTART_FAILED)

    def _say(self, text: OperatorText) -> None:
        self.host.text(Severity.INFO, text)
