"""Output of the commands.

Colour only on a terminal; elsewhere plain lines, each written at once.

Every line is cleaned of control characters: names and texts of drones and vehicles are in many of them.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import io
import json
import math
import os
import sys
from collections.abc import Callable, Container, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple, TextIO

from anafi_mav.disk_writer import DiskWriter
from anafi_mav.printable import printable

if TYPE_CHECKING:  # rich is imported for a terminal or a table only
    from rich.console import JustifyMethod
    from rich.progress import Progress
    from rich.table import Table
    from rich.text import Text

_LAST_COLUMN = 24
"""Characters that the last column of a table has at least, on a terminal that is too narrow for all."""

_UNFOLDED = 100_000
"""Characters that no row of a table has."""

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a file that takes no more: the disk, the user's part of it, or the file itself is full."""

MAX_WAITING = 5000
"""Lines that may wait for a disk or a terminal: some 2 MB."""

STDOUT_WRITER = DiskWriter("anafi-mav-stdout", max_waiting=MAX_WAITING)
STDERR_WRITER = DiskWriter("anafi-mav-stderr", max_waiting=MAX_WAITING)
"""Write for an event loop, which must not wait: a terminal is stopped (Ctrl-S), a reader reads nothing."""

END_LIMIT = 0.5
"""s that the end of the program waits for a disk or a terminal, twice at most; a complaint waits as long for the lines
before it."""

_losses: list[str] = []
"""Why lines of stdout are lost; empty while none is."""

_bars: list[Progress] = []
"""Bars on the screen: what is said meanwhile is printed above them."""


def say(line: str, style: str = "") -> None:
    """A line on stdout. `style` is rich's."""
    _write(sys.stdout, line, style)


def say_json(value: object) -> None:
    """Print a value as JSON on stdout, indented and in ASCII.

    Other characters are escaped. A number that JSON does not have (NaN, infinity) is null.
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


class TableRows(NamedTuple):
    """A table: the titles of its columns, and its rows."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def has_lost_output() -> bool:
    """True when a full disk did not take a line of stdout; a reader that has left is no loss."""
    return bool(_losses)


def is_live() -> bool:
    """True when stdout is a terminal on which lines can be replaced.

    On a dumb one rich shows nothing before its end.
    """
    if not sys.stdout.isatty():
        return False
    from rich.console import Console

    return not Console(file=sys.stdout).is_dumb_terminal


@contextlib.contextmanager
def live_tables() -> Iterator[Callable[[Sequence[str], Sequence[TableRows]], None]]:
    """Lines and tables below them on the terminal, replaced by each call of what it gives.

    What is wider than the terminal is folded. The last line tells how many lines have no room below.
    """
    from rich.console import Console, Group
    from rich.live import Live
    from rich.segment import SegmentLines
    from rich.text import Text

    console = Console(file=sys.stdout)
    with Live(console=console, screen=True, auto_refresh=False) as screen:

        def show(lines: Sequence[str], tables: Sequence[TableRows]) -> None:
            parts: list[Text | Table] = [Text(printable(line), overflow="fold") for line in lines]
            for table in tables:
                parts += [Text(), _table(table.head, table.rows, width=console.width)]
            picture = console.render_lines(Group(*parts), pad=False)
            room = console.height - 1
            more = len(picture) - room
            if more > 1:
                last = Text(f"and {more} more lines: make the window higher, or add | cat", "bold")
                screen.update(Group(SegmentLines(picture[:room], new_lines=True), last), refresh=True)
            else:
                screen.update(SegmentLines(picture, new_lines=True), refresh=True)

        yield show


def say_table(head: Sequence[str], rows: Sequence[Sequence[str]], right: Container[int] = ()) -> None:
    """Print rows in columns on stdout. `right` are the columns that are aligned to the right.

    A terminal gets a head in bold and a last column that is folded inside itself. Elsewhere a row is one line.
    """
    from rich.console import Console
    from rich.measure import Measurement

    table = _table(head, rows, right)
    if sys.stdout.isatty():
        console = Console(file=sys.stdout)
        least = Measurement.get(console, console.options, table).minimum
        with contextlib.suppress(OSError):
            console.print(table, width=max(console.width, least), crop=False)
        return
    page = Console(file=io.StringIO(), width=_UNFOLDED)
    with page.capture() as text:
        page.print(table)
    for line in text.get().splitlines():
        say(line.rstrip())


