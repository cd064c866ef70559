"""The user's environment: the declared dependencies are enough, and pymavlink is for the build and the tests only.

The environment here holds the package as it is installed and the distributions that its declared dependencies name,
theirs included, in the versions installed beside it: links to them in a new virtual environment that sees nothing
else but the standard library. It proves that no other distribution is needed; that pip can resolve the requirements is
proved by an installation.
"""

from __future__ import annotations

import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from support.product import Process, program
from support.world import loopback

import anafi_mav
from anafi_mav.plans.formats import files

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

REPOSITORY = Path(__file__).parents[3]
MISSIONS = REPOSITORY / "missions"
BUILD_ONLY = ("pymavlink", "lxml")
OPTIONAL = ("anafi_mav.fabric.declaration_check", "anafi_mav.fabric.zenoh_session", "anafi_mav.web.webrtc")
"""Modules that need an extra; nothing imports them before a user asks for what they do."""
with (REPOSITORY / "pyproject.toml").open("rb") as file:
    PYPROJECT = tomllib.load(file)


def closure(name: str, extra: str = "") -> set[str]:
    """The distributions that `name` needs here, and those that they need."""
    found: set[str] = set()
    waiting = [(name, extra)]
    while waiting:
        name, extra = waiting.pop()
        for line in metadata.requires(name) or ():
            needed = Requirement(line)
            key = canonicalize_name(needed.name)
            if (needed.marker is None or needed.marker.evaluate({"extra": extra})) and key not in found:
                found.add(key)
                waiting += [(key, one) for one in needed.extras or {""}]
    return found


def top_level(name: str) -> set[Path]:
    """Files and folders of a distribution in its site-packages; scripts are left out."""
    distribution = metadata.distribution(name)
    parts = {file.parts[0] for file in distribution.files or ()} - {"..", "__pycache__"}
    return {Path(str(distribution.locate_file(part))) for part in parts}


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of an environment with the package and what it declares to need."""
    folder = tmp_path_factory.mktemp("alone")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    found = subprocess.run(
        [folder / "bin" / "python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    site = Path(found.stdout.strip())
    (site / "anafi_mav").symlink_to(Path(anafi_mav.__file__).parent)
    for path in set().union(*map(top_level, closure("anafi-mav"))):
        (site / path.name).symlink_to(path)
    return folder / "bin" / "python"


def test_pymavlink_has_one_version_in_build_and_tests() -> None:
    build = [Requirement(line) for line in PYPROJECT["build-system"]["requires"]]
    tests = [Requirement(line) for line in PYPROJECT["project"]["optional-dependencies"]["test"]]
    (build_pin,) = (str(one.specifier) for one in build if one.name == "pymavlink")
    (test_pin,) = (str(one.specifier) for one in tests if one.name == "pymavlink")
    assert build_pin == test_pin
    assert build_pin.startswith("==")
    assert build_pin == f"=={metadata.version('pymavlink')}"


def test_installed_requirements_do_not_lead_to_pymavlink() -> None:
    """The metadata of the installed package counts. Where this fails in an editable one, install it again."""
    assert not closure("anafi-mav") & set(BUILD_ONLY)
    assert {canonicalize_name(Requirement(line).name) for line in PYPROJECT["project"]["dependencies"]} <= closure(
        "anafi-mav"
    )
    assert "pymavlink" in closure("anafi-mav", "test")


@pytest.mark.parametrize("name", BUILD_ONLY)
def test_environment_of_the_package_alone_lacks_build_only_library(python: Path, name: str) -> None:
    done = subprocess.run([python, "-c", f"import {name}"], capture_output=True, text=True, cwd=python.parent)
    assert f"No module named '{name}'" in done.stderr


def test_every_module_imports_in_environment_of_the_package_alone(python: Path) -> None:
    code = """
import importlib, pkgutil, sys, anafi_mav
names = [one.name for one in pkgutil.walk_packages(anafi_mav.__path__, "anafi_mav.")]
for name in names:
    if not name.endswith("__main__") and name not in sys.argv:
        importlib.import_module(name)
print(len(names))
"""
    done = subprocess.run([python, "-c", code, *OPTIONAL], capture_output=True, text=True, cwd=python.parent)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 200


async def test_run_sim_and_plan_need_only_the_package(python: Path, tmp_path: Path) -> None:
    """`run` starts `sim` as a process of its own."""
    address, drone = loopback(), loopback()
    config = tmp_path / "fleet.yaml"
    config.write_text(f"""
        endpoints: ["tcpin://{address}:5760"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {drone}}}}}]
    """)
    home = {"XDG_STATE_HOME": str(tmp_path), "PYTHONPATH": ""}

    async def plan(*words: str | Path) -> Process:
        async with program(str(python), "-m", "anafi_mav", "plan", *map(str, words), env=home, cwd=tmp_path) as held:
            assert await held.end(timeout=90.0) == 0, str(held)
            return held

    source, url = MISSIONS / "loop.plan", f"tcpout://{address}:5760"
    shown = await plan("show", source)
    assert any("NAV_RETURN_TO_LAUNCH" in line for line in shown.lines)
    await plan("convert", source, tmp_path / "loop.mavlink", "--model", "4k")
    async with program(str(python), "-m", "anafi_mav", "run", "-c", str(config), env=home, cwd=tmp_path) as gateway:
        await gateway.line(lambda line: line.startswith("ready"))
        await plan("upload", source, "--endpoint", url)
        await plan("download", tmp_path / "down.plan", "--endpoint", url, "--sysid", "1")
        gateway.process.terminate()
        await gateway.end()
    assert files.load(tmp_path / "down.plan").items == files.load(source).items
