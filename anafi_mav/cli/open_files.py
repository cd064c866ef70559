"""Limit of open files and sockets.

A fleet needs more than the 1024 that a shell usually allows.
"""

from __future__ import annotations

import contextlib
import sys

ENOUGH = 65_536
"""Files and sockets of a process: 250 drones with video and a hundred clients need some thousand."""

if sys.platform == "win32":  # which has no such limit

    def allow_many() -> None:
        """Do nothing."""

else:
    import resource

    def allow_many() -> None:
        """Raise the soft limit of this process as far as its hard limit allows.

        Its children inherit that (setrlimit(2)).
        """
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        limit = ENOUGH if hard == resource.RLIM_INFINITY else min(hard, ENOUGH)
        if soft != resource.RLIM_INFINITY and soft < limit:
            with contextlib.suppress(OSError, ValueError):  # macOS has a second, lower limit
                resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))
