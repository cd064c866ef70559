"""Feature 133, generic: what all features share."""

from __future__ import annotations

from anafi_mav.arsdk.codec.wire import OpenEnum


class ListFlags(OpenEnum):
    """Bits of the `list_flags` argument that frames a list or map.

    One element is FIRST|LAST; an empty list is one dummy element with EMPTY.
    """

    FIRST = 0
    LAST = 1
    EMPTY = 2
    REMOVE = 3
