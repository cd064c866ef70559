"""What an action that is replaced learns of it: whether a client's order has come, or something that is none."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from anafi_mav.services.command.command_service import MAX_WAITING, CommandService, RunningAction, RunningActions
from anafi_mav.services.commands import ActionGroup


@pytest.mark.parametrize("newer", ["order", "stream", "gateway"])
async def test_replaced_action_reads_if_a_command_ended_it(newer: str) -> None:
    host: Any = SimpleNamespace(spawn=asyncio.ensure_future)
    service = CommandService(host, RunningActions())
    began, learned = asyncio.Event(), []

    async def old() -> None:
        began.set()
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            learned.append(service.replaced_by_order)
            raise

    async def replace() -> None:
        await asyncio.wait(service.end_others())
        learned.append(service.replaced_by_order)

    service.run("fence", old(), is_order=False)
    await began.wait()
    if newer == "gateway":
        await replace()
    else:
        await service.run("client", replace(), is_order=newer == "order")
    assert learned == [newer == "order", False]


async def test_action_ends_older_ones_of_its_resource_alone() -> None:
    host: Any = SimpleNamespace(spawn=asyncio.ensure_future)
    service = CommandService(host, RunningActions())

    async def endless() -> None:
        await asyncio.Event().wait()

    photo = service.run("one", endless(), group=ActionGroup.PHOTO)
    zoom = service.run("one", endless(), group=ActionGroup.ZOOM)
    flight = service.run("two", endless())
    await asyncio.sleep(0)

    async def newer(group: ActionGroup) -> None:
        await asyncio.wait(service.end_others(group))

    await service.run("three", newer(ActionGroup.PHOTO), group=ActionGroup.PHOTO)
    assert [task.cancelled() for task in (photo, zoom, flight)] == [True, False, False]
    await service.run("three", newer(ActionGroup.FLIGHT))
    assert [task.cancelled() for task in (photo, zoom, flight)] == [True, False, True]
    zoom.cancel()


async def test_action_ends_older_ones_of_other_components_alone() -> None:
    host: Any = SimpleNamespace(spawn=asyncio.ensure_future)
    running = RunningActions()
    autopilot, camera = CommandService(host, running), CommandService(host, running)

    async def endless() -> None:
        await asyncio.Event().wait()

    async def panorama() -> None:
        await asyncio.wait(camera.end_others())

    older = autopilot.run("one", endless())
    turns = camera.run("two", panorama())
    newer = autopilot.run("three", endless())
    await turns
    assert [task.cancelled() for task in (older, newer)] == [True, False]
    newer.cancel()


async def test_actions_that_run_in_order_are_bounded_by_group() -> None:
    running, never = RunningActions(), asyncio.get_running_loop().create_future()
    for group in (ActionGroup.CAMERA, ActionGroup.FLIGHT):
        for _ in range(MAX_WAITING):
            assert not running.is_full(group)
            running.actions.add(asyncio.ensure_future(asyncio.wait([never])), RunningAction("client", group=group))
    assert running.is_full(ActionGroup.CAMERA)
    assert not running.is_full(ActionGroup.PHOTO)
    assert not running.is_full(ActionGroup.FLIGHT)  # newer flight commands replace older ones
