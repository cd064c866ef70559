"""The garbage collector, for programs that run for long and must not pause."""

from __future__ import annotations

import gc


def settle() -> None:
    """Let the collector pass over everything that is there by now. Call it once, before anything is connected.

    A hundred thousand objects of modules, above all of the dialect, live as long as the process. To look through them
    stops everything for a twentieth of a second, again and again, and whoever builds a long list makes it happen.
    """
    gc.freeze()
