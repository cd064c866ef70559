"""Names of clients in texts. No I/O."""

from __future__ import annotations

from collections.abc import Hashable


def system_of(client: Hashable) -> int | None:
    """Return the MAVLink system id of a `Command.client`; None for any other value.

    The gateway itself is such a value, too.
    """
    if isinstance(client, tuple) and len(client) == 3 and isinstance(client[1], int):
        return client[1]
    return None
