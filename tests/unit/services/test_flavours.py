"""A flavour is a record: nothing but `flavours` itself asks which one it is."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import anafi_mav
from anafi_mav.endpoint_options import EndpointOptions
from anafi_mav.mavlink.channel import Channel
from anafi_mav.services.flavours import ARDUPILOT, FLAVOURS, PX4, by_flavour
from anafi_mav.services.parameter.parameter_service import NAME_TABLES, parameters_of
from anafi_mav.vehicle.base.modes import FlightMode

PACKAGE = Path(anafi_mav.__file__).parent

NAMES = {"PX4", "ARDUPILOT", "STANDARD"}


def comparisons(path: Path) -> Iterator[int]:
    """The lines that compare something with one flavour, by `is`, `==` or `in`."""
    source = path.read_text(encoding="utf-8")
    if not any(name in source for name in NAMES):
        return
    for node in ast.walk(ast.parse(source, str(path))):
        if isinstance(node, ast.Compare):
            operands = [node.left, *node.comparators]
            operands += [one for operand in operands if isinstance(operand, ast.Tuple) for one in operand.elts]
            if any(isinstance(one, ast.Name) and one.id in NAMES for one in operands):
                yield node.lineno


def test_flavour_is_never_compared_by_name() -> None:
    found = [
        f"{path.relative_to(PACKAGE)}:{line}"
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.name != "dialect.py"
        for line in comparisons(path)
    ]
    assert found == []


def test_comparison_with_a_flavour_is_seen(tmp_path: Path) -> None:
    module = tmp_path / "wrong.py"
    module.write_text("a = b is ARDUPILOT\nc = flavour not in (PX4, STANDARD)\nd = 1 == 2", encoding="utf-8")
    assert list(comparisons(module)) == [1, 2]


def test_flavour_has_the_names_of_its_record() -> None:
    for flavour in FLAVOURS.values():
        assert set(flavour.numbers) == set(FlightMode)
        assert flavour.parameter_names in NAME_TABLES
        assert parameters_of(flavour)
        assert set(flavour.modes.values()) <= set(flavour.mode_names)


def channel(flavour: str | None) -> Channel:
    return Channel("a", lambda raw: None, options=EndpointOptions(flavour=flavour))


def test_channels_are_grouped_by_their_flavour() -> None:
    one, other, third = channel(None), channel(ARDUPILOT.name), channel(PX4.name)
    assert by_flavour([one, other, third]) == [(PX4, [one, third]), (ARDUPILOT, [other])]
    assert by_flavour([]) == []


def test_channels_of_one_flavour_stay_one_list() -> None:
    channels = [channel(None), channel(PX4.name)]
    ((flavour, same),) = by_flavour(channels)
    assert flavour is PX4
    assert same is channels  # messages for one list leave together
