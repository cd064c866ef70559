"""camera2: what its settings and states can be."""

from __future__ import annotations

from anafi_mav.arsdk.codec.wire import OpenEnum


class AudioRecordingMode(OpenEnum):
    MUTE = 0
    DRONE = 1


class AutoRecordMode(OpenEnum):
    DISABLED = 0
    FLIGHT = 1


class BracketingPreset(OpenEnum):
    _1EV = 0
    _2EV = 1
    _3EV = 2
    _1EV_2EV = 3
    _1EV_3EV = 4
    _2EV_3EV = 5
    _1EV_2EV_3EV = 6


class BurstValue(OpenEnum):
    _14_OVER_4S = 0
    _14_OVER_2S = 1
    _14_OVER_1S = 2
    _10_OVER_4S = 3
    _10_OVER_2S = 4
    _10_OVER_1S = 5
    _4_OVER_4S = 6
    _4_OVER_2S = 7
    _4_OVER_1S = 8


class CameraMode(OpenEnum):
    PHOTO = 0
    RECORDING = 1


class CameraModel(OpenEnum):
    MAIN = 0
    THERMAL_BLENDED = 1


class CameraSubtype(OpenEnum):
    WIDE = 0
    TELE = 1


class CameraType(OpenEnum):
    DEFAULT = 0
    FRONT = 1
    STEREO_LEFT = 2
    STEREO_RIGHT = 3
    VERTICAL = 4
    DISPARITY = 5
    HORIZONTAL_STEREO_LEFT = 6
    HORIZONTAL_STEREO_RIGHT = 7
    DOWN_STEREO_LEFT = 8
    DOWN_STEREO_RIGHT = 9
    EXTERNAL = 10


class DigitalSignature(OpenEnum):
    NONE = 0
    DRONE = 1


class DynamicRange(OpenEnum):
    STANDARD = 0
    HDR8 = 1
    HDR10 = 2


class EvCompensation(OpenEnum):
    MINUS_3_00 = 0
    MINUS_2_67 = 1
    MINUS_2_33 = 2
    MINUS_2_00 = 3
    MINUS_1_67 = 4
    MINUS_1_33 = 5
    MINUS_1_00 = 6
    MINUS_0_67 = 7
    MINUS_0_33 = 8
    _0_00 = 9
    _0_33 = 10
    _0_67 = 11
    _1_00 = 12
    _1_33 = 13
    _1_67 = 14
    _2_00 = 15
    _2_33 = 16
    _2_67 = 17
    _3_00 = 18


class ExposureLockMode(OpenEnum):
    UNLOCKED = 0
    FULL_LOCK = 1
    ROI_LOCK = 2


class ExposureMetering(OpenEnum):
    STANDARD = 0
    CENTER_TOP = 1


class ExposureMode(OpenEnum):
    AUTOMATIC = 0
    AUTOMATIC_PREFER_ISO_SENSITIVITY = 1
    AUTOMATIC_PREFER_SHUTTER_SPEED = 2
    MANUAL_ISO_SENSITIVITY = 3
    MANUAL_SHUTTER_SPEED = 4
    MANUAL = 5


class Framerate(OpenEnum):
    _24 = 0
    _25 = 1
    _30 = 2
    _48 = 3
    _50 = 4
    _60 = 5
    _96 = 6
    _100 = 7
    _120 = 8
    _9 = 9
    _12 = 10
    _12_POINT_5 = 11
    _15 = 12
    _7_POINT_5 = 13


class ImageStyle(OpenEnum):
    CUSTOM = 0
    STANDARD = 1
    PLOG = 2
    INTENSE = 3
    PASTEL = 4
    PHOTOGRAMMETRY = 5


