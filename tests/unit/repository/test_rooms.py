"""The law of imports. The room table of docs/architecture.md is read, and the code and the linter held against it."""

from __future__ import annotations

import ast
import functools
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

REPOSITORY = Path(__file__).parents[3]
PACKAGE = REPOSITORY / "anafi_mav"
TESTS = REPOSITORY / "tests"
UNIT = TESTS / "unit"
FOLDERS = sorted(path.parent.relative_to(PACKAGE).as_posix() for path in PACKAGE.glob("*/**/__init__.py"))
"""Of the package, as "drone/status"."""

KIT = {
    "access_token",
    "errors",
    "units",
    "geo",
    "clock",
    "disk_writer",
    "documents",
    "endpoint_options",
    "models",
    "printable",
    "receive_buffer",
    "state_lock",
    "status_record",
    "subject",
    "texts",
}
GUARDED = {"lxml", "pymavlink"}
"""Libraries of the build and the tests: no room may import them."""

CORES = [
    *("endpoint_options.py", "geo.py", "mav_enums.py", "units.py", "config/schema.py", "plans"),
    "cli/paced_calls.py",
    *("arsdk/codec", "arsdk/messages", "arsdk/video", "arsdk/mux/mux.py"),
    *("arsdk/link/frame.py", "arsdk/link/handshake.py", "arsdk/link/known_frames.py", "arsdk/link/transport.py"),
    *(
        "mavlink/access.py",
        "mavlink/address_proof.py",
        "mavlink/byte_budget.py",
        "mavlink/channel.py",
        "mavlink/frames.py",
        "mavlink/peer_table.py",
        "mavlink/plan_client.py",
        "mavlink/router.py",
        "mavlink/signing.py",
        "mavlink/streams.py",
    ),
    *("drone/contention.py", "drone/piloting/sticks.py", "drone/sent_commands.py", "drone/video/picture_clock.py"),
    "drone/video/stream_intrinsics.py",
    *("fabric/claims.py", "fabric/envelope.py", "fabric/keys.py", "fabric/sample_age.py", "fabric/settings.py"),
    "fabric/station_places.py",
    "fabric/system_state.py",
    *("relay/admission.py", "relay/dialogue.py", "relay/digest.py", "relay/feed.py", "relay/uri_host.py"),
    *("sim/autopilot/firmware.py", "sim/autopilot/flight.py", "sim/world/scramble.py"),
    *("vehicle/base/control_machine.py", "vehicle/base/height.py", "vehicle/base/right.py"),
    *("vehicle/link_loss.py", "vehicle/base/modes.py", "vehicle/base/requester.py"),
    "vehicle/base/move_heading.py",
    *("vehicle/base/roll_sign.py", "vehicle/base/severity.py", "vehicle/offboard/silence.py"),
    *("vehicle/base/subscriptions.py", "vehicle/base/velocity_loop.py", "vehicle/fence"),
    *("vehicle/mission/effects.py", "vehicle/mission/machine.py", "vehicle/mission/progress.py"),
    *("vehicle/offboard/setpoints.py", "vehicle/offboard/stream.py"),
    "vehicle/offboard/takeoff.py",
    *("vehicle/circle.py", "vehicle/follow.py", "vehicle/hold_rule.py", "vehicle/initiator.py"),
    *("vehicle/failsafe_settings.py", "vehicle/joystick_override.py", "web/h264_offer.py", "web/metrics.py"),
    *("recording/tlog.py", "recording/trace.py"),
    *("vehicle/flight_policy.py", "vehicle/operator_control.py", "vehicle/takeoff_machine.py"),
    "services/command/operator_need.py",
    *("services/capabilities.py", "services/checksum.py", "services/commands.py", "services/component_metadata.py"),
    *("services/camera/camera_messages.py", "services/camera/photo_log.py", "services/camera/pose_track.py"),
    "services/camera/shot_tracker.py",
    *("services/dropped_inputs.py", "services/gateway_uris.py"),
    *("services/camera_definition/camera_setting.py", "services/camera_definition/catalogue.py"),
    *("services/camera_definition/definition_file.py", "services/camera_definition/param_ext_codec.py"),
    "services/camera_definition/setting_fit.py",
    *("services/event/events.py", "services/ftp/ftp.py"),
    *("services/gimbal/control.py", "services/gimbal/gimbal_messages.py", "services/gimbal/mount.py"),
    *("services/gimbal/rates.py", "services/gimbal/targets.py"),
    *("services/parameter/parameter_codec.py", "services/parameter/parameter_metadata.py"),
    *("services/plan/fence_kind.py", "services/plan/item_messages.py", "services/plan/mission_kind.py"),
    *("services/plan/plan_files.py", "services/plan/plan_protocol.py", "services/plan/plan_requests.py"),
    *("services/plan/plan_transfer.py", "services/plan/rally_kind.py"),
    *("services/setpoint/setpoint_messages.py", "services/setpoint/stick_intent.py"),
    *("services/setpoint/stick_messages.py", "services/setpoint/target_messages.py"),
    *("services/telemetry/data_streams.py", "services/telemetry/height_track.py"),
    *("services/telemetry/pose_sources.py", "services/telemetry/update_tracker.py"),
]
"""Modules and folders that know neither sockets nor clocks. The list may only grow."""

