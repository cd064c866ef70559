"""The garbage collector, for programs that run for long and must not pause."""

from __future__ import annotations

import gc


def settle() -> None:
    """Exclude all objects that exist now from garbage collection.

    Call it once, before anything is connected.

    A hundred thousand objects of modules, above all of the dialect, live as long as the process. Scanning them
    stops everything for a twentieth of a second, again and again, and code that builds a long list triggers it.
    """
    gc.freeze()
