"""The scripts of the pages, run by Node.js in place of a browser."""

from __future__ import annotations

import asyncio
import shutil

import pytest

from anafi_mav.web.live_page import FOLDER

NODE = shutil.which("node")

STUBS = """
const texts = {};
const stub = (id) => ({
  className: "", append() {}, addEventListener() {}, classList: { toggle() {} }, replaceChildren() {},
  querySelector: () => stub(""),
  set textContent(text) { texts[id] = text; },
});
globalThis.document = { getElementById: stub, createElement: () => stub("") };
globalThis.location = { pathname: "/drone/1" };
globalThis.addEventListener = () => {};
AbortSignal.timeout = (limit) => {
  const end = new AbortController();
  setTimeout(() => end.abort(new Error(`no answer within ${limit} ms`)), 10);
  return end.signal;
};
let requests = 0;
globalThis.fetch = (path, { signal }) => requests++ ? new Promise((_, reject) => {
  signal.addEventListener("abort", () => reject(signal.reason));
}) : Promise.resolve({ ok: true, json: () => Promise.resolve(FIRST) });
setTimeout(() => { console.log(texts.problem); process.exit(); }, 1500);
"""
"""A browser with a gateway that answers the first request and then hangs, as in a network that is lost."""

STATUS = "{drones: [], endpoints: [], counters: {}, problems: [], loop_delay: {}}"


@pytest.mark.skipif(NODE is None, reason="Node.js is not installed")
@pytest.mark.parametrize(
    ("scripts", "answer"),
    [
        (("answers.js", "live.js"), "[]"),
        (("answers.js", "picture.js", "drone.js"), "[]"),
        (("answers.js", "picture.js", "status.js"), STATUS),
    ],
)
async def test_page_without_an_answer_says_since_when(scripts: tuple[str, ...], answer: str) -> None:
    assert NODE is not None
    program = STUBS.replace("FIRST", answer) + "".join((FOLDER / name).read_text() for name in scripts)
    process = await asyncio.create_subprocess_exec(NODE, "-e", program, stdout=asyncio.subprocess.PIPE)
    out, _ = await process.communicate()
    assert out.decode().startswith("No answer for 1 s, the values are of before: no answer within 3000 ms")
