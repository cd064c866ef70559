"""What the commands print. Colour only where a terminal is; elsewhere plain lines, each written at once.

Every line is cleaned of control characters: names and texts of drones and vehicles are in many of them.
"""

from __future__ import annotations

import contextlib
import json
import math
import sys
from collections.abc import Callable, Iterator
from typing import TextIO

from rich.console import Console
from rich.progress import Progress
from rich.text import Text

from anafi_mav.printable import printable

_bars: list[Progress] = []
"""Bars on the screen: what is said meanwhile is printed above them."""


def say(line: str, style: str = "") -> None:
    """A line on stdout. `style` is rich's."""
    _write(sys.stdout, line, style)


def say_json(value: object) -> None:
    """Print a value as JSON on stdout, indented, with every character outside ASCII as its escape.

    A number that JSON does not have (NaN, infinity) is null.
    """
    for line in json.dumps(_plain(value), indent=2, allow_nan=False).replace("\x7f", "\\u007f").split("\n"):
        say(line)


def _plain(value: object) -> object:
    match value:
        case float() if not math.isfinite(value):
            return None
        case dict():
            return {key: _plain(item) for key, item in value.items()}
        case list() | tuple():
            return [_plain(item) for item in value]
        case _:
            return value


def complain(line: str, style: str = "red") -> None:
    """A line on stderr, with the program's name before it."""
    _write(sys.stderr, f"anafi-mav: {' '.join(line.split())}", style)


@contextlib.contextmanager
def progress(what: str, total: int | None) -> Iterator[Callable[[int, int], None]]:
    """A bar while something is carried: call what it gives with how much of how much. On a terminal only."""
    if not sys.stdout.isatty():
        yield lambda done, of: None
        return
    with Progress(console=Console(file=sys.stdout), transient=True) as bar:
        _bars.append(bar)
        task = bar.add_task(what, total=total)
        try:
            yield lambda done, of: bar.update(task, completed=done, total=of or None)
        finally:
            _bars.remove(bar)


def _write(stream: TextIO, line: str, style: str) -> None:
    line = printable(line)
    with contextlib.suppress(OSError):  # the reader may be gone (`anafi-mav | head`): no reason to end a flight
        if stream.isatty():
            console = _bars[-1].console if _bars and stream is sys.stdout else Console(file=stream)
            console.print(Text(line, style), soft_wrap=True)
        else:
            encoding = stream.encoding or "utf-8"  # a terminal without umlauts is no reason to end a flight
            print(line.encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)
