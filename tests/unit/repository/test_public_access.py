"""Tests of the running product use it as its users do: they touch no private attribute of it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[2]

FOLDERS = ("conformance", "clients", "interop", "support")

LIBRARY = {"os._exit", "asyncio._get_running_loop"}
"""Documented functions of the standard library."""

NAMED_TUPLE = {"_asdict", "_replace", "_fields"}
"""Public in spite of their names."""

OTHERS = {
    "support/video_server.py": {"_updated": "a class in this module"},
    "clients/dronekit_ground.py": {"_capabilities": "dronekit has no event for them"},
    "interop/olympe_base.py": {"_name_": "Olympe's enums"},
    "support/programs.py": {"_execute_child": "subprocess has no other place where a process is started for it"},
    "support/whep.py": {"_connection": "aiortc has no option for the address of its sockets"},
    "interop/olympe_device.py": {
        "_value_": "Olympe's enums",
        "_send_command_raw": "Olympe's way to send any message by its name",
    },
}
"""Attributes of libraries, by file, with the reason."""

PRODUCT = {
    "support/scripted_device.py": dict.fromkeys(
        ("_commander", "_open"), "at the end of a test nothing may wait for an answer of the drone"
    ),
    "conformance/test_extending.py": {"_CODECS": "an invented message is removed, so that no other test finds it"},
    "support/callers.py": dict.fromkeys(
        ("_act", "_return_or_hold", "_on_playing", "_expired"),
        "what acts without a client is called where its timer or task calls it: each would need a flight of its own",
    ),
}
"""Attributes of the product, by file, with the reason."""


def private_attributes(source: str) -> Iterator[tuple[int, str]]:
    """(line, name) of each private attribute of something other than `self` and `cls`, and of each private import."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute):
            if is_private(node.attr) and ast.unparse(node) not in LIBRARY and not is_own(node):
                yield node.lineno, node.attr
        elif isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in ("getattr", "setattr", "delattr", "hasattr") and len(node.args) > 1:
                named = node.args[1]
                if isinstance(named, ast.Constant) and isinstance(named.value, str) and is_private(named.value):
                    yield node.lineno, named.value
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("anafi_mav"):
            yield from ((node.lineno, alias.name) for alias in node.names if is_private(alias.name))


def is_own(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")


def is_private(name: str) -> bool:
    return name.startswith("_") and name not in NAMED_TUPLE and not (name.startswith("__") and name.endswith("__"))


def excused(file: str) -> set[str]:
    return {*OTHERS.get(file, {}), *PRODUCT.get(file, {})}


def files() -> list[Path]:
    return sorted(path for folder in FOLDERS for path in (TESTS / folder).glob("*.py"))


def test_tests_of_the_running_product_touch_no_private_attribute() -> None:
    found = []
    for path in files():
        name = path.relative_to(TESTS).as_posix()
        found += [
            f"{name}:{line}: {attribute}"
            for line, attribute in private_attributes(path.read_text(encoding="utf-8"))
            if attribute not in excused(name)
        ]
    assert found == []


@pytest.mark.parametrize("name", sorted({*OTHERS, *PRODUCT}))
def test_exception_from_public_access_is_still_needed(name: str) -> None:
    used = {attribute for _, attribute in private_attributes((TESTS / name).read_text(encoding="utf-8"))}
    assert excused(name) - used == set()


@pytest.mark.parametrize(
    ("statement", "count"),
    [
        ("w.drone._emit(1)", 1),
        ("w.gateway._supervised[0].system", 1),
        ("w.drone._body._at = 1", 2),
        ("setattr(w.drone, '_emit', print)", 1),
        ("monkeypatch.setattr(w.drone, '_emit', print)", 1),
        ("from anafi_mav.sim.drone import _later", 1),
        ("w.drone.inject(1)", 0),
        ("self._task = cls._made", 0),
        ("w.drone.__class__", 0),
    ],
)
def test_private_access_is_found_in_each_spelling(statement: str, count: int) -> None:
    assert len([*private_attributes(statement)]) == count
