"""Cost of a signature per frame: sent, received, and refused.

    .venv/bin/python tests/bench/signing.py

One channel and ATTITUDE, in processor time; the best of five rounds of 20 000 frames each. "without" is the same work
on a channel without a key.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from common import machine

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import SIGNED, frame, pack
from anafi_mav.mavlink.signing import Signing

ROUNDS, FRAMES = 5, 20_000
SECRET = bytes(range(32))
PACKED = pack(dialect.MAVLink_attitude_message(1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5))


def key() -> Signing:
    return Signing("bench", SECRET + bytes(8))


def channel(signing: Signing | None) -> Channel:
    made = Channel("bench", lambda raw: None, datagrams=True)
    if signing is not None:
        made.protect(signing)
    return made


def frames(signing: Signing | None) -> list[bytes]:
    """Frames of a client, each with a timestamp of its own."""
    raw = [frame(PACKED, number & 0xFF, 255, 190, 0 if signing is None else SIGNED) for number in range(FRAMES)]
    return raw if signing is None else [signing.sign(one, 9) for one in raw]


def best(prepare: Callable[[], Callable[[], None]]) -> float:
    """µs per frame."""
    times = []
    for _ in range(ROUNDS):
        work = prepare()
        begun = time.process_time()
        work()
        times.append((time.process_time() - begun) / FRAMES * 1e6)
    return min(times)


def sending(signing: Signing | None) -> Callable[[], None]:
    out = channel(signing)

    def work() -> None:
        for _ in range(FRAMES):
            out.send_packed(PACKED, 1, 1)

    return work


def receiving(sent: list[bytes], signing: Signing | None) -> Callable[[], None]:
    into = channel(signing)

    def work() -> None:
        for raw in sent:
            into.receive(raw)

    return work


def main() -> None:
    print(machine())
    plain, signed = best(lambda: sending(None)), best(lambda: sending(key()))
    print(f"sent:                 {plain:.2f} us without, {signed:.2f} us with a signature, {signed - plain:+.2f}")
    plain = best(lambda: receiving(frames(None), None))
    signed = best(lambda: receiving(frames(key()), key()))
    print(f"received:             {plain:.2f} us without, {signed:.2f} us with a signature, {signed - plain:+.2f}")
    forger = Signing("forger", bytes(reversed(SECRET)) + bytes(8))
    print(f"refused, unsigned:    {best(lambda: receiving(frames(None), key())):.2f} us")
    print(f"refused, another key: {best(lambda: receiving(frames(forger), key())):.2f} us")


if __name__ == "__main__":
    main()
