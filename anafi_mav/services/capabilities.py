"""MAV_PROTOCOL_CAPABILITY bits as a flavour's clients read them. No I/O."""

from __future__ import annotations

from anafi_mav.mavlink import dialect
from anafi_mav.services.flavours import Flavour


def capability_bits(promised: int, flavour: Flavour) -> int:
    """Return the MAV_PROTOCOL_CAPABILITY bits for clients of a flavour.

    `promised` are the bits of the services.
    """
    encoding = (
        dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        if flavour.bytewise
        else dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
    )
    return promised | encoding | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
