"""Wheels and buttons of the Skycontroller that clients read instead of the drone."""

from __future__ import annotations

import asyncio

from anafi_mav.drone.controller.controller import RESET_CAMERA, RESET_ZOOM, TILT, ZOOM, Controller

WHEELS = 1 << TILT | 1 << ZOOM
"""Axes of the two wheels."""
BUTTONS = 1 << RESET_CAMERA | 1 << RESET_ZOOM
"""The two buttons at the back. Return home and take-off/land are always the pilot's."""


class ControllerInputs:
    """Grabs wheels and buttons on request, and again after each connection.

    A grabbed input is reported and does not move camera or zoom.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._axes = self._buttons = 0
        """Masks that clients requested."""
        self._changing = asyncio.Lock()

    @property
    def are_requested(self) -> bool:
        """True when a client has requested wheels or buttons."""
        return bool(self._axes or self._buttons)

    @property
    def wheels(self) -> bool | None:
        """True while the wheels are grabbed, as the Skycontroller reports it; None: unknown."""
        return _has(self._controller.state.grabbed_axes, WHEELS)

    @property
    def buttons(self) -> bool | None:
        """True while the buttons are grabbed, as the Skycontroller reports it; None: unknown."""
        return _has(self._controller.state.grabbed_buttons, BUTTONS)

    async def request_wheels(self, wanted: bool) -> None:
        """Grab or release the wheels; return when the Skycontroller confirmed it."""
        async with self._changing:
            await self._grab(WHEELS if wanted else 0, self._buttons)

    async def request_buttons(self, wanted: bool) -> None:
        """Grab or release the buttons; return when the Skycontroller confirmed it."""
        async with self._changing:
            await self._grab(self._axes, BUTTONS if wanted else 0)

    async def restore(self) -> None:
        """Grab again what clients requested.

        A Skycontroller releases everything when a connection ends.
        """
        async with self._changing:
            await self._grab(self._axes, self._buttons)

    async def _grab(self, axes: int, buttons: int) -> None:
        await self._controller.grab(axes, buttons)
        self._axes, self._buttons = axes, buttons


def _has(grabbed: int | None, mask: int) -> bool | None:
    return None if grabbed is None else grabbed & mask == mask