def _table(
    head: Sequence[str], rows: Sequence[Sequence[str]], right: Container[int] = (), width: int = _UNFOLDED
) -> Table:
    """Return a table whose last column can be folded.

    Every column can be where they are wider than `width` together.
    """
    from rich.cells import cell_len
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="bold")
    least = [max(cell_len(printable(row[place])) for row in [head, *rows]) for place in range(len(head))]
    least[-1] = min(least[-1], _LAST_COLUMN)
    is_wide = sum(least) + 2 * (len(least) - 1) > width
    for place, title in enumerate(head):
        justify: JustifyMethod = "right" if place in right else "left"
        table.add_column(Text(title), justify=justify, min_width=None if is_wide else least[place], overflow="fold")
    for row in rows:
        table.add_row(*(Text(printable(cell)) for cell in row))
    return table


def complain(line: str, style: str = "red") -> None:
    """A line on stderr, with the program's name before it, behind lines of the log that wait."""
    STDERR_WRITER.wait(END_LIMIT)
    _write(sys.stderr, _complaint(line), style)


def say_later(line: str, style: str = "") -> None:
    """Say in a thread: for the event loop of a gateway. Dropped when too many lines wait.

    Above a bar it is printed at once: a stopped terminal delays the bar, too.
    """
    if _bars:
        say(line, style)
        return
    STDOUT_WRITER.post(functools.partial(_write_stdout, _rendered(sys.stdout, line, style)))


def complain_later(line: str, style: str = "red") -> None:
    """Complain in a thread: for the event loop of a gateway. Dropped when too many lines wait."""
    STDERR_WRITER.post(functools.partial(write_stderr, _rendered(sys.stderr, _complaint(line), style)))


def _complaint(line: str) -> str:
    return f"anafi-mav: {' '.join(line.split())}"


def _rendered(stream: TextIO, line: str, style: str) -> str:
    """Return a line as the stream shows it: on a terminal with its colour."""
    line = printable(line)
    if not stream.isatty():
        return line
    from rich.console import Console
    from rich.text import Text

    console = Console(file=stream)
    with console.capture() as captured:
        console.print(Text(line, style), soft_wrap=True)
    return captured.get().rstrip("\n")


def write_stderr(line: str) -> None:
    """Write a line that is clean to stderr, in a thread."""
    with contextlib.suppress(OSError, ValueError):  # the reader is gone, or it is closed
        _write_line(sys.stderr, line)


def _write_stdout(line: str) -> None:
    try:
        _write_line(sys.stdout, line)
    except OSError as error:
        if _is_loss(error):
            complain_later(_losses[0])
    except ValueError:  # it is closed
        return


def _write_line(stream: TextIO, line: str) -> None:
    """Write a line, in a thread.

    While it waits it holds no lock that the end of the program needs. Raises `OSError`, and `ValueError` for a closed
    stream.
    """
    try:
        number = stream.fileno()
    except io.UnsupportedOperation:  # no file, as in a test
        print(line, file=stream, flush=True)
        return
    data = f"{line}\n".encode(stream.encoding or "utf-8", "backslashreplace")
    while data:
        data = data[os.write(number, data) :]


def _is_loss(error: OSError) -> bool:
    """Record that stdout is full; return True the first time."""
    if error.errno not in _FULL or _losses:
        return False
    _losses.append(f"stdout cannot be written: {error.strerror}")
    return True


@contextlib.contextmanager
def progress(what: str, total: int | None) -> Iterator[Callable[[int, int], None]]:
    """A bar while something is carried: call what it gives with how much of how much.

    On a terminal only.
    """
    if not sys.stdout.isatty():
        yield lambda done, of: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(file=sys.stdout), transient=True) as bar:
        _bars.append(bar)
        task = bar.add_task(what, total=total)
        try:
            yield lambda done, of: bar.update(task, completed=done, total=of or None)
        finally:
            _bars.remove(bar)


def _write(stream: TextIO, line: str, style: str) -> None:
    line = printable(line)
    try:
        if stream.isatty():
            from rich.console import Console
            from rich.text import Text

            console = _bars[-1].console if _bars and stream is sys.stdout else Console(file=stream)
            console.print(Text(line, style), soft_wrap=True)
        else:
            encoding = stream.encoding or "utf-8"  # a terminal without umlauts is no reason to end a flight
            print(line.encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)
    except OSError as error:  # the reader may be gone (`anafi-mav | head`): no reason to end a flight
        _discard(stream)
        if stream is sys.stdout and _is_loss(error):
            complain(_losses[0])


def _discard(stream: TextIO) -> None:
    """Empty the stream's buffer into the null device.

    Python keeps there what could not be written and tries again when it ends: the exit status would be 120.
    """
    with contextlib.suppress(OSError, ValueError):
        number = stream.fileno()
        kept, null = os.dup(number), os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, number)
        stream.flush()
        os.dup2(kept, number)
        os.close(kept)
        os.close(null)