class IsoSensitivity(OpenEnum):
    _25 = 0
    _50 = 1
    _64 = 2
    _80 = 3
    _100 = 4
    _125 = 5
    _160 = 6
    _200 = 7
    _250 = 8
    _320 = 9
    _400 = 10
    _500 = 11
    _640 = 12
    _800 = 13
    _1000 = 14
    _1200 = 15
    _1600 = 16
    _2000 = 17
    _2500 = 18
    _3200 = 19
    _4000 = 20
    _5000 = 21
    _6400 = 22
    _8000 = 23
    _10000 = 24
    _12800 = 25
    _16000 = 26
    _20000 = 27
    _25600 = 28
    _32000 = 29
    _40000 = 30
    _51200 = 31


class LowLightMode(OpenEnum):
    DISABLED = 0
    ENABLED = 1


class LowLightModeSelection(OpenEnum):
    MANUAL = 0
    AUTOMATIC = 1


class PhotoEvent(OpenEnum):
    START = 0
    TAKING_PHOTO = 1
    STOP = 4
    NONE = 5


class PhotoFileFormat(OpenEnum):
    JPEG = 0
    DNG_JPEG = 2


class PhotoFormat(OpenEnum):
    FULL_FRAME = 0
    RECTILINEAR = 1
    FULL_FRAME_STABILIZED = 2


class PhotoMode(OpenEnum):
    SINGLE = 0
    BRACKETING = 1
    BURST = 2
    TIME_LAPSE = 3
    GPS_LAPSE = 4


class PhotoResolution(OpenEnum):
    _48_MEGA_PIXELS = 0
    _21_MEGA_PIXELS = 1
    _12_MEGA_PIXELS = 2
    _50_MEGA_PIXELS = 3
    _12_POINT_5_MEGA_PIXELS = 4


class PhotoState(OpenEnum):
    UNAVAILABLE = 0
    INACTIVE = 1
    ACTIVE = 2


class PhotoStopReason(OpenEnum):
    USER_REQUEST = 0
    CAPTURE_DONE = 1
    CONFIGURATION_CHANGE = 2
    INTERNAL_ERROR = 3
    INSUFFICIENT_STORAGE_SPACE = 4
    INACTIVE_CAMERA = 5
    ARBITRATION = 6
    ALREADY = 7
    STORAGE_UNAVAILABLE = 8
    STORAGE_ENCRYPTED = 9


class PhotoStreamingMode(OpenEnum):
    INTERRUPT = 0
    CONTINUOUS = 1


class RecordingEvent(OpenEnum):
    START = 0
    STOP = 1
    STOPPING = 2
    NONE = 3


class RecordingState(OpenEnum):
    UNAVAILABLE = 0
    INACTIVE = 1
    ACTIVE = 3


class RecordingStopReason(OpenEnum):
    USER_REQUEST = 0
    CONFIGURATION_CHANGE = 2
    INTERNAL_ERROR = 3
    INSUFFICIENT_STORAGE_SPACE = 4
    INSUFFICIENT_STORAGE_SPACE_FALLBACK = 10
    INSUFFICIENT_STORAGE_SPEED = 5
    INACTIVE_CAMERA = 6
    ARBITRATION = 7
    ALREADY = 8
    STORAGE_UNAVAILABLE = 9
    STORAGE_ENCRYPTED = 11


class ShutterSpeed(OpenEnum):
    _1_OVER_10000 = 0
    _1_OVER_8000 = 1
    _1_OVER_6400 = 2
    _1_OVER_5000 = 3
    _1_OVER_4000 = 4
    _1_OVER_3200 = 5
    _1_OVER_2500 = 6
    _1_OVER_2000 = 7
    _1_OVER_1600 = 8
    _1_OVER_1250 = 9
    _1_OVER_1000 = 10
    _1_OVER_800 = 11
    _1_OVER_640 = 12
    _1_OVER_500 = 13
    _1_OVER_400 = 14
    _1_OVER_320 = 15
    _1_OVER_240 = 16
    _1_OVER_200 = 17
    _1_OVER_160 = 18
    _1_OVER_120 = 19
    _1_OVER_100 = 20
    _1_OVER_80 = 21
    _1_OVER_60 = 22
    _1_OVER_50 = 23
    _1_OVER_40 = 24
    _1_OVER_30 = 25
    _1_OVER_25 = 26
    _1_OVER_15 = 27
    _1_OVER_10 = 28
    _1_OVER_8 = 29
    _1_OVER_6 = 30
    _1_OVER_4 = 31
    _1_OVER_3 = 32
    _1_OVER_2 = 33
    _1_OVER_1_POINT_5 = 34
    _1 = 35


