"""The history of payload commands: which equal command is a retransmission, and until when."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from anafi_mav.mavlink import dialect
from anafi_mav.services.commands import MAX_CLIENTS, Action, ActionGroup, Altitude, Command, Effect
from anafi_mav.services.payload_history import PayloadHistory

NAN = math.nan
ACCEPTED, IN_PROGRESS = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_IN_PROGRESS


async def _nothing(command: Command) -> None: ...


def make(effect: Effect, *, group: ActionGroup = ActionGroup.PHOTO, client: str = "a", id: int = 1) -> Command:
    row = Action(_nothing, location=False, altitude=Altitude.UNUSED, effect=effect, group=group)
    return Command(id, row, (NAN, NAN, NAN, NAN), NAN, NAN, NAN, None, client)


def run(history: PayloadHistory, command: Command, at: float, result: int = ACCEPTED) -> None:
    execution = history.begin(command)
    execution.result, execution.ended = result, at


@pytest.mark.parametrize(
    ("effect", "confirmation", "answer"),
    [
        (Effect.STOP, 1, None),
        (Effect.TARGET, 1, None),
        (Effect.EACH, 0, None),
        (Effect.EACH, 1, ACCEPTED),
        (Effect.NUMBERED, 0, ACCEPTED),
        (Effect.ONCE, 0, ACCEPTED),
    ],
)
def test_effect_decides_the_answer_to_a_repetition(effect: Effect, confirmation: int, answer: int | None) -> None:
    history, command = PayloadHistory(), make(effect)
    history.begin(command)
    assert history.retransmission(replace(command, confirmation=confirmation), 0.1) == IN_PROGRESS
    run(history, command, 10.0)
    assert history.retransmission(replace(command, confirmation=confirmation), 11.0) == answer


@pytest.mark.parametrize(
    ("effect", "answer"),
    [(Effect.TARGET, None), (Effect.EACH, None), (Effect.ONCE, None), (Effect.NUMBERED, ACCEPTED)],
)
@pytest.mark.parametrize(("client", "component"), [("a", 1), ("b", 100)])
def test_answer_is_void_after_another_action_of_its_group(
    effect: Effect, answer: int | None, client: str, component: int
) -> None:
    history, command = PayloadHistory(), replace(make(effect), confirmation=1)
    run(history, command, 10.0)
    run(history, replace(make(Effect.STOP, client=client, id=2), component=component), 10.2)
    assert history.retransmission(command, 10.4) == answer


def test_action_of_another_group_leaves_the_answer() -> None:
    history, command = PayloadHistory(), make(Effect.ONCE)
    run(history, command, 10.0)
    run(history, make(Effect.TARGET, group=ActionGroup.ZOOM, id=2), 10.2)
    assert history.retransmission(command, 10.4) == ACCEPTED


def test_same_command_to_another_component_is_a_new_one() -> None:
    history, command = PayloadHistory(), make(Effect.NUMBERED)
    run(history, command, 10.0)
    assert history.retransmission(replace(command, component=100), 10.4) is None


@pytest.mark.parametrize(("effect", "answer"), [(Effect.TARGET, None), (Effect.ONCE, IN_PROGRESS)])
def test_running_action_that_is_overtaken(effect: Effect, answer: int | None) -> None:
    """A target set back and forth before the first is confirmed ends as the last one says."""
    history, command = PayloadHistory(), make(effect)
    history.begin(command)
    history.begin(make(Effect.STOP, client="b", id=2))
    assert history.retransmission(command, 0.1) == answer


def test_answer_is_void_once_its_effect_has_ended() -> None:
    holds = True
    row = Action(
        _nothing,
        location=False,
        altitude=Altitude.UNUSED,
        effect=Effect.ONCE,
        group=ActionGroup.STORAGE,
        still_holds=lambda command: holds,
    )
    history, command = PayloadHistory(), replace(make(Effect.ONCE), definition=row)
    run(history, command, 10.0)
    assert history.retransmission(command, 11.0) == ACCEPTED
    holds = False
    assert history.retransmission(command, 11.0) is None
    run(history, command, 12.0, dialect.MAV_RESULT_DENIED)
    assert history.retransmission(command, 12.5) == dialect.MAV_RESULT_DENIED


def test_memory_lasts_from_the_last_repetition() -> None:
    history, command = PayloadHistory(), make(Effect.NUMBERED)
    run(history, command, 10.0)
    assert [history.retransmission(command, at) for at in (13.0, 16.0, 19.4, 22.9)] == [ACCEPTED] * 3 + [None]
    denied = dialect.MAV_RESULT_DENIED
    run(history, command, 30.0, denied)  # the reason of a refusal may end at any time
    assert [history.retransmission(command, at) for at in (30.4, 30.9, 31.0)] == [denied] * 2 + [None]


def test_payload_history_is_bounded() -> None:
    history = PayloadHistory()
    for id in range(MAX_CLIENTS + 1):
        history.begin(make(Effect.ONCE, id=id))
    assert history.retransmission(make(Effect.ONCE, id=0), 0.0) is None
    assert history.retransmission(make(Effect.ONCE, id=1), 0.0) == IN_PROGRESS
    history.forget()
    assert history.retransmission(make(Effect.ONCE, id=1), 0.0) is None


def test_actions_of_gone_clients_are_forgotten() -> None:
    history = PayloadHistory()
    for client in ("a", "b"):
        history.begin(make(Effect.NUMBERED, client=client))
    history.forget_clients(lambda client: client == "a")
    assert history.retransmission(make(Effect.NUMBERED, client="a"), 1.0) is None
    assert history.retransmission(make(Effect.NUMBERED, client="b"), 1.0) == IN_PROGRESS
