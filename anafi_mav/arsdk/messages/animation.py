"""Feature 144, animation: flights the drone does by itself to make a picture or a film.

Angles are radians, distances metres, speeds m/s and rad/s. Of the values in a start command only those count whose
bit is set in `provided_params`; the drone takes its defaults for the others.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, F32, U8, U32, Bits, Message, OpenEnum, command, event
from anafi_mav.arsdk.messages.generic import ListFlags


class Type(OpenEnum):
    NONE = 0
    FLIP = 1
    HORIZONTAL_PANORAMA = 2
    DRONIE = 3
    HORIZONTAL_REVEAL = 4
    VERTICAL_REVEAL = 5
    SPIRAL = 6
    PARABOLA = 7
    CANDLE = 8
    DOLLY_SLIDE = 9
    VERTIGO = 10
    TWIST_UP = 11
    POSITION_TWIST_UP = 12
    HORIZONTAL_180_PHOTO_PANORAMA = 13
    VERTICAL_180_PHOTO_PANORAMA = 14
    SPHERICAL_PHOTO_PANORAMA = 15
    SUPER_WIDE_PHOTO_PANORAMA = 16


class FlipType(OpenEnum):
    FRONT = 0
    BACK = 1
    LEFT = 2
    RIGHT = 3


class AnimationState(OpenEnum):
    IDLE = 0
    RUNNING = 1
    CANCELING = 2


class HorizontalPanoramaConfigParam(OpenEnum):
    ROTATION_ANGLE = 0
    ROTATION_SPEED = 1


class DronieConfigParam(OpenEnum):
    SPEED = 0
    DISTANCE = 1
    PLAY_MODE = 2


class PlayMode(OpenEnum):
    NORMAL = 0
    ONCE_THEN_MIRRORED = 1


class HorizontalRevealConfigParam(OpenEnum):
    SPEED = 0
    DISTANCE = 1
    PLAY_MODE = 2


class VerticalRevealConfigParam(OpenEnum):
    SPEED = 0
    VERTICAL_DISTANCE = 1
    ROTATION_ANGLE = 2
    ROTATION_SPEED = 3
    PLAY_MODE = 4


class SpiralConfigParam(OpenEnum):
    SPEED = 0
    RADIUS_VARIATION = 1
    VERTICAL_DISTANCE = 2
    REVOLUTION_NB = 3
    PLAY_MODE = 4


class ParabolaConfigParam(OpenEnum):
    SPEED = 0
    VERTICAL_DISTANCE = 1
    PLAY_MODE = 2


class CandleConfigParam(OpenEnum):
    SPEED = 0
    VERTICAL_DISTANCE = 1
    PLAY_MODE = 2


class DollySlideConfigParam(OpenEnum):
    SPEED = 0
    ANGLE = 1
    HORIZONTAL_DISTANCE = 2
    PLAY_MODE = 3


class VertigoConfigParam(OpenEnum):
    DURATION = 0
    MAX_ZOOM_LEVEL = 1
    FINISH_ACTION = 2
    PLAY_MODE = 3


class VertigoFinishAction(OpenEnum):
    NONE = 0
    UNZOOM = 1


class TwistUpConfigParam(OpenEnum):
    SPEED = 0
    VERTICAL_DISTANCE = 1
    ROTATION_ANGLE = 2
    ROTATION_SPEED = 3
    PLAY_MODE = 4


class Mode(OpenEnum):
    FOLLOW_ME = 0
    MANUAL = 1
    POI = 2
    LOOK_AT = 3
    FLIGHT_PLAN = 4


class Indicator(OpenEnum):
    DRONE_GPS = 0
    DRONE_MAGNETO = 1
    DRONE_GEOFENCE = 2
    DRONE_MIN_ALTITUDE = 3
    DRONE_MAX_ALTITUDE = 4
    DRONE_FLYING = 5
    TARGET_POSITION_ACCURACY = 6
    TARGET_IMAGE_DETECTION = 7
    DRONE_TARGET_DISTANCE_MIN = 8
    DRONE_TARGET_DISTANCE_MAX = 9
    TARGET_HORIZ_SPEED = 10
    TARGET_VERT_SPEED = 11
    TARGET_ALTITUDE_ACCURACY = 12
    DRONE_BATTERY = 13
    DRONE_STATE = 14


@event("animation.availability", 144, 0, 1)
class Availability(Message, frozen=True):
    values: Annotated[int, Bits(U32, Type)]


@event("animation.state", 144, 0, 2)
class State(Message, frozen=True):
    type: Annotated[Type, ENUM]
    percent: Annotated[int, U8]


@command("animation.cancel", 144, 0, 3)
class Cancel(Message, frozen=True):
    pass


@command("animation.start_flip", 144, 0, 4)
class StartFlip(Message, frozen=True):
    type: Annotated[FlipType, ENUM]


@event("animation.flip_state", 144, 0, 5)
class FlipState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    type: Annotated[FlipType, ENUM]


@command("animation.start_horizontal_panorama", 144, 0, 6)
class StartHorizontalPanorama(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, HorizontalPanoramaConfigParam)]
    rotation_angle: Annotated[float, F32]
    rotation_speed: Annotated[float, F32]


@event("animation.horizontal_panorama_state", 144, 0, 7)
class HorizontalPanoramaState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    rotation_angle: Annotated[float, F32]
    rotation_speed: Annotated[float, F32]


@command("animation.start_dronie", 144, 0, 8)
class StartDronie(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, DronieConfigParam)]
    speed: Annotated[float, F32]
    distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.dronie_state", 144, 0, 9)
class DronieState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    speed: Annotated[float, F32]
    distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_horizontal_reveal", 144, 0, 10)
class StartHorizontalReveal(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, HorizontalRevealConfigParam)]
    speed: Annotated[float, F32]
    distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.horizontal_reveal_state", 144, 0, 11)
class HorizontalRevealState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    speed: Annotated[float, F32]
    distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_vertical_reveal", 144, 0, 12)
class StartVerticalReveal(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, VerticalRevealConfigParam)]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    rotation_angle: Annotated[float, F32]
    rotation_speed: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.vertical_reveal_state", 144, 0, 13)
class VerticalRevealState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    rotation_angle: Annotated[float, F32]
    rotation_speed: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_spiral", 144, 0, 14)
class StartSpiral(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, SpiralConfigParam)]
    speed: Annotated[float, F32]
    radius_variation: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    revolution_nb: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.spiral_state", 144, 0, 15)
class SpiralState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    speed: Annotated[float, F32]
    radius_variation: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    revolution_nb: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_parabola", 144, 0, 16)
class StartParabola(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, ParabolaConfigParam)]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.parabola_state", 144, 0, 17)
class ParabolaState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_candle", 144, 0, 18)
class StartCandle(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, CandleConfigParam)]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.candle_state", 144, 0, 19)
class CandleState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_dolly_slide", 144, 0, 20)
class StartDollySlide(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, DollySlideConfigParam)]
    speed: Annotated[float, F32]
    angle: Annotated[float, F32]
    horizontal_distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.dolly_slide_state", 144, 0, 21)
class DollySlideState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    speed: Annotated[float, F32]
    angle: Annotated[float, F32]
    horizontal_distance: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_vertigo", 144, 0, 22)
class StartVertigo(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, VertigoConfigParam)]
    duration: Annotated[float, F32]
    max_zoom_level: Annotated[float, F32]
    finish_action: Annotated[VertigoFinishAction, ENUM]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.vertigo_state", 144, 0, 23)
class VertigoState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    duration: Annotated[float, F32]
    max_zoom_level: Annotated[float, F32]
    finish_action: Annotated[VertigoFinishAction, ENUM]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_twist_up", 144, 0, 24)
class StartTwistUp(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, TwistUpConfigParam)]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    rotation_angle: Annotated[float, F32]
    rotation_speed: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.twist_up_state", 144, 0, 25)
class TwistUpState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    rotation_angle: Annotated[float, F32]
    rotation_speed: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_position_twist_up", 144, 0, 26)
class StartPositionTwistUp(Message, frozen=True):
    provided_params: Annotated[int, Bits(U8, TwistUpConfigParam)]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    rotation_angle: Annotated[float, F32]
    rotation_speed: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@event("animation.position_twist_up_state", 144, 0, 27)
class PositionTwistUpState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]
    speed: Annotated[float, F32]
    vertical_distance: Annotated[float, F32]
    rotation_angle: Annotated[float, F32]
    rotation_speed: Annotated[float, F32]
    play_mode: Annotated[PlayMode, ENUM]


@command("animation.start_horizontal_180_photo_panorama", 144, 0, 28)
class StartHorizontal180PhotoPanorama(Message, frozen=True):
    pass


@event("animation.horizontal_180_photo_panorama_state", 144, 0, 29)
class Horizontal180PhotoPanoramaState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]


@command("animation.start_vertical_180_photo_panorama", 144, 0, 30)
class StartVertical180PhotoPanorama(Message, frozen=True):
    pass


@event("animation.vertical_180_photo_panorama_state", 144, 0, 31)
class Vertical180PhotoPanoramaState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]


@command("animation.start_spherical_photo_panorama", 144, 0, 32)
class StartSphericalPhotoPanorama(Message, frozen=True):
    pass


@event("animation.spherical_photo_panorama_state", 144, 0, 33)
class SphericalPhotoPanoramaState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]


@event("animation.capabilities", 144, 0, 34)
class Capabilities(Message, frozen=True):
    mode: Annotated[Mode, ENUM]
    type: Annotated[int, Bits(U32, Type)]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("animation.info", 144, 0, 35)
class Info(Message, frozen=True):
    type: Annotated[Type, ENUM]
    missing_inputs: Annotated[int, Bits(U32, Indicator)]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("animation.super_wide_photo_panorama_state", 144, 0, 36)
class SuperWidePhotoPanoramaState(Message, frozen=True):
    state: Annotated[AnimationState, ENUM]


@command("animation.start_super_wide_photo_panorama", 144, 0, 37)
class StartSuperWidePhotoPanorama(Message, frozen=True):
    pass
