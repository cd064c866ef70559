"""How likely it is that MAVSDK uploads 500 items over a link that loses some of all frames, each way; no measurement.

    .venv/bin/python tests/bench/lossy_uploads.py [LOSS ...]

MAVSDK (mavlink_mission_transfer_client.cpp, 158e33932) counts the items that it has sent and the half seconds in which
it has heard no request. At five it gives up: at the next request of an item that it has sent already, or at the end of
the next such half second. A request of exactly the item after the one that it has sent last sets the count to one, one
of a later item is not heard. Its count and that item are a Markov chain, which is followed here round by round, each
with the requests that the gateway makes. tests/support/plan_counting.py is the same machine, played message by message
against the gateway's own.

A message is lost or not whatever became of others, and takes no time.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable, Sequence

from anafi_mav.services.plan.plan_requests import REQUEST_EVERY, asked_for

LIMIT, HALF_SECOND = 5, 0.5
ROUNDS = 40
"""Of which no one needs all: an item that has not come after five seconds is abandoned by the gateway."""

Steps = Callable[[int], Sequence[int]]
"""What the n-th request of an item asks for, relative to it."""

State = tuple[int, int, float]
"""MAVSDK's count, the item that it expects to be asked for relative to the missing one, and s since a request."""


def plain(number: int) -> Sequence[int]:
    return (0,)


def ours(number: int) -> Sequence[int]:
    return asked_for(number + 1, is_last=False)


def last(number: int) -> Sequence[int]:
    return asked_for(number + 1, is_last=True)


def heard(state: State, step: int) -> State | None:
    """After a request; None: it gives up."""
    count, expected, _ = state
    if step > expected:
        return state
    if step < expected and count >= LIMIT:
        return None
    return 1 if step == expected else count + 1, step + 1, 0.0


def item(start: dict[State, float], loss: float, steps: Steps, every: float) -> tuple[dict[State, float], float]:
    """The states in which MAVSDK is when an item has come, and the probability that it gives up before."""
    waiting, come, given_up = dict(start), defaultdict[State, float](float), 0.0
    for number in range(ROUNDS):
        done: dict[State, float] = defaultdict(float)
        for step in steps(number):
            open_, done_ = defaultdict[State, float](float), defaultdict[State, float](float)
            for states, came in ((waiting, False), (done, True)):
                for state, share in states.items():
                    (done_ if came else open_)[state] += share * loss
                    after = heard(state, step)
                    if after is None:
                        given_up += share * (1.0 - loss)
                        continue
                    answered = step == 0 and after is not state
                    arrives = 1.0 if came else (1.0 - loss) * answered
                    done_[after] += share * (1.0 - loss) * arrives
                    open_[after] += share * (1.0 - loss) * (1.0 - arrives)
            waiting, done = open_, done_
        for state, share in done.items():
            come[state] += share
        later: dict[State, float] = defaultdict(float)
        for (count, expected, silent), share in waiting.items():
            silent, gone = silent + every, False
            while silent >= HALF_SECOND - 1e-9 and not gone:
                gone, count, silent = count >= LIMIT, count + 1, silent - HALF_SECOND
            if gone:
                given_up += share
            else:
                later[count, expected, round(silent, 6)] += share
        waiting = later
    total = sum(come.values())
    return {(c, e - 1, s): share / total for (c, e, s), share in come.items()}, given_up


def no_beginning(loss: float, every: float) -> float:
    """MISSION_COUNT is said at 0, 0.5, ... 2 s; no request is heard until 2.5 s."""
    chance = loss**LIMIT
    for said in range(LIMIT):
        requests = int((LIMIT - said) * HALF_SECOND / every) + 1
        chance += loss**said * (1.0 - loss) * loss**requests
    return chance


def upload(loss: float, steps: Steps, final: Steps, every: float, count: int = 500) -> float:
    """Probability that it succeeds, but for the final acknowledgement, which comes seven times."""
    begun = {(1, 0, 0.0): 1.0}
    state, chance = item(begun, loss, plain, every)
    good = (1.0 - no_beginning(loss, every)) * (1.0 - chance)
    for _ in range(6):  # it hardly changes from the third item on
        state, chance = item(state, loss, steps, every)
    _, at_last = item(state, loss, final, every)
    return good * float(1.0 - chance) ** (count - 2) * (1.0 - at_last)


def download(loss: float, count: int = 500) -> float:
    """Probability that each of the items, and their number, comes back once in five times that it is asked for."""
    return float(1.0 - (1.0 - (1.0 - loss) ** 2) ** LIMIT) ** (count + 1)


def main() -> None:
    losses = [float(word) for word in sys.argv[1:]] or [0.25, 0.2, 0.16, 0.15, 0.1, 0.05]
    print("loss | upload: alone every 0.25 s | alone | as the gateway asks | at best | download")
    for loss in losses:
        slow, fast = (upload(loss, plain, plain, every) for every in (0.25, REQUEST_EVERY))
        best = 1.0 - no_beginning(loss, REQUEST_EVERY)
        figures = (slow, fast, upload(loss, ours, last, REQUEST_EVERY), best, download(loss))
        print(f"{loss:4.2f} | " + " | ".join(f"{figure:.4%}" for figure in figures))


if __name__ == "__main__":
    main()
