"""Records ten sessions of MAVLink clients with a simulated drone in virtual time, and compares two recordings.

    python tests/bench/sessions.py record FOLDER [--only NAME ...]
    python tests/bench/sessions.py compare FOLDER [--texts FILE] [--step S] [--only NAME ...]
    python tests/bench/sessions.py compare --against COMMIT [--texts FILE] [--step S] [--only NAME ...]

`compare` records the sessions of this work tree and compares them with those of a folder, or of a commit, which is
recorded with its own scripts in a temporary folder. It ends with 1 when they differ. FILE holds texts that have
changed: old text, tab, new text, with `{placeholders}` in both.

A recording depends on the commit alone, not on the machine: see `support.virtual_time`. One run at a time, for the
simulated drones have fixed addresses; a second one waits.
"""

from __future__ import annotations

import argparse
import fcntl
import gc
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from common import tree_of  # noqa: E402 - after the path
from support.recording import STEP, Texts, compare, read, shown  # noqa: E402 - after the path

SHOWN = 3
"""Differences printed per session."""

SUFFIX = ".session"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True)
    recording, comparing = verbs.add_parser("record"), verbs.add_parser("compare")
    recording.add_argument("folder", type=Path)
    comparing.add_argument("folder", type=Path, nargs="?")
    comparing.add_argument("--against", metavar="COMMIT")
    comparing.add_argument("--texts", type=Path, metavar="FILE")
    comparing.add_argument("--step", type=float, default=STEP, help="s that times may be apart")
    comparing.add_argument("--show", type=int, default=SHOWN, metavar="N", help="differences printed per session")
    comparing.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the new recording there")
    for verb in (recording, comparing):
        verb.add_argument("--only", nargs="*", default=[], metavar="NAME", help="parts of the names of sessions")
    options = parser.parse_args()
    if options.verb == "record":
        return record(options.folder, options.only)
    if (options.folder is None) is (options.against is None):
        parser.error("compare: expected either a folder or --against COMMIT")
    with tempfile.TemporaryDirectory() as temporary:
        new, old = options.keep or Path(temporary) / "new", options.folder
        if old is None:
            old = Path(temporary) / "old"
            with tree_of(options.against) as root:
                recorded_in(root, old, options.only)
        recorded_in(ROOT, new, options.only)
        texts = Texts() if options.texts is None else Texts.read(options.texts)
        return compared(old, new, options.step, texts, options.show)


def recorded_in(root: Path, folder: Path, only: list[str]) -> None:
    """Record in a process of its own: whatever this one has imported is of one commit."""
    script = root / "tests" / "bench" / "sessions.py"
    if not script.exists():
        raise SystemExit("that commit has no tests/bench/sessions.py")
    words = [sys.executable, str(script), "record", str(folder.resolve()), *(["--only", *only] if only else [])]
    subprocess.run(words, cwd=root, check=True)


def compared(old: Path, new: Path, step: float, texts: Texts, most: int) -> int:
    """Print how two folders of recordings differ; 1 when they do."""
    names = sorted({path.name for path in new.glob(f"*{SUFFIX}")})
    if not names:
        raise SystemExit("nothing was recorded")
    different = False
    for name in names:
        if not (old / name).exists():
            print(f"{name}: not in {old}")
            different = True
            continue
        before, after = read(old / name), read(new / name)
        found = compare(before, after, step=step, texts=texts)
        different = different or bool(found)
        print(f"{name}: {len(before)} and {len(after)} lines, {len(found) or 'no'} differences")
        for difference in found[:most]:
            print(shown(difference, before, after))
    return int(different)


def record(folder: Path, only: list[str]) -> int:
    """Record sessions into a folder, a file each."""
    if os.environ.get("PYTHONHASHSEED") != "0":  # the order of sets of texts
        environment = {**os.environ, "PYTHONHASHSEED": "0", "PYTHONPATH": os.pathsep.join(sys.path[:2])}
        os.execve(sys.executable, [sys.executable, *sys.argv], environment)
    folder.mkdir(parents=True, exist_ok=True)
    with (Path(tempfile.gettempdir()) / f"anafi-mav-sessions-{os.getuid()}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return _record(folder.resolve(), only)


def _record(folder: Path, only: list[str]) -> int:
    import anafi_mav

    if not Path(anafi_mav.__file__).is_relative_to(ROOT):
        raise SystemExit(f"anafi_mav is of {anafi_mav.__file__}, not of this work tree")
    from support import sessions, virtual_time
    from support.recording import write

    from anafi_mav.arsdk.link import watchdog

    watchdog.LIMIT = None  # gateway and Skycontroller share one process
    gc.disable()
    for number, name in enumerate(sessions.SESSIONS):
        if only and not any(part in name for part in only):
            continue
        virtual_time.install(number)
        began = time.process_time()
        with tempfile.TemporaryDirectory() as state:
            os.environ["XDG_STATE_HOME"] = state
            loop = virtual_time.Loop()
            try:
                lines = loop.run_until_complete(sessions.recorded(name))
                if not loop.world_timers:
                    raise SystemExit(f"the simulator's task is not called {virtual_time.WORLD_TASK!r} any longer")
            finally:
                loop.close()
        write(folder / f"{name}{SUFFIX}", lines)
        took = time.process_time() - began
        print(f"{name}: {len(lines)} lines, {lines[-1].at:.0f} s, {took:.1f} s of processor time", flush=True)
        gc.collect()
    return 0


if __name__ == "__main__":
    sys.exit(main())
