"""Feature 138, mapper: routing of the sticks and buttons of a Skycontroller.

Axes: 0 yaw, 1 throttle, 2 roll, 3 pitch, 4 camera tilt wheel, 5 zoom wheel. Buttons: 0 return home,
1 take-off/land, 2 reset camera, 3 reset zoom, 4 to 15 an axis at its end (two for each of the six). Masks have the
bits of the same numbers.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, I8, I32, U8, U16, U32, Bits, Message, OpenEnum, command, event
from anafi_mav.arsdk.messages.generic import ListFlags


class ButtonEvent(OpenEnum):
    RELEASE = 0
    PRESS = 1


class ButtonAction(OpenEnum):
    APP_0 = 0
    APP_1 = 1
    APP_2 = 2
    APP_3 = 3
    APP_4 = 4
    APP_5 = 5
    APP_6 = 6
    APP_7 = 7
    APP_8 = 8
    APP_9 = 9
    APP_10 = 10
    APP_11 = 11
    APP_12 = 12
    APP_13 = 13
    APP_14 = 14
    APP_15 = 15
    RETURN_HOME = 16
    TAKEOFF_LAND = 17
    VIDEO_RECORD = 18
    TAKE_PICTURE = 19
    CAMERA_EXPOSITION_INC = 20
    CAMERA_EXPOSITION_DEC = 21
    FLIP_LEFT = 22
    FLIP_RIGHT = 23
    FLIP_FRONT = 24
    FLIP_BACK = 25
    EMERGENCY = 26
    CENTER_CAMERA = 27
    CYCLE_HUD = 28
    CAMERA_AUTO = 29
    DEBUG_TAG = 30
    SMART_TAKEOFF_LAND = 31
    TOGGLE_ANTENNA = 32
    CHANGE_SPECTRUM = 33
    SCREENSHOT = 34
    PILOTING_MODE = 35
    ASSISTANCE_MODE = 36


class AxisAction(OpenEnum):
    APP_0 = 0
    APP_1 = 1
    APP_2 = 2
    APP_3 = 3
    APP_4 = 4
    APP_5 = 5
    APP_6 = 6
    APP_7 = 7
    APP_8 = 8
    APP_9 = 9
    APP_10 = 10
    APP_11 = 11
    APP_12 = 12
    APP_13 = 13
    APP_14 = 14
    APP_15 = 15
    ROLL = 16
    PITCH = 17
    YAW = 18
    GAZ = 19
    CAMERA_PAN = 20
    CAMERA_TILT = 21
    CAMERA_ZOOM = 22


class ExpoType(OpenEnum):
    LINEAR = 0
    EXPO_0 = 1
    EXPO_1 = 2
    EXPO_2 = 3
    EXPO_4 = 4


@command("mapper.grab", 138, 0, 1)
class Grab(Message, frozen=True):
    """Grab buttons and axes; 0, 0 releases all.

    The controller no longer acts on grabbed inputs; they arrive as events.
    """

    buttons: Annotated[int, U32]
    axes: Annotated[int, U32]


@event("mapper.grab_state", 138, 0, 2)
class GrabState(Message, frozen=True):
    buttons: Annotated[int, U32]
    axes: Annotated[int, U32]
    buttons_state: Annotated[int, U32]


@event("mapper.grab_button_event", 138, 0, 3)
class GrabButtonEvent(Message, frozen=True):
    button: Annotated[int, U32]
    event: Annotated[ButtonEvent, ENUM]


@event("mapper.grab_axis_event", 138, 0, 4)
class GrabAxisEvent(Message, frozen=True):
    """`value` is percent, -100 to 100."""

    axis: Annotated[int, U32]
    value: Annotated[int, I8]


@command("mapper.map_button_action", 138, 0, 5)
class MapButtonAction(Message, frozen=True):
    product: Annotated[int, U16]
    action: Annotated[ButtonAction, ENUM]
    buttons: Annotated[int, U32]


@command("mapper.map_axis_action", 138, 0, 6)
class MapAxisAction(Message, frozen=True):
    product: Annotated[int, U16]
    action: Annotated[AxisAction, ENUM]
    axis: Annotated[int, I32]
    buttons: Annotated[int, U32]


@event("mapper.button_mapping_item", 138, 0, 7)
class ButtonMappingItem(Message, frozen=True):
    uid: Annotated[int, U32]
    product: Annotated[int, U16]
    action: Annotated[ButtonAction, ENUM]
    buttons: Annotated[int, U32]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("mapper.axis_mapping_item", 138, 0, 8)
class AxisMappingItem(Message, frozen=True):
    uid: Annotated[int, U32]
    product: Annotated[int, U16]
    action: Annotated[AxisAction, ENUM]
    axis: Annotated[int, I32]
    buttons: Annotated[int, U32]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("mapper.application_axis_event", 138, 0, 9)
class ApplicationAxisEvent(Message, frozen=True):
    action: Annotated[AxisAction, ENUM]
    value: Annotated[int, I8]


@event("mapper.application_button_event", 138, 0, 10)
class ApplicationButtonEvent(Message, frozen=True):
    action: Annotated[ButtonAction, ENUM]


@command("mapper.reset_mapping", 138, 0, 11)
class ResetMapping(Message, frozen=True):
    product: Annotated[int, U16]


@command("mapper.set_expo", 138, 0, 12)
class SetExpo(Message, frozen=True):
    product: Annotated[int, U16]
    axis: Annotated[int, I32]
    expo: Annotated[ExpoType, ENUM]


@event("mapper.expo_map_item", 138, 0, 13)
class ExpoMapItem(Message, frozen=True):
    uid: Annotated[int, U32]
    product: Annotated[int, U16]
    axis: Annotated[int, I32]
    expo: Annotated[ExpoType, ENUM]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@command("mapper.set_inverted", 138, 0, 14)
class SetInverted(Message, frozen=True):
    product: Annotated[int, U16]
    axis: Annotated[int, I32]
    inverted: Annotated[int, U8]


@event("mapper.inverted_map_item", 138, 0, 15)
class InvertedMapItem(Message, frozen=True):
    uid: Annotated[int, U32]
    product: Annotated[int, U16]
    axis: Annotated[int, I32]
    inverted: Annotated[int, U8]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("mapper.active_product", 138, 0, 16)
class ActiveProduct(Message, frozen=True):
    """The model id of the drone behind the controller, 0 for none."""

    product: Annotated[int, U16]


@command("mapper.enter_volatile_mapping", 138, 0, 17)
class EnterVolatileMapping(Message, frozen=True):
    pass


@command("mapper.exit_volatile_mapping", 138, 0, 18)
class ExitVolatileMapping(Message, frozen=True):
    pass


@event("mapper.volatile_mapping_state", 138, 0, 19)
class VolatileMappingState(Message, frozen=True):
    active: Annotated[int, U8]
