"""What the commands print. Colour only where a terminal is; elsewhere plain lines, each written at once."""

from __future__ import annotations

import contextlib
import sys
from typing import TextIO

from rich.console import Console
from rich.text import Text


def say(line: str, style: str = "") -> None:
    """A line on stdout. `style` is rich's."""
    _write(sys.stdout, line, style)


def complain(line: str, style: str = "red") -> None:
    """A line on stderr, with the program's name before it."""
    _write(sys.stderr, f"anafi-mav: {' '.join(line.split())}", style)


def _write(stream: TextIO, line: str, style: str) -> None:
    with contextlib.suppress(OSError):  # the reader may be gone (`anafi-mav | head`): no reason to end a flight
        if stream.isatty():
            Console(file=stream).print(Text(line, style), soft_wrap=True)
        else:
            print(line, file=stream, flush=True)
