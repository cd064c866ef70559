"""`anafi-mav` and `python -m anafi_mav`.

Importing a command takes up to a second. Ctrl-C ends the program at once then: nothing has been opened or begun, and a
traceback out of an import helps no user. So this module imports nothing before it has made its arrangements.

The garbage collector is off until the command is imported, and leaves alone for good what exists then. A hundred
thousand objects of modules live as long as the process. To scan them takes a fifth of the start, and later stops
everything for a twentieth of a second, again and again.
"""

import gc
import sys

INTERRUPTED = 130
"""Exit status of a program that Ctrl-C has ended, as shells have it."""

try:
    import atexit
    import io
    import os
    import signal  # which imports others, and is not there yet
except KeyboardInterrupt:
    raise SystemExit(INTERRUPTED) from None


def main() -> int:
    """Run the command line; returns the exit status."""
    _end_at_once_on_interrupt(INTERRUPTED)
    atexit.register(_ignore_interrupt)  # the first that is registered runs last
    _open_closed_streams()
    _escape_what_has_no_encoding()
    gc.disable()
    from anafi_mav.cli import main as run

    status = run(imported=_collect_garbage)
    _end_at_once_on_interrupt(status)
    if "zenoh" in sys.modules:
        _end_without_finalization(status)
    return status


def _open_closed_streams() -> None:
    """Open the standard streams that the parent has closed (`>&-`) on the null device.

    Python has None for them, and the first socket would get their number: what a library writes to stderr would go to a
    drone.
    """
    for number, name, mode in (0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w"):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, which is this one
            setattr(sys, name, open(number, mode, closefd=False))  # noqa: SIM115


def _escape_what_has_no_encoding() -> None:
    """Let the standard streams replace characters that their encoding lacks by escapes.

    A terminal without a degree sign is no reason to end a command, or a flight.
    """
    for stream in sys.stdout, sys.stderr:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _collect_garbage() -> None:
    """Collect garbage from now on, among objects that do not exist yet."""
    gc.freeze()
    gc.enable()


def _end_at_once_on_interrupt(status: int) -> None:
    """Let SIGINT end the process with this status, unless SIGINT is ignored.

    A shell ignores it for its background jobs.
    """
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, lambda number, frame: os._exit(status))


def _ignore_interrupt() -> None:
    """Ignore SIGINT while Python ends.

    Python replaces our handler by the default one then: another Ctrl-C would replace the exit status by a signal's.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _end_without_finalization(status: int) -> None:
    """End the process while threads of zenoh may still call back.

    Before 3.14 Python ends a thread that needs it during finalization by unwinding its stack (cpython#87135). In one of
    zenoh this aborts the process: "FATAL: exception not rethrown".
    """
    import contextlib

    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):  # closed by the reader
            stream.flush()
    os._exit(status)


if __name__ == "__main__":
    sys.exit(main())