class Spectrum(OpenEnum):
    VISIBLE = 0
    THERMAL = 1


class StoragePolicy(OpenEnum):
    PRIORITY_REMOVABLE = 0
    INTERNAL = 1
    REMOVABLE = 2
    PRIORITY_INTERNAL = 3


class StorageType(OpenEnum):
    INTERNAL = 0
    REMOVABLE = 1
    NONE = 2


class StreamReceiver(OpenEnum):
    DEFAULT = 0
    SKYCONTROLLER = 1


class VideoCodec(OpenEnum):
    H264 = 0
    H265 = 1


class VideoRecordingMode(OpenEnum):
    STANDARD = 0


class VideoResolution(OpenEnum):
    RESERVED = 0
    _2160P = 1
    _1080P = 3
    _720P = 4


class WhiteBalanceLockMode(OpenEnum):
    UNLOCKED = 0
    LOCKED = 1


class WhiteBalanceMode(OpenEnum):
    CUSTOM = 0
    AUTOMATIC = 1
    CANDLE = 2
    SUNSET = 3
    INCANDESCENT = 4
    WARM_WHITE_FLUORESCENT = 5
    HALOGEN = 6
    FLUORESCENT = 7
    COOL_WHITE_FLUORESCENT = 8
    FLASH = 9
    DAYLIGHT = 10
    SUNNY = 11
    CLOUDY = 12
    SNOW = 13
    HAZY = 14
    SHADED = 15
    GREEN_FOLIAGE = 16
    BLUE_SKY = 17


class WhiteBalanceTemperature(OpenEnum):
    _1500 = 0
    _1750 = 1
    _2000 = 2
    _2250 = 3
    _2500 = 4
    _2750 = 5
    _3000 = 6
    _3250 = 7
    _3500 = 8
    _3750 = 9
    _4000 = 10
    _4250 = 11
    _4500 = 12
    _4750 = 13
    _5000 = 14
    _5250 = 15
    _5500 = 16
    _5750 = 17
    _6000 = 18
    _6250 = 19
    _6500 = 20
    _6750 = 21
    _7000 = 22
    _7250 = 23
    _7500 = 24
    _7750 = 25
    _8000 = 26
    _8250 = 27
    _8500 = 28
    _8750 = 29
    _9000 = 30
    _9250 = 31
    _9500 = 32
    _9750 = 33
    _10000 = 34
    _10250 = 35
    _10500 = 36
    _10750 = 37
    _11000 = 38
    _11250 = 39
    _11500 = 40
    _11750 = 41
    _12000 = 42
    _12250 = 43
    _12500 = 44
    _12750 = 45
    _13000 = 46
    _13250 = 47
    _13500 = 48
    _13750 = 49
    _14000 = 50
    _14250 = 51
    _14500 = 52
    _14750 = 53
    _15000 = 54


class ZoomControlMode(OpenEnum):
    LEVEL = 0
    VELOCITY = 1
    HFOV = 2


class ZoomGotoPresetEnum(OpenEnum):
    FIRST = 0
    LAST = 1
    PREV = 2
    NEXT = 3


class ZoomPresetEnum(OpenEnum):
    WIDE = 0
    THERMAL = 1
    TELE = 2
    MAX = 3


class ZoomVelocityControlQualityMode(OpenEnum):
    ALLOW_DEGRADATION = 0
    STOP_BEFORE_DEGRADATION = 1
