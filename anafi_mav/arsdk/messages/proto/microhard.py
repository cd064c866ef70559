"""microhard: of it what stands in `devicemanager`."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.protobuf import ENUM, Field, Submessage
from anafi_mav.arsdk.codec.wire import OpenEnum


class Bandwidth(OpenEnum):
    _1MHZ = 0
    _2MHZ = 1
    _4MHZ = 2
    _8MHZ = 3


class Encryption(OpenEnum):
    NONE = 0
    AES128 = 1
    AES256 = 2


class BandwidthValue(Submessage, frozen=True, kw_only=True):
    value: Annotated[Bandwidth, Field(1, ENUM)] = Bandwidth._1MHZ
