"""macOS and Windows by construction: what a system lacks is used behind a condition only.

Neither is here to run the tests. POSIX's own modules, functions and signals, and the methods of an event loop that
Windows has not, are found in the source; each use needs a condition on the system, or a handler of the error.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[3] / "anafi_mav"

POSIX_MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"}

POSIX_NAMES = {
    "asyncio": {"open_unix_connection", "start_unix_server"},
    "os": {
        *("O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK"),
        *("chown", "fchmod", "fchown", "fork", "geteuid", "getloadavg", "getuid", "killpg", "mkfifo", "nice", "pipe2"),
        *("sched_getaffinity", "set_blocking", "setsid", "statvfs", "sysconf", "uname", "wait", "WNOHANG"),
    },
    "signal": {
        *("SIGALRM", "SIGCHLD", "SIGCONT", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGSTOP", "SIGUSR1", "SIGUSR2"),
        *("alarm", "pthread_sigmask", "setitimer"),
    },
    "socket": {"AF_UNIX", "CMSG_SPACE", "SCM_RIGHTS", "SO_BINDTODEVICE", "SO_REUSEPORT", "socketpair"},
}

LOOP_METHODS = {"add_reader", "add_signal_handler", "add_writer", "connect_read_pipe", "connect_write_pipe"}
"""Methods that the event loop of Windows refuses with NotImplementedError."""

SUBPROCESS_ARGUMENTS = {"pass_fds", "preexec_fn", "process_group", "user"}

_USE = re.compile(
    "|".join(
        (
            rf"^\s*(?:import|from)\b.*\b(?:{'|'.join(POSIX_MODULES)})\b",
            rf"\bfrom (?:{'|'.join(POSIX_NAMES)}) import\b",
            *(rf"\b{module}\s*\.\s*(?:{'|'.join(names)})\b" for module, names in POSIX_NAMES.items()),
            rf"\b(?:{'|'.join(LOOP_METHODS)})\b",
            rf"\b(?:{'|'.join(SUBPROCESS_ARGUMENTS)})\s*=",
        )
    ),
    re.MULTILINE,
)
"""Every use looks so; a source without any is not parsed."""

POSIX_ONLY = ("arsdk/link/watchdog.py", "arsdk/link/watchdog_child.py")
"""Modules that run on POSIX only; the module that starts the watchdog has the condition."""


def _is_condition(node: ast.AST) -> bool:
    """Whether the branches of a statement depend on the system."""
    if isinstance(node, (ast.If, ast.IfExp, ast.While)):
        test: ast.AST = node.test
    elif isinstance(node, ast.BoolOp):
        test = node
    elif isinstance(node, ast.Try):
        handled = {name.id for handler in node.handlers if handler.type for name in ast.walk(handler.type)
                   if isinstance(name, ast.Name)}  # fmt: skip
        return bool(handled & {"AttributeError", "ImportError", "NotImplementedError"})
    else:
        return False
    text = ast.unparse(test)
    return any(part in text for part in ("os.name", "sys.platform", "hasattr("))


def _uses(node: ast.AST) -> Iterator[str]:
    """What a node uses that some system lacks."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names if alias.name.partition(".")[0] in POSIX_MODULES)
    elif isinstance(node, ast.ImportFrom):
        names = POSIX_NAMES.get(node.module or "", set())
        yield from [node.module or ""] if (node.module or "").partition(".")[0] in POSIX_MODULES else []
        yield from (alias.name for alias in node.names if alias.name in names)
    elif isinstance(node, ast.Attribute):
        if node.attr in LOOP_METHODS or (
            isinstance(node.value, ast.Name) and node.attr in POSIX_NAMES.get(node.value.id, ())
        ):
            yield ast.unparse(node)
    elif isinstance(node, ast.keyword) and node.arg in SUBPROCESS_ARGUMENTS:
        yield node.arg


def bare_uses(source: str) -> list[str]:
    """The uses without a condition, as "line: use"."""
    found: list[str] = []

    def visit(node: ast.AST, line: int) -> None:
        line = getattr(node, "lineno", line)
        if _is_condition(node):
            return
        found.extend(f"{line}: {use}" for use in _uses(node))
        for child in ast.iter_child_nodes(node):
            visit(child, line)

    if _USE.search(source):
        visit(ast.parse(source), 0)
    return found


@pytest.mark.parametrize(
    "source",
    [
        "import fcntl",
        "from termios import tcgetattr",
        "def f():\n    import resource",
        "loop.add_signal_handler(2, stop)",
        "for number in (signal.SIGINT, signal.SIGHUP): pass",
        "if debug:\n    os.getuid()",
        "try:\n    loop.add_reader(0, read)\nexcept PermissionError:\n    pass",
        "subprocess.Popen([], pass_fds=(3,))",
    ],
)
def test_use_without_condition_is_found(source: str) -> None:
    assert len(bare_uses(source)) == 1


@pytest.mark.parametrize(
    "source",
    [
        "if sys.platform == 'win32':\n    import msvcrt\nelse:\n    import fcntl",
        "try:\n    loop.add_signal_handler(2, stop)\nexcept NotImplementedError:\n    pass",
        "getattr(signal, 'SIGHUP', None)",
        "x = os.getuid() if os.name == 'posix' else 0",
        "place and hasattr(socket, 'AF_UNIX') and socket.AF_UNIX",
    ],
)
def test_use_behind_a_condition_is_accepted(source: str) -> None:
    assert bare_uses(source) == []


def test_package_uses_what_a_system_lacks_behind_a_condition() -> None:
    sources = {str(path.relative_to(PACKAGE)): path.read_text() for path in PACKAGE.rglob("*.py")}
    assert len(sources) > 400
    found = {name: bare_uses(text) for name, text in sources.items() if name not in POSIX_ONLY}
    assert {name: uses for name, uses in found.items() if uses} == {}


def test_watchdog_is_started_on_posix_only() -> None:
    """Its modules use what they need without conditions."""
    importing = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if "import watchdog" in path.read_text() or "link.watchdog" in path.read_text()
    } - set(POSIX_ONLY)
    assert importing
    for name in importing:
        text = (PACKAGE / name).read_text()
        assert "Watchdog(" not in text or 'os.name == "posix"' in text, name