GENERATED = {"mav_enums.py"}
"""Cores whose docstring is the generator's."""

NO_IO = "No I/O"
IO = {"asyncio", "socket", "time", "threading", "selectors", "subprocess"}


def read_table() -> dict[str, set[str]]:
    """{room: what it may import} as docs/architecture.md says."""
    text = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    text = text.partition("### Inside the rooms")[0]
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


class Source(NamedTuple):
    """Everything that is read of a module."""

    imports: tuple[tuple[int, str], ...]
    """(line, dotted name) of each, relative ones resolved, wherever it stands."""
    docstring: str


def source_of(path: Path) -> Source:
    """Return what is read of a file of the package."""
    return _read(path.read_text(encoding="utf-8"), "anafi_mav", *path.relative_to(PACKAGE).parent.parts)


@functools.cache
def _read(text: str, *package: str) -> Source:
    tree = ast.parse(text)
    return Source(tuple(_read_imports(tree, package)), ast.get_docstring(tree) or "")


def imports(path: Path) -> tuple[tuple[int, str], ...]:
    """Return the imports of a file of the package."""
    return source_of(path).imports


def _read_imports(tree: ast.Module, package: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
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
    speakers = {"mavlink", "vehicle", "services", "plans", "gateway_status", "gateway", "cli", "__main__"}
    assert {room for room, may in TABLE.items() if "mav_enums" in may} == speakers
    assert not GUARDED & set().union(*TABLE.values())


def test_every_module_is_in_a_room() -> None:
    strangers = [str(path) for path in modules() if room_of(path) not in {*TABLE, "__init__"}]
    assert not strangers


def test_every_room_is_there() -> None:
    missing = [room for room in TABLE if not (PACKAGE / room).is_dir() and not (PACKAGE / f"{room}.py").is_file()]
    assert not missing


def test_imports_run_along_the_table() -> None:
    assert [edge for path in modules() if room_of(path) != "__init__" for edge in edges_not_in_the_table(path)] == []


def test_package_itself_imports_no_room() -> None:
    assert [name for _, name in imports(PACKAGE / "__init__.py") if target(name)] == []


def test_command_line_is_imported_by_no_room() -> None:
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


def docstring(path: Path) -> str:
    """The docstring of a module, or of a folder."""
    return source_of(path / "__init__.py" if path.is_dir() else path).docstring


def test_core_imports_neither_sockets_nor_clocks() -> None:
    files = {core: sorted((PACKAGE / core).rglob("*.py")) or [PACKAGE / core] for core in CORES}
    found = [
        f"{core}: {file.name}:{line}: {name}"
        for core in CORES
        for file in files[core]
        for line, name in imports(file)
        if name.partition(".")[0] in IO
    ]
    assert found == []


def test_core_docstring_states_no_io() -> None:
    assert [core for core in sorted({*CORES} - GENERATED) if NO_IO not in docstring(PACKAGE / core)] == []


def test_module_stating_no_io_is_a_core() -> None:
    cores = [PACKAGE / core for core in CORES]
    claims = [path for path in modules() if NO_IO in docstring(path) or "I/O-free" in docstring(path)]
    missing = [path for path in claims if not any(path == core or core in path.parents for core in cores)]
    assert [str(path.relative_to(PACKAGE)) for path in missing] == []


LARGEST = 20
"""Modules that a folder holds at most."""

LISTS = {"arsdk/messages", "cli"}
"""Folders with one module for each item of a list: Parrot's features, the subcommands."""


def test_folder_holds_at_most_twenty_modules() -> None:
    assert len(FOLDERS) > 50
    found = {
        folder: [path.name for path in (PACKAGE / folder).glob("*.py") if path.name != "__init__.py"]
        for folder in FOLDERS
        if folder not in LISTS
    }
    assert {folder: names for folder, names in found.items() if len(names) > LARGEST} == {}


def test_folder_docstring_states_its_contents() -> None:
    assert [folder for folder in FOLDERS if not docstring(PACKAGE / folder).strip()] == []


def test_unit_tests_mirror_the_package() -> None:
    """A folder of tests has the name of the folder that it tests; `repository` tests what is around the package."""
    folders = {path.parent.relative_to(UNIT).as_posix() for path in UNIT.rglob("test_*.py")}
    assert sorted(folders - {".", "repository"} - {*FOLDERS}) == []


def test_test_modules_import_no_test_module() -> None:
    found = []
    for path in sorted(TESTS.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not re.search(r"^\s*(from|import)\s.*\b(test_\w+|conftest)\b", text, re.MULTILINE):
            continue  # parsing all of them takes 5 s
        for node in ast.walk(ast.parse(text)):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [f"{path.name}: {name}" for name in names if re.search(r"(^|\.)(test_\w+|conftest)$", name)]
    assert found == []


# Inside the rooms.


ALL = "all others"


def read_folders() -> tuple[dict[str, set[str]], dict[str, str]]:
    """({place: what it may import}, {module: its place}) as the table "Inside the rooms" says.

    A place is a folder, `x/*` for the modules directly in a folder, or some of these modules by their names.
    """
    text = (REPOSITORY / "docs" / "architecture.md").read_text(encoding="utf-8")
    part = text.partition("### Inside the rooms")[2].partition("\n## ")[0]
    law: dict[str, set[str]] = {}
    named: dict[str, str] = {}
    for line in part.splitlines():
        if line.startswith("| `"):
            names, _, allowed = line.strip("|").split("|")
            places = re.findall(r"`([\w/*]+)`", names)
            first = places[0]
            law[first] = {allowed.strip()} if ALL in allowed else set(re.findall(r"`([\w/*]+)`", allowed))
            named |= dict.fromkeys(places, first)
    for place, allowed in law.items():
        if ALL in allowed:
            room = place.partition("/")[0]
            law[place] = {other for other in law if other.startswith(f"{room}/")} - {place}
    return law, named


LAW, NAMED = read_folders()


def place_of(module: str) -> str | None:
    """The place of a module, given as "drone/status/gps"; None in a room that has no folders."""
    folder = module.rpartition("/")[0]
    for name in (module, f"{folder}/*", folder):
        if name in NAMED:
            return NAMED[name]
    return None


def folder_edges(path: Path) -> list[str]:
    module = path.relative_to(PACKAGE).with_suffix("").as_posix()
    room, place = module.partition("/")[0], place_of(module)
    if place is None:
        return []
    found = []
    for line, name in imports(path):
        parts = name.split(".")[1:] if name.startswith("anafi_mav.") else []
        if parts[:1] != [room]:
            continue
        target = "/".join(parts) if (PACKAGE / ("/".join(parts) + ".py")).is_file() else "/".join(parts[:-1])
        to = place_of(target)
        if to is not None and to != place and to not in LAW[place]:
            found.append(f"{module}:{line}: {place} may not import {name}")
    return found


def test_folders_of_divided_rooms_are_in_the_table() -> None:
    divided = {name.partition("/")[0] for name in LAW}
    assert divided == {"arsdk", "plans", "drone", "sim", "vehicle", "services"}
    missing = [
        str(path.relative_to(PACKAGE))
        for path in modules()
        if path.relative_to(PACKAGE).parts[0] in divided
        and path.name != "__init__.py"
        and place_of(path.relative_to(PACKAGE).with_suffix("").as_posix()) is None
    ]
    assert missing == []


def test_every_place_of_the_table_exists() -> None:
    for name in NAMED:
        path = PACKAGE / name.removesuffix("/*")
        assert path.is_dir() or path.with_suffix(".py").is_file(), name


def reached_from(place: str) -> set[str]:
    """Return the places that a place imports, directly or by others."""
    seen: set[str] = set()
    todo = [*LAW[place]]
    while todo:
        one = todo.pop()
        assert one in LAW, f"{place}: {one} is no place"
        if one not in seen:
            seen.add(one)
            todo += LAW[one]
    return seen


def test_places_import_each_other_one_way_only() -> None:
    assert [place for place in sorted(LAW) if place in reached_from(place)] == []


def test_imports_inside_a_room_run_along_the_table() -> None:
    files = [path for folder in FOLDERS for path in sorted((PACKAGE / folder).glob("*.py"))]
    assert [edge for path in files for edge in folder_edges(path)] == []


def test_wrong_edge_inside_a_room_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path)
    for name in ("services/plan/wrong.py", "services/command/flight_service.py", "services/commands.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("", encoding="utf-8")
    module = tmp_path / "services" / "plan" / "wrong.py"
    module.write_text("from anafi_mav.services.commands import Command", encoding="utf-8")
    assert folder_edges(module) == []
    for statement in (
        "from anafi_mav.services.command.flight_service import FORCE",
        "from anafi_mav.services.command import flight_service",
        "import anafi_mav.services.command.flight_service",
        "from ..command import flight_service",
    ):
        module.write_text(statement, encoding="utf-8")
        assert len(folder_edges(module)) == 1, statement


def test_files_of_the_newcomers_index_exist() -> None:
    text = (REPOSITORY / "docs" / "architecture.md").read_text(encoding="utf-8")
    part = text.partition("## Where does")[2].partition("|---")[2].partition("\n## ")[0]
    files = re.findall(r"`([\w/*]+(?:\.py|/))`", part)
    assert len(files) > 20
    assert [file for file in files if not [*PACKAGE.glob(file)]] == []


def test_names_of_the_newcomers_index_stand_in_their_files() -> None:
    text = (REPOSITORY / "docs" / "architecture.md").read_text(encoding="utf-8")
    part = text.partition("## Where does")[2].partition("\n## ")[0]
    pairs = re.findall(r"`(\w+)(?:\(\))?`(?: in|:) `([\w/]+\.py)`", part)
    assert len(pairs) > 8
    missing = [
        (name, file)
        for name, file in pairs
        if not re.search(
            rf"\b(?:def|class) {name}\b|^\s*{name}\b.* =", (PACKAGE / file).read_text("utf-8"), re.MULTILINE
        )
    ]
    assert missing == []


def test_linter_holds_every_room_of_services_apart() -> None:
    with (REPOSITORY / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    kept = next(
        contract["modules"] for contract in contracts if contract["name"] == "a room of services knows no other"
    )
    rooms = [f for f in FOLDERS if re.fullmatch(r"services/\w+", f)]
    assert sorted(kept) == [f"anafi_mav.{room.replace('/', '.')}" for room in rooms]


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
