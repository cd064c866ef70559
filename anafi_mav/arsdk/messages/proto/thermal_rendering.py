"""thermalrendering: how a thermal picture is coloured; stands in `camera2`."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.protobuf import BOOL, ENUM, FLOAT, RECORD, Field, Submessage, Wrapped
from anafi_mav.arsdk.codec.wire import OpenEnum


class MixingMode(OpenEnum):
    FULL_THERMAL = 0
    BLENDED = 1


class Palette(Submessage, frozen=True, kw_only=True):
    palette_elements: Annotated[tuple[PaletteElement, ...], Field(1, RECORD)] = ()


class PaletteElement(Submessage, frozen=True, kw_only=True):
    red: Annotated[float, Field(1, FLOAT)] = 0.0
    green: Annotated[float, Field(2, FLOAT)] = 0.0
    blue: Annotated[float, Field(3, FLOAT)] = 0.0
    position: Annotated[float, Field(4, FLOAT)] = 0.0


class Rendering(Submessage, frozen=True, kw_only=True):
    mixing_mode: Annotated[MixingModeValue | None, Field(1, RECORD)] = None
    edge_coef: Annotated[float | None, Wrapped(2, FLOAT)] = None
    min_visibility_threshold: Annotated[float | None, Wrapped(3, FLOAT)] = None
    max_visibility_threshold: Annotated[float | None, Wrapped(4, FLOAT)] = None
    range_locked: Annotated[bool | None, Wrapped(5, BOOL)] = None


class MixingModeValue(Submessage, frozen=True, kw_only=True):
    value: Annotated[MixingMode, Field(1, ENUM)] = MixingMode.FULL_THERMAL
