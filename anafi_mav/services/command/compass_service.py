"""ArduPilot's compass calibration: DO_START_MAG_CAL, DO_ACCEPT_MAG_CAL, DO_CANCEL_MAG_CAL.

An ANAFI calibrates one compass, about one axis after the other, and stores the result by itself. Progress and result
are MAG_CAL_PROGRESS and MAG_CAL_REPORT, which MAVProxy, Mission Planner and QGroundControl show. PX4's way is in
`calibration_service`.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Mapping

from anafi_mav import texts
from anafi_mav.drone.events import CalibrationAxis
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.services.commands import Action, Altitude, Command, Effect
from anafi_mav.services.service import Host, Service
from anafi_mav.vehicle.base.flight_task import maintenance
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity

COMPASS_MASK = 1
"""param1 is a bit mask of compasses, 0 for all. There is the first one only."""

LARGEST_MASK = 255

AXES: dict[CalibrationAxis | None, str] = {
    CalibrationAxis.X_AXIS: texts.AXIS_ROLL,
    CalibrationAxis.Y_AXIS: texts.AXIS_PITCH,
    CalibrationAxis.Z_AXIS: texts.AXIS_YAW,
}
"""How to turn the drone in the hand, by the axis that it reports (arsdk common.xml 0-14-2)."""

_UNKNOWN = math.nan
_OFFSETS = (math.nan,) * 9
"""Offsets, diagonals and off-diagonals of a report."""


class CompassService(Service):
    """The compass calibration that a client starts, accepts or cancels."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._turning: asyncio.Task[None] | None = None
        """The calibration under way."""
        self._succeeded = False
        """The last one succeeded, and no other was started."""

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_DO_START_MAG_CAL: Action(
                self._start, location=False, altitude=Altitude.UNUSED, effect=Effect.CHANGE
            ),
            dialect.MAV_CMD_DO_ACCEPT_MAG_CAL: Action(
                self._accept, location=False, altitude=Altitude.UNUSED, effect=Effect.CHANGE
            ),
            dialect.MAV_CMD_DO_CANCEL_MAG_CAL: Action(
                self._cancel, location=False, altitude=Altitude.UNUSED, effect=Effect.CHANGE
            ),
        }

    def link_down(self) -> None:
        self._turning, self._succeeded = None, False

    async def _start(self, command: Command) -> None:
        """ACCEPTED when the drone waits to be turned, as in ArduPilot, not at the end.

        Retry, delay and restart of the command (param2, 4, 5) are ArduPilot's own and ignored: the drone starts at
        once and does not restart.
        """
        _check_mask(command)
        async with self.host.vehicle.control.acquire(maintenance(texts.COMPASS_CALIBRATION), by=command.right):
            pass
        self._succeeded = False
        await self.host.drone.calibration.start_magnetometer()
        self._turning = self.host.run_action(command.client, self._turn())

    async def _accept(self, command: Command) -> None:
        """Accept: nothing to do, because the drone has stored the result by itself."""
        _check_mask(command)
        if not self._succeeded:
            raise Refused(texts.COMPASS_CALIBRATION, texts.NOT_CALIBRATED)

    async def _cancel(self, command: Command) -> None:
        """Cancel; ACCEPTED without a calibration under way, too, as in ArduPilot."""
        _check_mask(command)
        turning = self._turning
        if turning is not None and not turning.done():
            turning.cancel()
            await asyncio.wait([turning])

    async def _turn(self) -> None:
        """Report the calibration to its end.

        A newer command, or DO_CANCEL_MAG_CAL, ends it on the drone too.
        """
        drone = self.host.drone
        progress = self.host.spawn(self._report_progress())
        try:
            await drone.calibration.magnetometer_done()
        except (AnafiMavError, asyncio.CancelledError) as error:
            cancelled = isinstance(error, asyncio.CancelledError)
            with contextlib.suppress(AnafiMavError):
                await drone.calibration.abort_magnetometer()
            self._report(dialect.MAG_CAL_NOT_STARTED if cancelled else dialect.MAG_CAL_FAILED)
            if cancelled:
                self.host.text(Severity.NOTICE, texts.COMPASS_CANCELLED)
                raise
            self.host.text(Severity.ERROR, texts.COMPASS_FAILED.fill(error=error))
        else:
            self._succeeded = True
            self._report(dialect.MAG_CAL_SUCCESS)
            self.host.text(Severity.NOTICE, texts.COMPASS_DONE)
        finally:
            progress.cancel()

    async def _report_progress(self) -> None:
        """Send MAG_CAL_PROGRESS, and how to turn the drone, whenever that changes."""
        reported: tuple[CalibrationAxis | None, int] | None = None
        updated = asyncio.Event()
        unsubscribe = self.host.drone.subscribe(lambda message, now: updated.set())
        try:
            while True:
                state = self.host.drone.calibration.state
                now = (state.axis, len(state.turned or ()))
                if now != reported:
                    self._send_progress(now[1])
                    if now[0] in AXES and (reported is None or now[0] != reported[0]):
                        self.host.text(Severity.NOTICE, texts.COMPASS_TURN.fill(axis=AXES[now[0]]))
                reported = now
                updated.clear()
                await updated.wait()
        finally:
            unsubscribe()

    def _send_progress(self, axes: int) -> None:
        self.host.send(
            dialect.MAVLink_mag_cal_progress_message(
                0,
                COMPASS_MASK,
                dialect.MAG_CAL_RUNNING_STEP_ONE,
                1,
                100 * axes // len(AXES),
                [0] * 10,
                _UNKNOWN,
                _UNKNOWN,
                _UNKNOWN,
            )
        )

    def _report(self, status: int) -> None:
        """MAG_CAL_REPORT. The drone reports no offsets: NaN."""
        saved = int(status == dialect.MAG_CAL_SUCCESS)
        self.host.send(dialect.MAVLink_mag_cal_report_message(0, COMPASS_MASK, status, saved, _UNKNOWN, *_OFFSETS))


def _check_mask(command: Command) -> None:
    mask = 0.0 if math.isnan(command.params[0]) else command.params[0]
    if not 0.0 <= mask <= LARGEST_MASK or not mask.is_integer() or (mask and not int(mask) & COMPASS_MASK):
        raise Refused(texts.COMPASS_CALIBRATION, texts.PARAM1_BINARY, lasting=True)
