"""Feature 134, follow_me."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, F32, F64, I8, U8, U16, U64, Bits, Buffer, Message, OpenEnum, command, event


class Mode(OpenEnum):
    NONE = 0
    LOOK_AT = 1
    GEOGRAPHIC = 2
    RELATIVE = 3
    LEASH = 4


class Behavior(OpenEnum):
    IDLE = 0
    FOLLOW = 1
    LOOK_AT = 2


class Input(OpenEnum):
    DRONE_CALIBRATED = 0
    DRONE_GPS_GOOD_ACCURACY = 1
    TARGET_GPS_GOOD_ACCURACY = 2
    TARGET_BAROMETER_OK = 3
    DRONE_FAR_ENOUGH = 4
    DRONE_HIGH_ENOUGH = 5
    IMAGE_DETECTION = 6
    TARGET_GOOD_SPEED = 7
    DRONE_CLOSE_ENOUGH = 8


class Animation(OpenEnum):
    NONE = 0
    HELICOID = 1
    SWING = 2
    BOOMERANG = 3
    CANDLE = 4
    DOLLY_SLIDE = 5


class GeoRelConfigureParam(OpenEnum):
    DISTANCE = 0
    ELEVATION = 1
    AZIMUTH = 2


class HelicoidConfigureParam(OpenEnum):
    SPEED = 0
    REVOLUTION_NB = 1
    VERTICAL_DISTANCE = 2


class SwingConfigureParam(OpenEnum):
    SPEED = 0
    VERTICAL_DISTANCE = 1


class BoomerangConfigureParam(OpenEnum):
    SPEED = 0
    DISTANCE = 1


class CandleConfigureParam(OpenEnum):
    SPEED = 0
    VERTICAL_DISTANCE = 1


class DollySlideConfigureParam(OpenEnum):
    SPEED = 0
    ANGLE = 1
    HORIZONTAL_DISTANCE = 2


class ImageDetectionStatus(OpenEnum):
    NONE = 0
    OK = 1
    LOST = 2


@command("follow_me.start", 134, 0, 1)
class Start(Message, frozen=True):
    mode: Annotated[Mode, ENUM]


@command("follow_me.stop", 134, 0, 2)
class Stop(Message, frozen=True):
    pass


@event("follow_me.state", 134, 0, 3)
class State(Message, frozen=True):
    mode: Annotated[Mode, ENUM]
    behavior: Annotated[Behavior, ENUM]
    animation: Annotated[Animation, ENUM]
    animation_available: Annotated[int, Bits(U16, Animation)]


@event("follow_me.mode_info", 134, 0, 4)
class ModeInfo(Message, frozen=True):
    mode: Annotated[Mode, ENUM]
    missing_requirements: Annotated[int, Bits(U16, Input)]
    improvements: Annotated[int, Bits(U16, Input)]


@event("follow_me.target_trajectory", 134, 0, 10, Buffer.NON_ACK)
class TargetTrajectory(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F32]
    north_speed: Annotated[float, F32]
    east_speed: Annotated[float, F32]
    down_speed: Annotated[float, F32]


@event("follow_me.target_is_controller", 134, 0, 27)
class TargetIsController(Message, frozen=True):
    state: Annotated[int, U8]


@command("follow_me.configure_geographic", 134, 0, 6)
class ConfigureGeographic(Message, frozen=True):
    """Wanted position of the drone relative to the target: m, rad.

    Each bit of `use_default` leaves that value to the drone.
    """

    use_default: Annotated[int, Bits(U8, GeoRelConfigureParam)]
    distance: Annotated[float, F32]
    elevation: Annotated[float, F32]
    azimuth: Annotated[float, F32]


@event("follow_me.geographic_config", 134, 0, 7)
class GeographicConfig(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, GeoRelConfigureParam)]
    distance: Annotated[float, F32]
    elevation: Annotated[float, F32]
    azimuth: Annotated[float, F32]


@command("follow_me.configure_relative", 134, 0, 8)
class ConfigureRelative(Message, frozen=True):
    """As `ConfigureGeographic`, the azimuth from the way the target moves."""

    use_default: Annotated[int, Bits(U8, GeoRelConfigureParam)]
    distance: Annotated[float, F32]
    elevation: Annotated[float, F32]
    azimuth: Annotated[float, F32]


@event("follow_me.relative_config", 134, 0, 9)
class RelativeConfig(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, GeoRelConfigureParam)]
    distance: Annotated[float, F32]
    elevation: Annotated[float, F32]
    azimuth: Annotated[float, F32]


@command("follow_me.configure_leash", 134, 0, 28)
class ConfigureLeash(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, GeoRelConfigureParam)]
    distance: Annotated[float, F32]
    elevation: Annotated[float, F32]
    azimuth: Annotated[float, F32]


@event("follow_me.leash_config", 134, 0, 29)
class LeashConfig(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, GeoRelConfigureParam)]
    distance: Annotated[float, F32]
    elevation: Annotated[float, F32]
    azimuth: Annotated[float, F32]


@command("follow_me.stop_animation", 134, 0, 11)
class StopAnimation(Message, frozen=True):
    pass


@command("follow_me.start_helicoid_anim", 134, 0, 12)
class StartHelicoidAnim(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, HelicoidConfigureParam)]
    speed: Annotated[float, F32]
    revolution_number: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]


@event("follow_me.helicoid_anim_config", 134, 0, 13)
class HelicoidAnimConfig(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, HelicoidConfigureParam)]
    speed: Annotated[float, F32]
    revolution_nb: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]


@command("follow_me.start_swing_anim", 134, 0, 14)
class StartSwingAnim(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, SwingConfigureParam)]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]


@event("follow_me.swing_anim_config", 134, 0, 15)
class SwingAnimConfig(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, SwingConfigureParam)]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]


@command("follow_me.start_boomerang_anim", 134, 0, 16)
class StartBoomerangAnim(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, BoomerangConfigureParam)]
    speed: Annotated[float, F32]
    distance: Annotated[float, F32]


@event("follow_me.boomerang_anim_config", 134, 0, 17)
class BoomerangAnimConfig(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, BoomerangConfigureParam)]
    speed: Annotated[float, F32]
    distance: Annotated[float, F32]


@command("follow_me.start_candle_anim", 134, 0, 18)
class StartCandleAnim(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, CandleConfigureParam)]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]


@event("follow_me.candle_anim_config", 134, 0, 19)
class CandleAnimConfig(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, CandleConfigureParam)]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]


@command("follow_me.start_dolly_slide_anim", 134, 0, 20)
class StartDollySlideAnim(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, DollySlideConfigureParam)]
    speed: Annotated[float, F32]
    angle: Annotated[float, F32]
    horizontal_distance: Annotated[float, F32]


@event("follow_me.dolly_slide_anim_config", 134, 0, 21)
class DollySlideAnimConfig(Message, frozen=True):
    use_default: Annotated[int, Bits(U8, DollySlideConfigureParam)]
    speed: Annotated[float, F32]
    angle: Annotated[float, F32]
    horizontal_distance: Annotated[float, F32]


@command("follow_me.target_framing_position", 134, 0, 22)
class TargetFramingPosition(Message, frozen=True):
    """Wanted position of the target in the picture: percent of width and height."""

    horizontal: Annotated[int, I8]
    vertical: Annotated[int, I8]


@event("follow_me.target_framing_position_changed", 134, 0, 23)
class TargetFramingPositionChanged(Message, frozen=True):
    horizontal: Annotated[int, I8]
    vertical: Annotated[int, I8]


@command("follow_me.target_image_detection", 134, 0, 24, Buffer.NON_ACK)
class TargetImageDetection(Message, frozen=True):
    """Detection of the target by a tracker outside of the drone: rad, 1/s, ms."""

    target_azimuth: Annotated[float, F32]
    target_elevation: Annotated[float, F32]
    change_of_scale: Annotated[float, F32]
    confidence_index: Annotated[int, U8]
    is_new_selection: Annotated[int, U8]
    timestamp: Annotated[int, U64]


@event("follow_me.target_image_detection_state", 134, 0, 25)
class TargetImageDetectionState(Message, frozen=True):
    state: Annotated[ImageDetectionStatus, ENUM]


@command("follow_me.set_target_is_controller", 134, 0, 26)
class SetTargetIsController(Message, frozen=True):
    target_is_controller: Annotated[int, U8]
