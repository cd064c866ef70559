"""The scripts of the pages, run by Node.js in place of a browser."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
from typing import Any

import pytest

from anafi_mav.web.live_page import FOLDER

NODE = shutil.which("node")

pytestmark = pytest.mark.skipif(NODE is None, reason="Node.js is not installed")

BROWSER = """
class Stub {
  constructor() { this.children = []; this.className = ""; this.textContent = ""; this.classList = { toggle() {} }; }
  append(...parts) { for (const part of parts) { this.children.push(part); part.parent = this; } }
  replaceChildren(...parts) { this.children = []; this.append(...parts); }
  remove() { this.parent.children.splice(this.parent.children.indexOf(this), 1); }
  querySelector(selector) { return this.children.find((child) => "." + child.className === selector); }
  addEventListener() {}
}
const named = new Map();
globalThis.document = {
  createElement: () => new Stub(),
  getElementById(id) { if (!named.has(id)) named.set(id, new Stub()); return named.get(id); },
};
globalThis.location = { pathname: "/drone/1" };
globalThis.addEventListener = () => {};
AbortSignal.timeout = (limit) => {
  const end = new AbortController();
  setTimeout(() => end.abort(new Error(`no answer within ${limit} ms`)), 10);
  return end.signal;
};
globalThis.fetch = (path, { signal }) => ANSWERS.length
  ? Promise.resolve({ ok: ANSWERS[0] !== REFUSED, status: 401, json: () => Promise.resolve(ANSWERS.shift()) })
  : new Promise((_, reject) => { signal.addEventListener("abort", () => reject(signal.reason)); });
setTimeout(() => {
  const names = document.getElementById("drones").children.map((item) => item.querySelector(".name").textContent);
  console.log(JSON.stringify({ problem: document.getElementById("problem").textContent, names }));
  process.exit();
}, LENGTH);
"""
"""A browser whose gateway gives these answers, and then none, as in a network that is lost."""


REFUSED = "refused"
"""In place of an answer: the gateway refuses every request from then on, for want of its token."""


async def shown(scripts: tuple[str, ...], answers: list[Any], length: float) -> dict[str, Any]:
    """Return what a page shows after `length` s: its problem, and the names of the drones in its list."""
    assert NODE is not None
    values = f"ANSWERS = {json.dumps(answers)}, REFUSED = {json.dumps(REFUSED)}, LENGTH = {length * 1000.0}"
    program = f"const {values};" + BROWSER
    program += "".join((FOLDER / name).read_text() for name in scripts)
    process = await asyncio.create_subprocess_exec(NODE, "-e", program, stdout=asyncio.subprocess.PIPE)
    out, _ = await process.communicate()
    found: dict[str, Any] = json.loads(out)
    return found


def status(*names: str) -> dict[str, Any]:
    """A record with drones that are not connected."""
    commands = {"latency": {"count": 0}, "refused": []}
    drones = [
        {"name": name, "sysid": sysid, "connected": False, "warnings": [], "commands": commands, "stream": ""}
        for sysid, name in enumerate(names, 1)
    ]
    return {"drones": drones, "endpoints": [], "counters": {}, "problems": [], "loop_delay": {"count": 0}}


LIST, DRONE, STATUS = (
    ("answers.js", "live.js"),
    ("answers.js", "picture.js", "drone.js"),
    ("answers.js", "picture.js", "status.js"),
)


@pytest.mark.parametrize(("scripts", "answer"), [(LIST, []), (DRONE, []), (STATUS, status())])
async def test_page_without_an_answer_says_since_when(scripts: tuple[str, ...], answer: Any) -> None:
    found = await shown(scripts, [answer], 1.5)
    assert found["problem"].startswith("No answer for 1 s, the values are of before: no answer within 3000 ms")


@pytest.mark.parametrize(("scripts", "answer"), [(LIST, []), (DRONE, []), (STATUS, status())])
async def test_page_whose_requests_are_refused_says_so(scripts: tuple[str, ...], answer: Any) -> None:
    found = await shown(scripts, [answer, REFUSED], 2.5)
    assert re.fullmatch(r"Requests are refused for \d s, the values are of before: status 401", found["problem"])


@pytest.mark.parametrize(
    ("scripts", "answers", "names"),
    [
        (LIST, [status("alpha", "bravo")["drones"], status("alpha")["drones"]], ["alpha"]),
        (STATUS, [status("alpha", "bravo"), status("alpha")], ["alpha (system 1)"]),
    ],
)
async def test_page_drops_a_drone_that_the_gateway_no_longer_has(
    scripts: tuple[str, ...], answers: list[Any], names: list[str]
) -> None:
    assert (await shown(scripts, answers, 1.5))["names"] == names
