"""Camera definition and extended parameters: every option of every setting, judged by the simulator's own state."""

from __future__ import annotations

import itertools
import lzma
from collections.abc import Iterable, Iterator

import pytest
from support.camera_states import MODEL_KEYS
from support.definition_readers import Described, ReadDefinition, read_definition
from support.ext_params import fetch, value_of, write
from support.ftp import Ftp
from support.mav import CAMERA, Client
from support.sim_settings import sim_value
from support.world import World, world

from anafi_mav.mavlink import dialect

ACCEPTED, UNSUPPORTED, FAILED, IN_PROGRESS = (
    dialect.PARAM_ACK_ACCEPTED,
    dialect.PARAM_ACK_VALUE_UNSUPPORTED,
    dialect.PARAM_ACK_FAILED,
    dialect.PARAM_ACK_IN_PROGRESS,
)
KINDS = {"uint8": 1, "uint32": 5, "int32": 6, "float": 9}
"""MAV_PARAM_EXT_TYPE by the name in a definition."""

DEPENDENT = {"CAM_THM_LOW": (-100.0, 10.5), "CAM_THM_HIGH": (1000.0, 150.0)}
"""Ranges of which the drone takes a part only: the lower bound of a palette is never above the upper one."""


async def load(client: Client) -> ReadDefinition:
    """The definition as a station loads it."""
    ftp = Ftp(client, component=CAMERA)
    plain = await ftp.download("/camera_definition.xml")
    assert lzma.decompress(await ftp.download("camera_definition.xml.xz")) == plain
    return read_definition(plain)


class Station:
    """A station with a definition, that follows the values."""

    def __init__(self, w: World, definition: ReadDefinition) -> None:
        self.w = w
        self.definition = definition
        self.values: dict[str, float] = {}

    async def refresh(self) -> None:
        """Read all values, until they agree with each other: events of a switch come one after the other."""
        while True:
            self.values = {name: value_of(message) for name, message in (await fetch(self.w.client)).items()}
            assert set(self.values) == set(self.definition.parameters)
            hidden = self.definition.hidden(self.values)
            shown = [one for name, one in self.definition.parameters.items() if name not in hidden and one.options]
            if all(self.values[one.name] in self.definition.options(one.name, self.values) for one in shown):
                return

    async def set(self, name: str, value: float) -> None:
        """Set a value and compare what the drone has then."""
        before = dict(self.values)
        mark = self.w.client.mark()
        one = self.definition.parameters[name]
        ack = await write(self.w.client, name, value, KINDS[one.kind])
        assert (ack.param_result, value_of(ack)) == (ACCEPTED, value), name
        assert sim_value(self.w.drone, name) == pytest.approx(value, abs=2e-6), name
        for _, message in self.w.client.since(mark, "PARAM_EXT_VALUE"):
            self.values[message.param_id] = value_of(message)
        self.values[name] = value
        if self._controls(one) or self.values != before | {name: value}:
            await self.refresh()
            assert self.values[name] == value

    @staticmethod
    def _controls(one: Described) -> bool:
        return any(option.exclusions or option.ranges for option in one.options)

    def controllers(self, name: str) -> list[str]:
        """Settings that decide about this one, those that are decided about by none first."""
        found = {name}
        while True:
            more = {
                other.name
                for other in self.definition.parameters.values()
                for option in other.options
                if found & {*option.exclusions, *(limited.target for limited in option.ranges)}
            }
            if more <= found:
                break
            found |= more
        order = {one: place for place, one in enumerate(self.definition.parameters)}
        return sorted(found - {name}, key=lambda one: (one != "CAM_THERMAL", order[one]))

    def ways(self, name: str, value: float) -> Iterator[dict[str, float]]:
        """Values of the controllers with which this one can have the value; those with the fewest changes first."""
        names = self.controllers(name)
        choices = [[option.value for option in self.definition.parameters[one].options] for one in names]
        found = []
        for values in itertools.product(*choices):
            way = dict(zip(names, values, strict=True))
            state = self.values | way
            hidden = self.definition.hidden(state)
            fits = all(way[one] in self.definition.options(one, state) for one in names if one not in hidden)
            if fits and name not in hidden and value in self.options(name, state):
                found.append(way)
        yield from sorted(found, key=lambda way: sum(self.values[one] != way[one] for one in names))

    def options(self, name: str, values: dict[str, float]) -> Iterable[float]:
        """The options now, or for a range its ends and its middle."""
        one = self.definition.parameters[name]
        if one.options:
            return self.definition.options(name, values)
        if name in DEPENDENT:
            return DEPENDENT[name]
        assert one.low is not None
        assert one.high is not None
        middle = (one.low + one.high) / 2.0
        return (one.low, one.high, one.low if one.step is None else round(middle))

    async def reach(self, name: str, value: float) -> None:
        """Set the controllers so that the value can be chosen, then the value."""
        way = next(self.ways(name, value), None)
        assert way is not None, f"{name} cannot be {value}"
        for one, wanted in way.items():
            if self.values[one] != wanted:
                await self.set(one, wanted)
        await self.set(name, value)


async def station(w: World) -> Station:
    found = Station(w, await load(w.client))
    await found.refresh()
    return found


@pytest.mark.parametrize("model", MODEL_KEYS)
async def test_conf_094_every_option_reaches_the_drone(model: str) -> None:
    async with world(model=model, speed=1.0) as w:
        ours = await station(w)
        for name in ours.definition.parameters.keys() - ours.definition.hidden(ours.values):
            assert ours.values[name] == pytest.approx(sim_value(w.drone, name), abs=2e-6), name
        for name, one in ours.definition.parameters.items():
            every = [option.value for option in one.options] or [*ours.options(name, ours.values)]
            for value in every:
                await ours.reach(name, value)
