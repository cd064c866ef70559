"""Containers without a daemon: the steps of docker/Dockerfile in a folder, and the services of docker/compose.yaml.

No image is built. Each absolute path of a step stands below a temporary folder. `pip` is that of a new environment, in
which the libraries of the test's own are installed already: nothing is loaded from a registry, so that only the
package is built and installed (tests/bench/pythons.py installs all of it). The image's user is in effect where the test
runs as root; it may read everything, because the interpreter may be in a home folder, and write nothing of others.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement
from support.world import loopback

from anafi_mav.cli import sim

ROOT = Path(__file__).resolve().parents[3]
DOCKER = ROOT / "docker"
LIMIT = 100.0
"""s for one step."""

Step = tuple[str, str]
"""Instruction and its arguments."""


def stages() -> dict[str, list[Step]]:
    """The steps of each stage, by its name."""
    text = re.sub(r"^\s*#.*\n", "", (DOCKER / "Dockerfile").read_text(), flags=re.MULTILINE).replace("\\\n", " ")
    found: dict[str, list[Step]] = {}
    for line in filter(str.strip, text.splitlines()):
        word, _, rest = line.partition(" ")
        if word == "FROM":
            image, _, name = rest.partition(" AS ")
            assert re.fullmatch(r"python:3\.\d+-slim", image), f"{image}: not a slim image of many processors"
            steps = found[name] = []
        else:
            steps.append((word, rest.strip()))
    return found


STAGES = stages()


def only(stage: str, word: str) -> str:
    (arguments,) = [arguments for found, arguments in STAGES[stage] if found == word]
    return arguments


def user(stage: str) -> int:
    return int(only(stage, "USER").split(":")[0])


class Image:
    """Two stages of the Dockerfile, carried out below a folder."""

    def __init__(self, root: Path) -> None:
        self.root = root
        programs = root / "python" / "bin"
        self.environment = {
            **os.environ,
            "PATH": f"{programs}:{os.environ['PATH']}",
            "PIP_NO_INDEX": "1",
            "PIP_NO_BUILD_ISOLATION": "0",  # pip reads it as the value of "build isolation"
        }
        self.place = root
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", root / "python"], check=True, timeout=LIMIT)
        (site,) = (root / "python" / "lib").glob("*/site-packages")
        for library in Path(sysconfig.get_path("purelib")).iterdir():
            if "anafi_mav" not in library.name:  # else pip finds the package installed already
                (site / library.name).symlink_to(library)
        (programs / "pip").write_text(f'#!/bin/sh\nexec "{programs}/python" -m pip "$@"\n')
        (programs / "pip").chmod(0o755)

    def under(self, text: str) -> str:
        """A step's text with its absolute paths below the folder."""
        return re.sub(r"(?<![\w.])/(src|wheels|var/lib)\b", rf"{self.root}/\1", text)

    def carry_out(self, stage: str) -> None:
        for word, arguments in STAGES[stage]:
            getattr(self, f"_{word.lower()}")(arguments)

    def _workdir(self, path: str) -> None:
        self.place = Path(self.under(path))
        self.place.mkdir()

    def _copy(self, arguments: str) -> None:
        *sources, target = arguments.split()
        allowed = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
        assert set(sources) <= allowed, "the folder that is sent to the daemon does not hold it"
        for name in sources:
            if (ROOT / name).is_dir():
                generated = shutil.ignore_patterns("__pycache__", "mav_enums.py", "dialect.py")
                shutil.copytree(ROOT / name, self.place / target, ignore=generated)
            else:
                shutil.copy(ROOT / name, self.place / target)

    def _run(self, command: str) -> None:
        command = self.under(re.sub(r"--mount=\S+\s+", "", command))
        if os.getuid():
            command = re.sub(r"-o \d+ -g \d+", "", command)  # only root gives files away
        done = subprocess.run(
            ["sh", "-ec", command], cwd=self.place, env=self.environment, capture_output=True, text=True, timeout=LIMIT
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"

    def _env(self, arguments: str) -> None:
        self.environment.update(word.split("=", 1) for word in shlex.split(self.under(arguments)))

    def _checked_elsewhere(self, arguments: str) -> None:
        pass

    _volume = _user = _healthcheck = _entrypoint = _cmd = _checked_elsewhere

    def _as_user(self, words: list[str]) -> list[str]:
        if os.getuid():
            return words
        number = user("gateway")
        rights = ["--inh-caps=-all,+dac_read_search", "--ambient-caps=+dac_read_search", "--no-new-privs"]
        return ["setpriv", f"--reuid={number}", f"--regid={number}", "--clear-groups", *rights, *words]

    def run(self, words: list[str]) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self._as_user(words), cwd="/", env=self.environment, capture_output=True, text=True, timeout=LIMIT
        )

    @contextmanager
    def started(self, *words: str) -> Iterator[subprocess.Popen[str]]:
        """The image's program with these arguments, from "ready" on."""
        entry = json.loads(only("gateway", "ENTRYPOINT"))
        with subprocess.Popen(
            self._as_user([*entry, *words]), cwd="/", env=self.environment, stdout=subprocess.PIPE, text=True
        ) as process:
            try:
                assert process.stdout is not None
                assert any(line.startswith("ready") for line in process.stdout), f"{words} ended"
                yield process
            finally:
                process.send_signal(signal.SIGTERM)


