"""Events of values as they arrive from a drone."""

from __future__ import annotations

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import Message, Values, join, receive


def arrived(*messages: Message) -> Values:
    """Return events of values that arrived together."""
    values = [one for one in receive(map(wire.encode, messages)) if isinstance(one, Values)]
    assert len(values) == len(messages)
    return join(values)
