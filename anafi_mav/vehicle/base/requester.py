"""Requesters of flight tasks: a client, or a part of the gateway. No I/O."""

from __future__ import annotations

import enum
from collections.abc import Hashable
from typing import TypeAlias

from anafi_mav.vehicle.base.right import Right


class Source(enum.Enum):
    """Requester that is no client: a part of the gateway."""

    FENCE = "the fence"
    LOST_LINK = "the loss of all ground stations"
    GATEWAY = "a changed setting of the flight under way, the gateway's own end"
    SWITCH = "the switch by which a client gives the aircraft to the pilot"

    @property
    def yields_to_pilot(self) -> bool:
        """True when its tasks are refused while the Skycontroller's pilot has the source."""
        return self is not Source.SWITCH

    @property
    def is_program(self) -> bool:
        """True when it flies as programs do; False: it only stops, lands or returns."""
        return self is Source.GATEWAY


By: TypeAlias = "Right | Source"
"""A client's message, or a part of the gateway."""


def client_of(by: By) -> Hashable:
    """Return the client of a request; None when a part of the gateway makes it."""
    return by.client if isinstance(by, Right) else None


def right_of(by: By) -> Right | None:
    """Return the client's right to end a landing or return; a part of the gateway has none."""
    return by if isinstance(by, Right) else None