@pytest.fixture(scope="module")
def image() -> Iterator[Image]:
    # Not pytest's folder, which only its owner may enter.
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        made = Image(Path(folder))
        for stage in ("build", "gateway"):
            made.carry_out(stage)
        yield made


def composed() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((DOCKER / "compose.yaml").read_text())
    return found


def moved(text: str, here: str) -> str:
    """A text of the containers with their addresses replaced by one of this test, and by its neighbours."""
    network = here.rpartition(".")[0]
    return text.replace("127.0.42.", f"{network}.").replace("0.0.0.0", here).replace("127.0.0.1", here)


def test_services_run_from_the_image_as_its_user(image: Image) -> None:
    """Configuration check, gateway, simulated fleet and health check, with the arguments of compose.yaml."""
    here = loopback()
    services = composed()["services"]
    config = image.root / "fleet.yaml"
    config.write_text(moved((DOCKER / "fleet.yaml").read_text(), here))
    config.chmod(0o644)
    mounted = services["gateway"]["volumes"][0].split(":")[1]
    words = [str(config) if word == mounted else word for word in services["gateway"]["command"]]
    health = json.loads(only("gateway", "HEALTHCHECK").partition("CMD ")[2])
    entry = json.loads(only("gateway", "ENTRYPOINT"))

    checked = image.run([*entry, *words, "--check"])
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert "with live picture in browsers" in checked.stdout
    assert image.run(health).returncode != 0  # nothing runs

    with image.started(*[moved(word, here) for word in services["fleet"]["command"]]):
        with image.started(*words) as gateway:
            healthy = image.run([*health, "--json"])
            assert healthy.returncode == 0, healthy.stderr
            drones = json.loads(healthy.stdout)["drones"]
            assert [(drone["name"], drone["connected"]) for drone in drones] == [
                ("alpha", True), ("bravo", True), ("charlie", True)
            ]  # fmt: skip
            gateway.send_signal(signal.SIGTERM)
            assert gateway.wait(30.0) == 0  # nothing that it had to keep was lost
        assert image.run(health).returncode != 0
    state = image.root / "var" / "lib" / "anafi-mav"
    assert {path.stat().st_uid for path in (state, *state.rglob("*"))} == {os.getuid() or user("gateway")}


@pytest.mark.parametrize("stage", ["gateway", "router"])
def test_image_is_not_of_root(stage: str) -> None:
    assert user(stage) > 0
    words = [word for word, _ in STAGES[stage]]
    assert "RUN" not in words[words.index("USER") :]


