"""The thermal camera: its palette as a list of events, and every verb in the simulator."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from support.scripted_device import STATES, ScriptedDevice
from support.simulated import connected

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common, thermal
from anafi_mav.arsdk.messages.thermal import (
    PaletteMode,
    RenderingMode,
    ShutterTrigger,
    SpotType,
    ThermalMode,
)
from anafi_mav.arsdk.messages.thermal import Range as Sensitivity
from anafi_mav.drone.payload.thermal import MAX_COLOURS, Colour, Palette, Thermal
from anafi_mav.drone.settings import ANSWERED_WITHIN
from anafi_mav.errors import LocalProtocolError, NotSupported

FIRST, LAST, EMPTY = 1, 2, 4
RED, BLUE = Colour(1.0, 0.0, 0.0, 1.0), Colour(0.0, 0.0, 1.0, 0.0)


async def test_the_palette_is_a_list() -> None:
    async with ScriptedDevice() as device:
        device.script[common.AllStates] = lambda _: [
            *STATES,
            thermal.Mode(ThermalMode.DISABLED),
            thermal.PalettePart(0.0, 0.0, 1.0, 0.0, FIRST),
            thermal.PalettePart(1.0, 0.0, 0.0, 1.0, LAST),
            common.AllStatesChanged(),
        ]
        drone = device.drone()
        await drone.connect()
        assert list(drone.thermal.state.colours) == [BLUE, RED]
        heard = asyncio.ensure_future(drone.expect(thermal.PalettePart, lambda m: m.list_flags == EMPTY))
        await asyncio.sleep(0)
        # A peer without measure, then an empty list.
        device.say(*[thermal.PalettePart(0.0, 0.0, 0.0, 0.0, 0)] * (MAX_COLOURS + 10))
        full = []
        drone.subscribe(lambda message, now: full.append(len(drone.thermal.state.colours)))
        device.say(thermal.PalettePart(0.0, 0.0, 0.0, 0.0, EMPTY))
        await heard
        assert max(full) == MAX_COLOURS
        assert len(drone.thermal.state.colours) == 0
        await drone.close()


@pytest.mark.parametrize("model", ["thermal", "usa"])
async def test_in_the_simulator(model: str) -> None:
    async with connected(model) as (drone, _):
        thermal_camera = drone.thermal
        assert thermal_camera.state.mode == ThermalMode.DISABLED
        assert thermal_camera.state.modes == frozenset(ThermalMode)
        assert await thermal_camera.set_mode(ThermalMode.BLENDED) is ThermalMode.BLENDED
        assert await thermal_camera.set_rendering(RenderingMode.MONOCHROME, 0.25) == (RenderingMode.MONOCHROME, 0.25)
        assert await thermal_camera.set_rendering(RenderingMode.THERMAL) == (RenderingMode.THERMAL, 0.25)
        assert await thermal_camera.set_emissivity(0.5) == 0.5
        assert await thermal_camera.set_background(300.0) == 300.0
        assert await thermal_camera.set_sensitivity(Sensitivity.HIGH) is Sensitivity.HIGH
        assert await thermal_camera.set_shutter(ShutterTrigger.MANUAL) is ShutterTrigger.MANUAL
        thermal_camera.trigger_shutter()
        palette = Palette(PaletteMode.SPOT, 280.0, 320.0, spot=SpotType.COLD, spot_threshold=0.25)
        assert await thermal_camera.set_palette(palette) == palette
        assert thermal_camera.state.palette == palette
        assert await thermal_camera.set_colours([BLUE, RED]) == (BLUE, RED)
        for colours in ([], [RED] * (MAX_COLOURS + 1)):
            with pytest.raises(LocalProtocolError):
                await thermal_camera.set_colours(colours)
        with pytest.raises(LocalProtocolError):
            await thermal_camera.set_emissivity(float("nan"))


@pytest.mark.parametrize(
    ("call", "command", "before", "after"),
    [
        (
            lambda camera: camera.set_mode(ThermalMode.BLENDED),
            thermal.SetMode,
            thermal.Mode(ThermalMode.DISABLED),
            thermal.Mode(ThermalMode.BLENDED),
        ),
        (
            lambda camera: camera.set_emissivity(0.3),
            thermal.SetEmissivity,
            thermal.Emissivity(0.9),
            thermal.Emissivity(0.3),
        ),
        (
            lambda camera: camera.set_rendering(RenderingMode.BLENDED, 0.3),
            thermal.SetRendering,
            thermal.Rendering(RenderingMode.VISIBLE, 0.3),
            thermal.Rendering(RenderingMode.BLENDED, 0.3),
        ),
    ],
)
async def test_report_of_before_a_thermal_setting_is_not_its_answer(
    call: Callable[[Thermal], Awaitable[Any]], command: type[Message], before: Message, after: Message
) -> None:
    async with ScriptedDevice() as device:
        reported = [
            thermal.Mode(ThermalMode.DISABLED),
            thermal.Emissivity(0.9),
            thermal.Rendering(RenderingMode.VISIBLE, 0.3),
        ]
        device.script[common.AllStates] = lambda _: [*STATES, *reported, common.AllStatesChanged()]
        device.script[command] = lambda _: [before, after]
        async with device.connected() as drone:
            began = asyncio.get_running_loop().time()
            result = await call(drone.thermal)
            assert result in (ThermalMode.BLENDED, pytest.approx(0.3), (RenderingMode.BLENDED, pytest.approx(0.3)))
            assert asyncio.get_running_loop().time() - began < ANSWERED_WITHIN


async def test_a_drone_without() -> None:
    async with connected("4k") as (drone, _):
        assert drone.thermal.state.mode is None
        with pytest.raises(NotSupported):
            await drone.thermal.set_mode(ThermalMode.STANDARD)
        with pytest.raises(NotSupported):
            drone.thermal.trigger_shutter()


async def test_rendering_mode_set_at_once_with_a_share_keeps_the_share() -> None:
    async with connected("thermal") as (drone, simulator):
        camera = drone.thermal
        await asyncio.gather(
            camera.set_rendering(RenderingMode.BLENDED, 0.25), camera.set_rendering(RenderingMode.THERMAL)
        )
        assert simulator.firmware.payload.thermal is not None
        assert thermal.Rendering(RenderingMode.THERMAL, 0.25) in simulator.firmware.payload.thermal.states_report()


async def test_older_colours_reported_late_are_not_those_that_were_set() -> None:
    async with connected("thermal", speed=1.0) as (drone, simulator):
        await drone.thermal.set_colours([RED])
        simulator.faults.late = {thermal.PalettePart.NAME: 0.2}
        simulator.inject(thermal.PalettePart(1.0, 0.0, 0.0, 1.0, FIRST | LAST))
        simulator.faults.late = {thermal.PalettePart.NAME: 0.4}
        assert await drone.thermal.set_colours([BLUE, RED]) == (BLUE, RED)
