"""The law of imports. The room table of docs/architecture.md is read, and the code and the linter held against it."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

REPOSITORY = Path(__file__).parents[3]
PACKAGE = REPOSITORY / "anafi_mav"

KIT = {"errors", "units", "geo", "clock", "documents", "models", "printable", "state_lock", "subject", "texts"}
GUARDED = {"lxml", "pymavlink"}
"""Libraries of the build and the tests: no room may import them."""

CORES = [
    "arsdk/codec/wire.py",
    "arsdk/messages",
    "arsdk/link/frame.py",
    "arsdk/link/packing.py",
    "arsdk/link/transport.py",
]
CORES += [
    "arsdk/video/video_metadata.py",
    "arsdk/video/video_metadata_proto.py",
    "arsdk/video/rtp.py",
    "arsdk/video/rtp_h264.py",
]
CORES += ["arsdk/video/rtcp.py", "arsdk/video/rtp_reception.py", "arsdk/video/rtsp.py", "arsdk/video/sdp.py"]
CORES += ["arsdk/link/handshake.py", "mavlink/frames.py", "mavlink/router.py", "mavlink/streams.py", "plans"]
CORES += ["vehicle/mission/course.py", "vehicle/mission/progress.py"]
CORES += [
    "vehicle/base/modes.py",
    "vehicle/offboard/stream.py",
    "vehicle/base/height.py",
    "units.py",
    "geo.py",
    "config/schema.py",
]
CORES += ["mav_enums.py"]
IO = {"asyncio", "socket", "time", "threading", "selectors", "subprocess"}


def read_table() -> dict[str, set[str]]:
    """{room: what it may import} as docs/architecture.md says."""
    text = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| `")]
    table: dict[str, set[str]] = {}
    for names, _, allowed in rows:
        may = set(re.findall(r"`(\w+)`", allowed))
        if re.search(r"\bkit\b", allowed):
            may |= KIT
        for room in re.findall(r"`(\w+)`", names):
            table[room] = may
    for names, _, allowed in rows:
        if "every room" in allowed:
            for room in re.findall(r"`(\w+)`", names):
                table[room] = set(table)
    return table


TABLE = read_table()


def modules() -> list[Path]:
    return sorted(path for path in PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str:
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix(".py")


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of each import in a file of the package, relative ones resolved, wherever it stands."""
    package = ["anafi_mav", *path.relative_to(PACKAGE).parent.parts]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), str(path))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                yield node.lineno, f"{module}.{alias.name}"


def target(name: str) -> str | None:
    """The room or guarded library that an imported name belongs to; None for what is free."""
    top, _, rest = name.partition(".")
    if top == "anafi_mav":
        first = rest.partition(".")[0]
        return None if first in ("", "__version__") else first
    return top if top in GUARDED else None


def edges_not_in_the_table(path: Path) -> list[str]:
    room = room_of(path)
    return [
        f"{path.relative_to(REPOSITORY)}:{line}: {room} may not import {name}"
        for line, name in imports(path)
        if (to := target(name)) is not None and to != room and to not in TABLE[room]
    ]


def test_the_table_was_read() -> None:
    assert TABLE["errors"] == KIT
    assert TABLE["drone"] == KIT | {"arsdk"}
    assert TABLE["sim"] == KIT | {"arsdk"}
    assert TABLE["plans"] == KIT | {"mav_enums"}
    assert TABLE["vehicle"] == KIT | {"mav_enums", "drone", "plans"}
    assert TABLE["mav_enums"] == set()
    assert TABLE["gateway"] == set(TABLE) - {"gateway", "cli", "__main__", "sim"}
    speakers = {"mavlink", "vehicle", "services", "plans", "gateway", "cli", "__main__"}
    assert {room for room, may in TABLE.items() if "mav_enums" in may} == speakers
    assert not GUARDED & set().union(*TABLE.values())


def test_every_module_is_in_a_room() -> None:
    strangers = [str(path) for path in modules() if room_of(path) not in {*TABLE, "__init__"}]
    assert not strangers


def test_every_room_is_there() -> None:
    missing = [room for room in TABLE if not (PACKAGE / room).is_dir() and not (PACKAGE / f"{room}.py").is_file()]
    assert not missing


@pytest.mark.parametrize(
    "path", [p for p in modules() if room_of(p) != "__init__"], ids=lambda p: str(p.relative_to(PACKAGE))
)
def test_imports_run_along_the_table(path: Path) -> None:
    assert edges_not_in_the_table(path) == []


def test_the_package_itself_imports_no_room() -> None:
    assert [name for _, name in imports(PACKAGE / "__init__.py") if target(name)] == []


def test_nobody_imports_the_command_line() -> None:
    assert [room for room, may in TABLE.items() if "cli" in may] == ["cli", "__main__"]


def test_a_wrong_edge_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each way to write an import, in a module that may not have it."""
    module = tmp_path / "anafi_mav" / "sim" / "wrong.py"
    module.parent.mkdir(parents=True)
    monkeypatch.setitem(globals(), "REPOSITORY", tmp_path)
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path / "anafi_mav")
    for statement in (
        "import anafi_mav.drone",
        "from anafi_mav.drone.status.home import Home",
        "from anafi_mav import drone",
        "from ..drone import Drone",
        "from .. import drone",
        "def f():\n    from anafi_mav import drone",
        "import pymavlink.mavutil",
        "from anafi_mav import mav_enums",
    ):
        module.write_text(statement, encoding="utf-8")
        assert len(edges_not_in_the_table(module)) == 1, statement
    module.write_text(
        "import anafi_mav\nfrom anafi_mav import __version__, units\nfrom . import motion", encoding="utf-8"
    )
    assert edges_not_in_the_table(module) == []


@pytest.mark.parametrize("core", CORES)
def test_cores_know_neither_sockets_nor_clocks(core: str) -> None:
    path = PACKAGE / core
    files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
    assert files
    found = [
        f"{file.name}:{line}: {name}" for file in files for line, name in imports(file) if name.partition(".")[0] in IO
    ]
    assert found == []


def test_the_linter_has_the_same_table() -> None:
    """Each room has a contract in pyproject.toml that forbids exactly what the table does not allow. One contract for
    the whole package keeps the guarded libraries out."""
    with (REPOSITORY / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    found = {}
    for contract in contracts:
        for source in contract.get("source_modules", []):
            room = source.removeprefix("anafi_mav.")
            if "." not in room:  # else it is about the inside of a room
                assert contract["type"] == "forbidden"
                found[room] = {name.removeprefix("anafi_mav.") for name in contract["forbidden_modules"]}
    assert found.pop("anafi_mav") == GUARDED
    wanted = {room: forbidden for room, may in TABLE.items() if (forbidden := set(TABLE) - may - {room, "__main__"})}
    assert found == wanted
