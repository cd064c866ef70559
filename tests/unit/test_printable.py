"""Peers' text in terminals and logs."""

from __future__ import annotations

import asyncio
import io
import json
import logging
import math

import pytest

from anafi_mav.cli.log import FORMAT, REPEAT_EVERY, CleanFormatter, RepeatFilter
from anafi_mav.cli.terminal import complain, say, say_json
from anafi_mav.printable import printable
from anafi_mav.subject import DRONE


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("ANAFI-G012345", "ANAFI-G012345"),
        ("Zoë's drone, 25 °C", "Zoë's drone, 25 °C"),
        ("\x1b[2J\x1b]0;owned\x07", r"\x1b[2J\x1b]0;owned\x07"),
        ("a\nb\rc\td", r"a\nb\rc\td"),
        ("\x9b31m\x7f", r"\x9b31m\x7f"),
        ("safe\u202eexe.plan", r"safe\u202eexe.plan"),
        ("line\u2028line", r"line\u2028line"),
        ("\udc80", r"\udc80"),
        ("", ""),
    ],
)
def test_printable_text_controls_no_terminal(text: str, wanted: str) -> None:
    assert printable(text) == wanted
    assert printable(wanted) == wanted


def test_lines_of_commands_with_escapes_are_cleaned(capsys: pytest.CaptureFixture[str]) -> None:
    say("system 1: \x1b[31mred")
    complain("alpha\x1b]0;x\x07 refused")
    out, err = capsys.readouterr()
    assert out == "system 1: \\x1b[31mred\n"
    assert err == "anafi-mav: alpha\\x1b]0;x\\x07 refused\n"


def test_lines_for_a_terminal_without_umlauts_are_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(raw, "ascii"))
    say("Zoë")
    assert raw.getvalue() == b"Zo\\xeb\n"


def log_of(records: list[tuple[float, int, str, tuple[object, ...]]]) -> list[str]:
    """The lines of records that were made at these times."""
    now = 0.0
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    handler.setFormatter(CleanFormatter("%(levelname)s %(message)s"))
    handler.addFilter(RepeatFilter(lambda: now))
    logger = logging.Logger("test")
    logger.addHandler(handler)
    for at, level, text, args in records:
        now = at
        logger.log(level, text, *args)
    return stream.getvalue().splitlines()


def test_log_line_of_a_peer_cannot_forge_another() -> None:
    lines = log_of([(0.0, logging.WARNING, "%s: %s", ("alpha", "x\n2026-01-01 ERROR bravo: crashed\x1b[0m"))])
    assert lines == [r"WARNING alpha: x\n2026-01-01 ERROR bravo: crashed\x1b[0m"]
    assert "%(levelname)s" in FORMAT


def test_exception_log_keeps_its_lines_cleaned() -> None:
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    handler.setFormatter(CleanFormatter(FORMAT))
    logger = logging.Logger("test")
    logger.addHandler(handler)
    try:
        raise ValueError("\x1b[2J")
    except ValueError:
        logger.exception("failed")
    lines = stream.getvalue().splitlines()
    assert lines[1] == "Traceback (most recent call last):"
    assert lines[-1] == r"ValueError: \x1b[2J"


def test_refusal_logged_ten_times_a_second_is_throttled() -> None:
    refusal = "%s: Goto refused: %d m beyond the fence"
    many = [(0.1 * n, logging.WARNING, refusal, ("alpha", n)) for n in range(50)]
    lines = log_of(
        [*many, (4.95, logging.WARNING, refusal, ("bravo", 3)), (REPEAT_EVERY, logging.WARNING, refusal, ("alpha", 7))]
    )
    assert lines == [
        "WARNING alpha: Goto refused: 0 m beyond the fence",
        "WARNING bravo: Goto refused: 3 m beyond the fence",  # another drone's is another line
        "WARNING alpha: Goto refused: 7 m beyond the fence (and 49 times before)",
    ]


def test_log_of_messages_is_never_throttled() -> None:
    assert log_of([(0.0, logging.DEBUG, "same", ())] * 3) == ["DEBUG same"] * 3


async def test_log_line_without_drone_argument_names_the_drone() -> None:
    """What a drone's task starts and what its sockets bring is about that drone."""
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    handler.setFormatter(CleanFormatter("%(message)s"))
    handler.addFilter(RepeatFilter())
    logger = logging.Logger("test")
    logger.addHandler(handler)

    async def look_after(name: str) -> None:
        DRONE.set(name)
        asyncio.get_running_loop().call_soon(logger.warning, "sticks are given back")
        await asyncio.create_task(asyncio.sleep(0))
        logger.warning("%s: link lost", name)

    await asyncio.gather(look_after("alpha"), look_after("bravo"))
    logger.warning("about all")
    assert sorted(stream.getvalue().splitlines()) == [
        "about all",
        "alpha: link lost",
        "alpha: sticks are given back",
        "bravo: link lost",
        "bravo: sticks are given back",
    ]


def test_json_of_a_command_is_json_and_ascii(capsys: pytest.CaptureFixture[str]) -> None:
    value = {"name": "Zoë\x1b[2J\x7f", "range": (1.5, math.nan, [math.inf]), "none": None}
    say_json(value)
    out = capsys.readouterr().out
    assert out.isascii()
    assert not {"\x1b", "\x7f"} & set(out)
    assert json.loads(out) == {"name": value["name"], "range": [1.5, None, [None]], "none": None}