def test_image_has_the_extras_of_a_gateway() -> None:
    """Without them it would refuse a zenoh:// endpoint, and show no live picture."""
    (step,) = [arguments for word, arguments in STAGES["gateway"] if word == "RUN" and "pip install" in arguments]
    extras = re.search(r"\[([\w,]+)\]", step)
    assert extras is not None
    assert set(extras[1].split(",")) == {"web", "fabric"}


def test_router_of_the_image_is_the_tested_one() -> None:
    (step,) = [arguments for word, arguments in STAGES["router"] if word == "RUN"]
    needed = Requirement(shlex.split(step)[-1])
    assert needed.specifier.contains(metadata.version(needed.name))


def test_compose_names_what_exists() -> None:
    """Services, files, ports and stages; `docker compose config` is not here to do it."""
    compose = composed()
    services = compose["services"]
    assert set(services) == {"gateway", "fleet", "router", "mediamtx"}
    for name, service in services.items():
        build = service.get("build")
        if build is not None:
            assert (DOCKER / build["context"] / build["dockerfile"]).samefile(DOCKER / "Dockerfile")
            assert build["target"] in STAGES
        assert service["image"] in {"bluenviron/mediamtx:1"} | {
            other["image"] for other in services.values() if "build" in other
        }
        assert set(service.get("depends_on", ())) <= set(services) - {name}
        for volume in service.get("volumes", ()):
            source, target = volume.split(":")[:2]
            assert (DOCKER / source).is_file() if source.startswith("./") else source in compose["volumes"]
            assert target.startswith("/")
        # Nothing is published to other computers.
        assert all(port.startswith("127.0.0.1:") for port in service.get("ports", ()))
    assert [target for _, target in _volumes(services["gateway"])][1] == only("gateway", "VOLUME")


def _volumes(service: dict[str, Any]) -> list[list[str]]:
    return [volume.split(":")[:2] for volume in service["volumes"]]


def _published(service: dict[str, Any]) -> set[str]:
    return {port.partition("/")[0].rpartition(":")[2] for port in service["ports"]}


def test_compose_ports_and_addresses_are_those_of_the_configurations() -> None:
    services = composed()["services"]
    fleet = yaml.safe_load((DOCKER / "fleet.yaml").read_text())
    (endpoint,) = fleet["endpoints"]
    assert endpoint == "tcpin://0.0.0.0:5760"
    own = {"5760", str(fleet["http"]["port"]), str(fleet["video"]["rtsp_port"])}
    assert _published(services["gateway"]) == own | {"8888"}  # that of HLS is MediaMTX's own default
    (master,) = [word for word in services["router"]["command"] if word.startswith("--master=")]
    assert master == "--master=tcp:gateway:5760"
    outs = {word.rpartition(":")[2] for word in services["router"]["command"] if word.startswith("--out=")}
    assert _published(services["router"]) == outs

    parser = argparse.ArgumentParser()
    sim.add_arguments(parser)
    word, *words = services["fleet"]["command"]
    assert word == "sim"
    given = parser.parse_args(words)
    first = given.address.rpartition(".")
    addresses = [f"{first[0]}.{int(first[2]) + index}" for index in range(int(given.count))]
    assert [drone["address"] for drone in fleet["drones"]] == addresses
    assert {(drone["http_port"], drone["rtsp_port"]) for drone in fleet["drones"]} == {
        (int(given.http_port), int(given.rtsp_port))
    }

    mediamtx = yaml.safe_load((DOCKER / "mediamtx.yml").read_text())
    # Its RTSP server would have the port of the simulated drones.
    assert [name for name in ("rtsp", "rtmp", "hls", "webrtc", "srt") if mediamtx[name]] == ["hls"]
    (pattern, path), *_ = mediamtx["paths"].items()
    # From another container it would need the gateway's token.
    assert services["mediamtx"]["network_mode"] == services["fleet"]["network_mode"] == "service:gateway"
    assert path["source"] == f"rtsp://127.0.0.1:{fleet['video']['rtsp_port']}/$G1/visible"
    assert all(re.fullmatch(pattern.removeprefix("~"), drone["name"]) for drone in fleet["drones"])
