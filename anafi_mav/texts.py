"""The texts that a pilot reads: STATUSTEXT and the reasons of refusals.

A text is `Subject state: reason (number)`, in the present tense, and at most 50 bytes with its longest values, so that
one STATUSTEXT carries it. A test fills each. Only this module makes a `OperatorText`: mypy finds a literal elsewhere.
Texts from below (the reason of a drone's verb, of the operating system) are values that are filled in.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from anafi_mav.errors import CommandTimeout, Disconnected

STATUSTEXT_BYTES = 50
"""Of one message (MAVLink common.xml STATUSTEXT)."""

REASON_BYTES = 32
"""Of a reason with its longest values: it fits behind `Setpoint refused: `."""


_Text = TypeVar("_Text", bound="OperatorText")


class OperatorText(str):
    """A finished text."""

    __slots__ = ("pattern",)

    pattern: str
    """The text with its fields unfilled: equal in texts that differ in their values alone."""

    def __new__(cls: type[_Text], text: object, pattern: str | None = None) -> _Text:
        self = super().__new__(cls, text)
        self.pattern = str(text) if pattern is None else pattern
        return self


class Subject(OperatorText):
    """The subject of a refusal."""

    __slots__ = ()


class Reason(OperatorText):
    """A clause for the end of another text."""

    __slots__ = ()


class Notice(OperatorText):
    """A text without a limit of length: it names a file or a key."""

    __slots__ = ()


class Template:
    """A text with fields; `longest` holds the longest expected value of each field."""

    kind: type[OperatorText] = OperatorText

    def __init__(self, pattern: str, **longest: object) -> None:
        self.pattern = pattern
        self.longest = longest

    def fill(self, **values: object) -> OperatorText:
        """Return the text with these values."""
        filled = {name: from_below(value) if isinstance(value, Exception) else value for name, value in values.items()}
        return self.kind(self.pattern.format(**filled), self.pattern)


class ReasonTemplate(Template):
    """A clause with fields for the end of another text."""

    kind = Reason


class NoticeTemplate(Template):
    """A text with fields and without a limit of length.

    It names a file or a key, or quotes a long explanation.
    """

    kind = Notice


class Below:
    """Stands for a text of a lower layer, whose length this table does not know.

    The STATUSTEXT may take several messages.
    """

    def __init__(self, example: str) -> None:
        self.example = example

    def __format__(self, spec: str) -> str:
        return self.example


BELOW = Below("no answer in 5 s")


def from_below(text: object) -> OperatorText:
    """Return the text of a lower layer: an error of the drone or of the operating system.

    That of a drone without an answer or a link fits one STATUSTEXT: the log has Parrot's name of the command.
    """
    if isinstance(text, CommandTimeout):
        return NO_ANSWER.fill(seconds=text.seconds)
    return LINK_LOST if isinstance(text, Disconnected) else Reason(text)


def joined(reasons: Iterable[OperatorText]) -> OperatorText:
    """Return several reasons as one."""
    return PROBLEMS.fill(problems="; ".join(reasons))


# == Refusals ==

REFUSED = Template("{what} refused: {reason}", what="Setpoint", reason="r" * REASON_BYTES)
PREARM = Template("PreArm: {reason}", reason="r" * REASON_BYTES)
NOT_ABORTED = Template("{what} not aborted: {reason}", what="Landing", reason="already landed")
NOT_CANCELLED = Template("{what} not cancelled: {reason}", what="Return", reason="it has started")
PROBLEMS = ReasonTemplate("{problems}", problems=BELOW)
FAILED = Template("{what} failed: {reason}", what="Setpoint", reason="r" * REASON_BYTES)

NO_ANSWER = ReasonTemplate("no answer in {seconds:g} s", seconds=0.75)
LINK_LOST = Reason("link lost")

# == Subjects of refusals ==

ALTITUDE_CHANGE = Subject("Altitude change")
ARMING = Subject("Arming")
CALIBRATION = Subject("Calibration")
CAMERA_MODE = Subject("Camera mode")
CAMERA_RESET = Subject("Camera reset")
CAMERA_SOURCE = Subject("Camera source")
COMPASS_CALIBRATION = Subject("Compass calibration")
CONTINUE = Subject("Continue")
CONTROL_REQUEST = Subject("Control request")
CURRENT_ITEM = Subject("Current item")
DISARM = Subject("Disarm")
FENCE = Subject("Fence")
FLIGHT_COMMAND = Subject("Command")
FOLLOW = Subject("Follow")
FORMAT = Subject("Format")
GIMBAL = Subject("Gimbal")
GOTO = Subject("Goto")
HEIGHT = Subject("Height")
HOME = Subject("Home")
LANDING = Subject("Landing")
MESSAGE = Subject("Message")
MISSION = Subject("Mission")
ITEM = Template("Item {number}", number=9999)
MODE = Subject("Mode")
MOTOR_CUT = Subject("Motor cut")
OFFBOARD = Subject("Offboard")
ORBIT = Subject("Orbit")
PANORAMA = Subject("Panorama")
PAUSE = Subject("Pause")
PHOTO = Subject("Photo")
POSITION = Subject("Position")
RECORDING = Subject("Recording")
RESTART = Subject("Restart")
RETURN = Subject("Return")
RTL_LAND_DELAY = Subject("RTL_LAND_DELAY")
ROI = Subject("ROI")
SETPOINT = Subject("Setpoint")
SETPOINT_TAKEOFF = Subject("Takeoff by setpoints")
SPEED = Subject("Speed")
TAKEOFF = Subject("Takeoff")
TARGET = Subject("Target")
TERMINATION = Subject("Termination")
TURN = Subject("Turn")
VIDEO_STREAM = Subject("Video stream")
ZOOM = Subject("Zoom")

# == Reasons: state of the drone ==

NO_FIX = Reason("no GPS fix")
HEIGHT_UNKNOWN = Reason("height unknown")
GROUND_HEIGHT_UNKNOWN = Reason("height above ground unknown")
HEADING_UNKNOWN = Reason("heading unknown")
POSITION_UNKNOWN = Reason("position unknown")
MOTION_UNKNOWN = Reason("velocity unknown")
TAKEOFF_POINT_UNKNOWN = Reason("take-off point unknown")
AMSL_UNKNOWN = Reason("AMSL unknown, no GPS fix")
TILT_UNKNOWN = Reason("tilt limits unknown")
FLYING_STATE_UNKNOWN = Reason("flying state unknown")
CAMERA_RECORDS = Reason("camera is recording")
EMERGENCY_STOP = Reason("emergency stop")
ON_GROUND = Reason("drone is on the ground")
NOT_ON_GROUND = Reason("not on the ground")
NOT_IN_AIR = Reason("drone is not in the air")
IN_AIR = Reason("drone is in the air")
TAKE_OFF_FIRST = Reason("take off first")
TAKE_OFF_OR_GUIDED = Reason("take off first, or choose Guided")
STARTS_MOTORS = Reason("drone is starting its motors")
TAKES_OFF = Reason("drone is taking off")
WILL_TAKE_OFF = Reason("drone is about to take off")
LANDS = Reason("drone is landing")
RETURNS = Reason("drone is returning")
HOVERS = Reason("drone is hovering")
FLIES = Reason("drone is flying")
FORCED = Reason("forced landing")
PILOT_LANDS = Reason("Skycontroller pilot is landing")
PILOT_RETURNS = Reason("Skycontroller pilot is returning")
RETURNS_BY_ITSELF = Reason("drone is returning by itself")
MOTOR_DOWN = Reason("drone returns, motor down")
ALREADY_LANDED = Reason("already landed")
PILOT = Reason("Skycontroller pilot in control")
PILOT_SWITCH = Reason("pilot flies, ANF_SC_OFFBOARD 0")
STICKS_FOLLOW_CAMERA = Reason("sticks relative to camera")
ROLL_INVERTED = Reason("roll sign inverted")
MOTORS_STOPPING = Reason("motor cut in progress")
JUST_TAKEN_OFF = Reason("took off, drone is landing")

# == Reasons: bounds ==

NOT_A_NUMBER = Reason("not a number")
TOO_LOW = ReasonTemplate("relative {height:.1f} m < {lowest:.1f} m", height=-99999.9, lowest=-999.9)
ABOVE_CEILING = ReasonTemplate("{height:.1f} m > ceiling {ceiling:g} m", height=99999.9, ceiling=4000.5)
NEAR_ESTIMATE = ReasonTemplate("estimated AMSL: {height:.0f} m < {lowest:g} m", height=-99, lowest=15)
NOT_ON_EARTH = Reason("not a place on earth")
AT_NULL = Reason("latitude and longitude are 0")
TOO_FAR = ReasonTemplate("{distance:.0f} m away > {limit:g} m", distance=99999999, limit=4000)
BEYOND_GEOFENCE = ReasonTemplate("{distance:.0f} m > geofence {limit:g} m", distance=9999, limit=4000.5)
BELOW_FENCE = ReasonTemplate("{height:.1f} m < fence floor {floor:g} m", height=-9999.9, floor=999)
FENCE_NO_FIX = Reason("no GPS fix inside a fence")
BEYOND_ZONE = ReasonTemplate("{distance:.0f} m beyond {zone}", distance=999, zone="inclusion 120-123")
WAY_LEAVES_ZONE = ReasonTemplate("path crosses {zone}", zone="inclusion 120-123")

# == Signing ==

SIGNING = Subject("Signing")
SYSTEM_ARMED = ReasonTemplate("system {system} is armed", system=250)
SYSTEM_UNKNOWN = ReasonTemplate("state of system {system} is unknown", system=250)
ACCESS_TOO_LOW = ReasonTemplate("access of endpoint is {access}", access="observe")
REMOTE_AND_UNSIGNED = Reason("endpoint is not on loopback")
NO_KEY_FOLDER = Reason("gateway has no state folder")
KEY_UNWRITABLE = Reason("key file cannot be written")
SIGNING_KEY_CHANGED = Template("Signing key changed by system {system}", system=255)
SIGNING_SWITCHED_OFF = Template("Signing switched off by system {system}", system=255)
SIGNING_ON = OperatorText("Signing on: key in use")
SIGNING_OFF = OperatorText("Signing off")

# == Operator control ==

OTHER_OPERATOR = ReasonTemplate("operator is system {system}", system=255)
SENDER_NOT_IN_RANGE = Reason("sender not in param4-5")
PARAM2_BINARY = Reason("param2 must be 0 or 1")
OPERATOR_IS = Template("Operator: system {system}", system=255)
OPERATOR_REPLACED = Template("Operator: system {system}, was system {before}", system=255, before=255)
OPERATOR_RELEASED = Template("Operator: none, released by system {system}", system=255)
OPERATOR_SILENT = Template("Operator: none, system {system} is silent", system=255)
CONTROL_REQUESTED = Template("Control requested: system {system} waits {seconds:.0f} s", system=255, seconds=60)
CONTROL_OFFERED = Template("Control offered by system {system}: request again", system=255)
CONTROL_NOT_OFFERED = Template("Control request expired: operator is system {system}", system=255)

# == Reasons: clients ==

PAUSED_BY_CLIENT = Reason("paused by a client")
AGAIN_WITHIN = ReasonTemplate("again within {seconds:g} s", seconds=99)
OTHER_PROGRAM = Reason("another program flies")
TOO_MANY_PROGRAMS = Reason("too many programs stream")
NOT_ARMED_BY_CLIENT = Reason("this client has not armed")
ARMING_EXPIRED = Reason("armed state has expired")
IN_MODE = ReasonTemplate("mode {mode}, not Guided", mode="Terminated")
NOT_OFFBOARD = ReasonTemplate("mode {mode}, not Offboard", mode="Terminated")
NOT_CHOSEN = Reason("mode not chosen by this client")
NO_CLIMB = Reason("on the ground, no climb")
WAITED_TOO_LONG = Reason("waited too long")
NO_SETPOINTS = Reason("no setpoints received")
SETPOINTS_STOPPED = Reason("setpoints stopped")
ANOTHER_CLIENT_TRANSFERS = Reason("another client transfers")
STICKS_DO_NOT_ARM = Reason("arm by command")
NOTHING_PAUSED = Reason("nothing paused, or replaced")
OTHER_STICKS = Reason("another joystick flies")
OTHER_TARGET = Reason("another target is followed")
GIMBAL_OF_CLIENT = ReasonTemplate("system {system} has control", system=255)
GIMBAL_OF_MISSION = Reason("mission has control")

# == Reasons: parameters of commands ==

MOTOR_CUT_FORBIDDEN = Reason("set allow_kill: true")
STREAM_UNKNOWN = Reason("no such stream")
BY_COMMAND_ONLY = Reason("started by command only")
NO_CHANGE_MODE = Reason("flag CHANGE_MODE is missing")
NOT_GUIDED = Reason("not in Guided")
NOT_GUIDED_NO_CHANGE_MODE = Reason("not in Guided, no CHANGE_MODE")
NO_SUCH_MODE = Reason("not a mode of an ANAFI")
NOT_REVOCABLE = Reason("motor cut is final")
PARAM1_BINARY = Reason("param1 must be 0 or 1")
PARAM1_SPEED_HEADING = Reason("speed or heading out of range")
SPEED_RANGE = ReasonTemplate("{slowest:g} to {fastest:g} m/s allowed", slowest=0.1, fastest=100)
SPEED_ALONE = Reason("speed without place or heading")
NOT_A_WAY_POINT = Reason("item is not a waypoint")
NO_THROTTLE = Reason("an ANAFI has no throttle")
PARAM1_TO_3 = Reason("param1 must be 0 to 3")
FIXED_IN_MODE = ReasonTemplate("fixed in mode {mode}", mode="Mission")
PARAM2_SPEED = ReasonTemplate("param2 {slowest:g}-{fastest:g} m/s, -1 or -2", slowest=0.1, fastest=100)
PARAM2_FRAME = Reason("param2 must be a frame")
PARAM1_ANGLE = Reason("param1 must be -360 to 360 deg")
PARAM2_RATE = ReasonTemplate("param2 < {slowest:g} deg/s or bad param3", slowest=3)
PARAM4_BINARY = Reason("param4 must be 0 or 1")
BAD_LATITUDE = Reason("latitude out of range")
BAD_LONGITUDE = Reason("longitude out of range")
NO_PLACE = Reason("no position given")
ROI_KINDS = Reason("only a location or none")
NO_SUCH_GIMBAL = ReasonTemplate("no gimbal {number:g}", number=-1.23457e-38)
NO_GIMBAL = Reason("drone reports no gimbal")
NO_SUCH_AXIS = Reason("gimbal lacks this axis")
GIMBAL_CALIBRATES = Reason("gimbal calibration runs")
NO_RETRACT = Reason("cannot retract")
TWO_YAW_FRAMES = Reason("both yaw frame flags")
GIMBAL_ANGLE = Reason("angle beyond 360 deg")
GIMBAL_RATE = Reason("rate beyond 1000 deg/s")
GIMBAL_SHARE = Reason("share beyond -1 to 1")
GIMBAL_IDS = Reason("param1-4 are no client ids")
GIMBAL_NO_CLIENT = Reason("sender has no id")
GIMBAL_NO_PRIMARY = Reason("no primary client")
GIMBAL_MODE = ReasonTemplate("mount mode {mode:g} unsupported", mode=255)
FRAME_UNSUPPORTED = ReasonTemplate("frame {frame} unsupported", frame=255)
TERRAIN_UNSUPPORTED = ReasonTemplate("terrain frame {frame} unsupported", frame=11)
LATITUDE_LONGITUDE_NUMBERS = Reason("latitude or longitude missing")
RESTART_ONLY = Reason("only a restart is possible")
CALIBRATIONS = Reason("only compass and gimbal")
NOT_CALIBRATED = Reason("none done")
RADIUS_RANGE = ReasonTemplate("radius {smallest:g} to {largest:g} m allowed", smallest=5, largest=1000)
ORBIT_NO_CENTRE = Reason("no centre and no GPS fix")
PARAM2_ORBIT = Reason("param2 must be a speed in m/s")
PARAM3_ORBIT = Reason("param3 must be 0 to 5")
PARAM4_ORBIT = Reason("param4 must be an angle in rad")
FENCE_PARAMS = Reason("param1 0-2, param2 FENCE_TYPE")
FENCE_KIND_NOT_CHOSEN = Reason("kind not in ANF_FENCE_TYPES")
CEILING_STAYS = Reason("ceiling cannot be disabled")
OWN_CIRCLE_STAYS = Reason("circle set by ANF_GEOFENCE")
CEILING_BIT = Reason("bit 0 stays set (ceiling)")
FENCE_RADIUS = ReasonTemplate("radius below {radius:g} m", radius=10)
LAND_DELAY = Reason("must be -1, 0 or more")
KILL_FENCE = Reason("needs allow_kill: true")

# == Takeoff ==

TAKEOFF_CANCELLED = Template("Takeoff cancelled: not armed within {seconds:g} s", seconds=10)
TASK_ENDED = Template("{what} ended: {reason}", what="Offboard", reason="r" * REASON_BYTES)
TAKEOFF_FAILED = Template("Takeoff failed: {error}", error=BELOW)
TAKEOFF_PLACE = Template("Takeoff straight up: place {metres:.0f} m away ignored", metres=20_004_000)
LANDING_ELSEWHERE = Template("Landing here: place {metres:.0f} m away ignored", metres=20_004_000)
LOITER_ELSEWHERE = Template("Loiter here: place {metres:.0f} m away ignored", metres=20_004_000)
TAKEOFF_LATE = OperatorText("Takeoff begun late, or by another controller")
TAKEOFF_UNFINISHED = ReasonTemplate("takeoff not over after {seconds:.0f} s", seconds=99)
TAKEOFF_TOO_LOW = Reason("takeoff ended below its height")
CLIMB_ENDED = Template("Climb to {height:g} m ended at {reached:.1f} m", height=99.5, reached=99.9)
CLIMB_ABORTED = Template("Climb to {height:g} m aborted: {error}", height=99.5, error=BELOW)
DISARMED = OperatorText("Disarmed: no takeoff")
MODE_MAY_RISE = Template("{mode}: takeoff possible, to 1 m", mode="Position")
CANCEL_MAY_RISE = OperatorText("Cancelled: takeoff possible, to 1 m")
SETPOINT_TAKEOFF_SOON = Template("Takeoff by setpoints of system {system} in 1 s", system=255)
SETPOINT_TAKEOFF_NO_CLIMB = OperatorText("Takeoff by setpoints cancelled: no climb")
SETPOINT_TAKEOFF_CANCELLED = OperatorText("Takeoff by setpoints cancelled")
SETPOINT_TAKEOFF_FAILED = Template("Takeoff by setpoints failed: {error}", error=BELOW)
ORIGIN_KEPT = OperatorText("Origin not set: it is the takeoff point")
TAKEOFF_AMSL_ESTIMATED = Template("Take-off altitude estimated: GPS only (+-{error:g} m)", error=10)
TAKEOFF_AMSL_INACCURATE = Template("Take-off altitude inaccurate: GPS +-{error} m", error=9999)

# == Landing ==

LANDING_ABORTED = Template("Landing aborted by system {system}: hovering", system=255)

# == Return ==

RETURN_ANNOUNCED = Template("Returns in {seconds} s: Hold again cancels", seconds=999)
RETURN_BEGUN = Reason("it has started")
RETURN_UNAVAILABLE = Reason("unavailable, landing continues")
RETURN_BY = Template("Return by system {system}: {end}", system=255, end="lands at take-off point")
RETURN_STARTED = Template("Return: {end}", end="hovers, home is first fix")
RETURN_LINK_LOSS = OperatorText("Link loss during return: drone hovers at home")
HOME_LANDING_CANCELLED = OperatorText("Landing at home cancelled")
RETURN_LANDING_IN = Template("Return ended: landing in {seconds:.0f} s", seconds=999)
HOME_LANDING_FAILED = OperatorText("Landing at home failed, hovering")
LANDING_SOON = Template("Landing in {seconds:.0f} s, Hold cancels", seconds=5)
LANDING_SOON_AT = Template(
    "Landing in {seconds:.0f} s, Hold cancels: {distance:.0f} m from take-off", seconds=5, distance=999
)
LANDING_PLACE = Template("Landing place: {place}, {accuracy}", place="rally point 999", accuracy="GPS only")
RETURN_HOVERS = Template("Return ended, hovering {at}", at="at 9999 m")
RETURN_HOVERS_REASON = Template("Return ended, hovering {at}: {reason}", at="at 120 m", reason="home is followed")
AT_HOME = Reason("at home")
AT_HEIGHT = ReasonTemplate("at {height:.0f} m", height=9999)
RETURN_ABORTED = Template("Return aborted by system {system}: {reason}", system=255, reason="battery too hot")
RETURN_STOPPED = Template("Return stopped by a command: {reason}", reason="battery too hot")
NO_AUTOMATIC_RETURN = Template("No automatic return: battery {percent} %", percent=100)
HOME_HARDLY_REACHABLE = OperatorText("Home hardly reachable: land now")
HOME_UNREACHABLE = OperatorText("Home not reachable: land now")

TAKEOFF_POINT = Reason("take-off point")
SET_HOME = Reason("set home")
RALLY_POINT = ReasonTemplate("rally point {number}", number=255)
PRECISE = Reason("precise")
GPS_ONLY = Reason("GPS only")
LANDS_BY_SETTING = Reason("lands at home (ANF_RTH_END)")
HOVERS_AT_HOME = Reason("hovers at home")
LANDS_AT = ReasonTemplate("lands at {place}", place="rally point 255")
HOVERS_BECAUSE = ReasonTemplate("hovers, {reason}", reason="home is followed")
NO_LANDING_ZONE = Reason("no landing zone")
HOVER_STOPPED = Reason("stopped")
HOVER_UNFINISHED = Reason("not finished")
HOVER_OLD_POSITION = Reason("old GPS position")
HOVER_NO_LANDING = Reason("no landing seen")
HOVER_UNREPORTED = Reason("end not reported")
HOVER_SKYCONTROLLER = Reason("Skycontroller")
HOVER_FIRST_FIX = Reason("home is first fix")
HOVER_OLD_HOME = Reason("home set earlier")
HOVER_HOME_UNKNOWN = Reason("home unknown")
HOVER_HOME_PILOT = Reason("home is the pilot")
HOVER_HOME_FOLLOWED = Reason("home is followed")
HOVER_HOME_VEHICLE = Reason("home is a vehicle")
HOVER_FROM_HOME = ReasonTemplate("{distance:.0f} m from home", distance=9999)
HOVER_NOT_HOVERING = Reason("not hovering")
HOVER_ROI = Reason("ROI active")
HOVER_BY_SETTING = Reason("ANF_RTL_END is 1")

# == Roll sign ==

ROLL_SIGN_INVERTED = OperatorText("Roll sign inverted: velocity control refused")
ROLL_SIGN_VERIFIED = OperatorText("Roll sign verified")

# == Follow ==

TARGET_LOST = Reason("target lost")
FOLLOW_DISTANCE = ReasonTemplate("{low:g}-{high:g} m from target", low=1, high=100)
NO_TARGET = Reason("no target received")
TARGET_IGNORED = Template("Target ignored: {reason}", reason="r" * REASON_BYTES)
TARGET_FAR = ReasonTemplate("{distance:.0f} m away", distance=99999999)
TARGET_NO_POSITION = Reason("no position")
TARGET_NO_VELOCITY = Reason("velocity is not a number")
TARGET_FAST = ReasonTemplate("moves at {speed:.0f} m/s", speed=99999999)
TARGET_NO_ALTITUDE = Reason("target altitude unknown")
FOLLOW_HEIGHT_KEPT = Template("Follow height kept: target asks for {height:.0f} m", height=-9999)

# == Joysticks ==

JOYSTICK_OVERRIDE = Template("Joystick override by system {system}: Position", system=255)
STICKS_IGNORED = Template("Sticks ignored: {reason}", reason="r" * REASON_BYTES)
STICKS_IGNORED_MODE = ReasonTemplate("mode {mode}, not Position", mode="Terminated")
STICKS_SILENT = OperatorText("Sticks silent: hovering")
MANUAL_CONTROL_IGNORED = Template("MANUAL_CONTROL ignored: {reason}", reason="axis beyond 1000")
RC_OVERRIDE_IGNORED = Template("RC_CHANNELS_OVERRIDE ignored: {reason}", reason="not 800-2200 us")
AXIS_RANGE = Reason("axis beyond 1000")
THROTTLE_RANGE = Reason("throttle below 0")
CHANNEL_RANGE = ReasonTemplate("not {shortest}-{longest} us", shortest=800, longest=2200)

# == Setpoints ==

SETPOINT_DROPPED = Template("Setpoint dropped: {reason}", reason="r" * REASON_BYTES)
MOVE_CANCELLED = Reason("move cancelled elsewhere")
MOVE_FAILED = Reason("drone aborted the move")
NOT_ITS_TAKEOFF = Reason("takeoff of another client")
FOREIGN_TAKEOFF = Reason("takeoff by another controller")
GROUND_SETPOINTS_STOPPED = OperatorText("Setpoints stopped on the ground: disarming")
OFFBOARD_STOPPED_ON_GROUND = OperatorText("Setpoints stopped: on the ground")
OFFBOARD_STOPPED_TAKEOFF = OperatorText("Setpoints stopped: takeoff continues")
OFFBOARD_STOPPED_HOVER = OperatorText("Setpoints stopped: hovering")
TILT_HELD = Template("Tilt limit {tilt:.0f} deg: roll sign not verified", tilt=99)
TILT_WIND = Template(  #
    "MaxTilt {tilt:.0f}: {speed:.1f} m/s at {wind:g} m/s wind needs {needed}", tilt=40, speed=99.9, wind=10, needed=89
)
TILT_SHORT = Template("MaxTilt {tilt:.0f} deg: too low for this setpoint", tilt=40)
ATTITUDE_RATES = Reason("body rates without attitude")
ATTITUDE_NO_ROTATION = Reason("quaternion is not a rotation")
ATTITUDE_LENGTH = Reason("quaternion length is not 1")
ATTITUDE_UPSIDE_DOWN = Reason("attitude is upside down")
THRUST_RANGE = Reason("thrust is not 0 to 1")
HALF_PLACE = Reason("latitude without longitude")
NOTHING_ASKED = Reason("all fields are ignored")
NOT_ALL_NUMBERS = Reason("a value is not a number")
FORCES = Reason("forces are unsupported")
TOO_FAST = ReasonTemplate("{speed:.0f} m/s is too fast", speed=99999999)
TOO_MUCH_ACCELERATION = ReasonTemplate("{acceleration:.0f} m/s2 is too much", acceleration=99999999)
TURNS_TOO_FAST = ReasonTemplate("{rate:.0f} rad/s is too fast", rate=99999999)

# == Orbit ==

ORBIT_DONE = Reason("angle flown, hovering")
MAX_TILT = Reason("MaxTilt")
UNVERIFIED_ROLL = Reason("unverified roll")
ORBIT_SLOWED = Template(
    "Orbit {speed:.1f} m/s, not {asked:.1f}: {limit}, {tilt:.0f} deg",
    speed=9.9, asked=99.9, limit="unverified roll", tilt=40,
)  # fmt: skip

# == Gimbal ==

GIMBAL_RELEASED = Template("Gimbal free: system {system} is silent", system=255)
GIMBAL_STOPPED = Template("Gimbal stopped: {reason}", reason="r" * REASON_BYTES)
RATE_CLIENT_SILENT = ReasonTemplate("system {system} is silent", system=255)
GIMBAL_STOP_FAILED = Template("Gimbal stop not confirmed: {error}", error=BELOW)
ROI_LOST = Template("ROI kept: no position of system {system}", system=255)
REGION_INSTEAD = Reason("region of interest instead")
ROI_ENDED = Template("ROI ended: {reason}", reason="r" * REASON_BYTES)
ROI_SYSTEM_NUMBER = Reason("param1 is no system")
ROI_NO_SYSTEM = ReasonTemplate("no position of system {system:g}", system=255)
ROI_NO_WAYPOINT = Reason("no waypoint is flown to")

# == Mission ==

FIRST_LABEL = 1
"""The number of our item 0 in texts. On a station's map item 0 is home, whether or not it is sent to the vehicle
(QGroundControl FirmwarePlugin::sendHomePositionToVehicle): seq + 1 for PX4's clients, seq for ArduPilot's."""

MISSION_NOT_STARTED = Template("Mission not started: {reason}", reason="not armed within 10 s")
NOT_ARMED_WITHIN = ReasonTemplate("not armed within {seconds:g} s", seconds=10)
NO_MISSION = Reason("no mission")
MISSION_REPLACED = Reason("another was uploaded")
MISSION_CLEARED = Reason("mission was cleared")
MISSION_REPLACED_MEANWHILE = Reason("another was uploaded meanwhile")
MISSION_CLEARED_MEANWHILE = Reason("it was cleared meanwhile")
MISSION_STORING = Reason("still being stored")
MISSION_DISPLACED = Reason("another command meanwhile")
MISSION_OVER = Reason("no items left to fly")
MISSION_PART = Reason("partial start, set current item")
NO_SUCH_ITEM = ReasonTemplate("no item {number}", number=9999)
PARAM1_ITEM = Reason("param1 must be an item")
MISSION_SAME = Template("Same mission uploaded: continues at item {item}", item=999)
MISSION_STARTS = Template("Mission starts: item {item}; link loss: {alone}", item=999, alone="finish file")
MISSION_RESUMES = Template("Mission resumes: item {item}; link loss: {alone}", item=999, alone="return home")
LINK_LOSS_UNKNOWN = Reason("unknown")
LINK_LOSS_RETURNS = Reason("return home")
LINK_LOSS_CONTINUES = Reason("continue")
LINK_LOSS_FILE = Reason("finish file")
MISSION_COMPLETE = OperatorText("Mission complete")
MISSION_PAUSED = Template("Mission paused at item {item}", item=9999)
MISSION_PAUSED_REASON = Template("Mission paused at item {item}: {reason}", item=999, reason="stopped by the drone")
MISSION_PILOT = Reason("pilot in control")
MISSION_STOPPED = Reason("stopped by the drone")
MISSION_OTHER_PLAN = Reason("other plan is flown")
MISSION_LINK_LOST = Reason("link was lost")
MISSION_OUT_OF_REACH = Template("Mission item {item} skipped: out of reach", item=9999)
MISSION_LOW = Template("Mission item {item} low: {height:.1f} m above takeoff", item=9999, height=-999.9)
MISSION_TAKEOFF_AWAY = Template("Mission item {item}: takeoff place is {metres:.0f} m away", item=9999, metres=4000.0)
OTHER_PLAN = OperatorText("Drone flies a plan that is not this mission")
MISSION_PAYLOAD_CHANGED = OperatorText("Mission resumes: gimbal or camera were changed")
MISSION_RESUMED_ELSEWHERE = OperatorText("Mission resumed by another controller")
MISSION_FOUND_FLYING = Template("Mission flying: at item {item} or later", item=9999)
MISSION_FOUND_PAUSED = Template("Mission not flying: paused at item {item}", item=9999)
STEP_ZOOM_KIND = Reason("zoom is not a share in %")
STEP_ZOOM_UNKNOWN = Reason("zoom range unknown")
MISSION_REFUSED_BY_DRONE = Template("Mission refused by drone: {reasons}", reasons="first waypoint too far")
DRONE_CALIBRATION = Reason("calibrate magnetometer")
DRONE_FILE = Reason("file not accepted")
DRONE_TAKEOFF = Reason("cannot take off")
DRONE_GEOFENCE = Reason("waypoint out of bounds")
DRONE_CAMERA = Reason("camera unavailable")
DRONE_NOT_READY = Reason("not ready for a plan")
DRONE_MEDIA = Reason("cannot store pictures")
DRONE_FIRST_FAR = Reason("first waypoint too far")

# == Fence ==

FENCE_BREACH = Template("Fence {action}: {reason}", action="motor cut", reason="r" * REASON_BYTES)
FENCE_WARNING = Template("Fence warning: {reason}", reason="r" * REASON_BYTES)
FENCE_PILOT = Template("Fence, pilot flies: {reason}", reason="999 m beyond inclusion 12-34")
FENCE_TOO_FAST = ReasonTemplate("too fast for {zone}", zone="inclusion 120-123")
FENCE_UNDER_FLOOR = ReasonTemplate("{distance:.0f} m below floor {floor:g} m", distance=999, floor=999)
FENCE_OVER_CEILING = ReasonTemplate("{distance:.0f} m above ceiling {ceiling:g} m", distance=999, ceiling=4000)
FENCE_BLIND = OperatorText("Fence not watched: position unknown")
FENCE_OFF = OperatorText("Fence off: only the drone's own limits hold")
FENCE_ON_WITHOUT = OperatorText("Fence on, but no boundary is in force")
FENCE_INSIDE = OperatorText("Inside the fence again")
FENCE_ACTION_FAILED = Template("Fence {action} failed: {error}", action="motor cut", error=BELOW)
FENCE_NO_RETURN = Template("Fence: no return, hold: {error}", error=BELOW)
FENCE_NO_MOTOR_CUT = OperatorText("Fence action is now hold: motor cut not allowed")
GEOFENCE_SET = Template("Drone geofence set: {radius:g} m", radius=4000.5)
GEOFENCE_RESTORED = Template("Drone geofence restored: {radius:g} m, {state}", radius=4000.5, state="off")
GEOFENCE_KEPT = OperatorText("Drone geofence kept: changed meanwhile")
GEOFENCE_ENDS = Template("Drone geofence ends: centre is {distance:.0f} m off", distance=99999)
GEOFENCE_FAILED = Template("Drone geofence not changed: {error}", error=BELOW)
ON = Reason("on")
OFF = Reason("off")

# == Plans: transfer and storage ==

ITEM_REASON = ReasonTemplate("item {number}: {reason}", number=999, reason="longitude out of range")
COMMAND_UNSUPPORTED = ReasonTemplate("command {command} unsupported", command=65535)
NOT_CORNERS = ReasonTemplate("{value:g} corners", value=-1.23457e-38)
NOT_RADIUS = ReasonTemplate("radius {value:g} m", value=-1.23457e-38)
NOT_GROUP = ReasonTemplate("group {value:g}", value=-1.23457e-38)
NOT_HEIGHT = ReasonTemplate("height {value:g} m", value=-1.23457e-38)
POLYGON_INCOMPLETE = ReasonTemplate("item {number}: not {corners} corners", number=999, corners=999)
RETURN_POINTS = Reason("more than one return point")
ZONE_EMPTY = ReasonTemplate("{zone} has no area", zone="inclusion 120-123")
TOO_MANY_ITEMS = ReasonTemplate("{count} items > {capacity}", count=65535, capacity=5000)
NO_ITEMS_TO_REPLACE = ReasonTemplate("no items {first} to {last}", first=-32768, last=-32768)
LIST_FULL = ReasonTemplate("has {count} items already", count=5000)
NOT_STORED = Reason("cannot be stored")
FILE_NO_HEADER = Reason("file without header")
FILE_OTHER_KIND = Reason("file of another kind")
FILE_PART = Reason("file holds part of a list")
FILE_ITEMS = ReasonTemplate("file lacks its {count} items", count=65535)
FILE_NUMBER = ReasonTemplate("item {number} has number {seq}", number=5000, seq=65535)
PLANS_NOT_CLEARED = OperatorText("Plans not cleared: another client transfers")
UPLOAD_ABORTED = Template("{kind} upload aborted: no item {number}", kind="Mission", number=5000)
FENCE_CIRCLE_IGNORED = Template("Fence circle {number} ignored: radius 0", number=5000)
NO_FENCE = OperatorText("No fence")
NO_ZONES = Reason("no zones")
FENCE_SUMMARY = NoticeTemplate("Fence: {zones}", zones="12 inclusion polygons, 12 exclusion circles")
FENCE_GROUPS = NoticeTemplate("{fence}; zones of a group: overlap counts", fence="Fence: 2 inclusion circles")
FENCE_RETURN_POINT = NoticeTemplate("{fence}; return point unused", fence="Fence: 2 inclusion circles")
NO_MISSION_STORED = OperatorText("No mission")
MISSION_ITEMS = Template("Mission: {count} items", count=5000)
MISSION_STEPS = NoticeTemplate(
    "{mission}; flown by gateway: {steps}; link loss ends them", mission="Mission: 9 items", steps="item 3"
)
MISSION_APPROXIMATE = NoticeTemplate("{mission}; approximated: {losses}", mission="Mission: 9 items", losses="item 3")
MISSION_RECORD_IGNORED = NoticeTemplate("Mission record in {path} ignored: other mission", path="PI040.json")
PLAN_IGNORED = NoticeTemplate("{kind} in {path} ignored: {reason}", kind="Mission", path="PI040.json", reason="no file")
PLANS_NOT_KEPT = OperatorText("Plans not kept: state folder cannot be used")
MEMORY_UNREADABLE = NoticeTemplate("{path}: {error}; no plans, new ones not kept", path="PI040.json", error="denied")
MEMORY_LATE = OperatorText("Stored plans read late: unused until reconnection")
MEMORY_INVALID = NoticeTemplate("{path}: {error}; put aside as {aside}", path="PI040.json", error="bad", aside="file")
MEMORY_UNWRITABLE = NoticeTemplate("{path}: {error}; changes end with gateway", path="PI040.json", error="no space")

# == Rally points and home ==

RALLY_BY_TYPE = Template("Rally points not used: RTL_TYPE is home ({count})", count=999)
RALLY_HOME_SET = OperatorText("Rally points not used: another home is set")
RALLY_FAILED = Template("Rally point {number} not used: {error}", number=255, error=BELOW)
RETURNS_TO_RALLY = Template("Returns end at rally point {number}", number=255)
RETURNS_TO_HOME = OperatorText("Returns end at home")
HOME_TYPE_NOT_RESTORED = Template("Home type not restored: {error}", error=BELOW)
HOME_TYPE_KEPT = Template("Home stays custom: {error}", error=BELOW)
HOME_PLACE_KEPT = Template("Home may be moved: {error}", error=BELOW)
HOME_PLACE_UNKNOWN = Reason("old place unknown")
HOME_SET = OperatorText("Home set: in force until home type changes")
HOME_RAISED = Template("Home height raised to take-off: was {height:.0f} m", height=-99999.0)

# == Calibration and restart ==

CAL_STARTED = Template("[cal] calibration started: {version} {name}", version=2, name="level")
CAL_DONE = Template("[cal] calibration done: {name}", name="level")
CAL_CANCELLED = OperatorText("[cal] calibration cancelled")
CAL_FAILED = Template("[cal] calibration failed: {error}", error=BELOW)
CAL_SIDE_DONE = Template("[cal] {side} side done, rotate to a different side", side="front")
CAL_PROGRESS = Template("[cal] progress <{percent}>", percent=100)
CAL_ORIENTATION = Template("[cal] {side} orientation detected", side="front")
CAL_ROLL = OperatorText("[cal] roll: turn it about its long axis")
CAL_PITCH = OperatorText("[cal] pitch: turn it nose over tail")
CAL_YAW = OperatorText("[cal] yaw: turn it about its vertical axis")
COMPASS_CANCELLED = OperatorText("Compass calibration cancelled")
COMPASS_FAILED = Template("Compass calibration failed: {error}", error=BELOW)
COMPASS_DONE = OperatorText("Compass calibration done")
COMPASS_TURN = Template("Compass: turn the drone {axis}", axis="about its vertical axis")
AXIS_ROLL = Reason("about its long axis")
AXIS_PITCH = Reason("nose over tail")
AXIS_YAW = Reason("about its vertical axis")
DRONE_RESTARTS = OperatorText("Drone is restarting")
RESTART_FAILED = OperatorText("Restart failed: drone is still connected")

# == Media ==

MEDIA_NOT_INDEXED = OperatorText("Media unavailable: drone indexes its storage")
MEDIA_UNAVAILABLE = Template("Media unavailable: {error}", error=BELOW)
FILE_TOO_LARGE = OperatorText("File too large for FTP: use media download")
FILE_OF_UNKNOWN_SIZE = OperatorText("File size unknown: use media download")
FILE_DAMAGED = OperatorText("File damaged: MD5 is not the drone's")
MEDIA_COPIED = Template("Media copied: {count} file(s)", count=99999)
MEDIA_NOT_COPIED = Template("Media not copied: {error}", error=BELOW)
DELETE = Subject("Delete")
CAMERA_SAVING = Reason("camera is saving photos")

# == Flight logs ==

LOGS_UNAVAILABLE = Template("Flight logs unavailable: {error}", error=BELOW)
LOG_TOO_LARGE = OperatorText("Flight log too large for FTP")
LOGS_ERASED = Template("Flight logs erased: {count}", count=99999)
ERASE_LOGS = Subject("Erase logs")

# == Ground stations ==

STATION_BACK = OperatorText("Ground station is back")
NO_STATION = Reason("no ground station (ANF_GCS_LOSS)")
STATION_LOST = Template("No ground station for {seconds:g} s", seconds=999.5)
STATION_LOST_STATE = Template("No ground station for {seconds:g} s: {state}", seconds=99.5, state=RETURNS)
STATION_LOST_FAILED = Template("Station loss: {action} failed: {error}", action="return", error=BELOW)
SKYCONTROLLER_IN_CONTROL = OperatorText("Skycontroller in control until a client flies")
SKYCONTROLLER_WARNS_ONLY = OperatorText("Until then station loss and fence only warn")
SWITCH_PILOT = OperatorText("Aircraft: pilot only (ANF_SC_OFFBOARD 0)")
SWITCH_PROGRAM = OperatorText("Aircraft: programs (ANF_SC_OFFBOARD 1)")
SWITCH_AUTOMATIC = OperatorText("Aircraft: pilot or program (ANF_SC_OFFBOARD 2)")
PILOT_HAS_CONTROL = Template("Skycontroller pilot has control: {reason}", reason="moved")
BANNER = Template("anafi-mav {version}", version="10.10.10")
BANNER_FLAVOUR = Template("{title} (anafi-mav {version})", title="ArduCopter V4.5.7", version="10.10.10")
BANNER_DRONE = Template(
    "{model} {serial} firmware {firmware}", model="ANAFI USA", serial="P" * 18, firmware="1.10.10"
)  # fmt: skip
TUNE_REFUSED = OperatorText("Tune refused: drone is not on the ground")
TUNE_FAILED = Template("Tune not played: {error}", error=BELOW)
CONTROLLER_INPUTS = Template("Wheels, buttons not read: {error}", error=BELOW)
NO_EXPOSURE = Template("Exposure unknown: no video: {error}", error=BELOW)
NO_PICTURES = Template("Pose from events: no video: {error}", error=BELOW)

# == Camera ==

NO_SUCH_CAMERA = ReasonTemplate("no camera {number}", number=255)
CAMERA_IN_VIDEO_MODE = Reason("camera is in video mode")
CAMERA_IN_PHOTO_MODE = Reason("camera is in photo mode")
CAMERA_MODE_KEPT = Reason("drone keeps its mode")
CAMERA_LACKS_MODE = Reason("shown camera lacks this mode")
CAMERA_LACKS_ZOOM = Reason("shown camera has no zoom")
CAMERA_UNKNOWN = Reason("camera not reported")
PANORAMA_MOVING = Reason("drone must hover")
NO_SERIES = Reason("photo is not a series")
NO_THERMAL_CAMERA = Reason("no thermal camera")
NO_SUCH_SOURCE = Reason("no such source")
NO_SUCH_STREAM = Reason("stream not shown")
ZOOM_TYPE = Reason("type must be 0, 1 or 2")
NUMBER_MISSING = Reason("value is not a number")
NEGATIVE = Reason("value is negative")
NO_COUNT = Reason("param3 is no count")
RESET_VALUE = Reason("param1 must be 1")
FORMAT_VALUE = Reason("param2 must be 1")
STORAGE_ID = Reason("storage id is missing")
NO_SUCH_STORAGE = ReasonTemplate("no storage {number}", number=255)
STORAGE_NOT_FORMATTABLE = Reason("drone cannot format it")
DRONE_FLIES = Reason("drone flies")
NO_STORAGE = Reason("no storage")
STORAGE_TOO_SMALL = Reason("storage too small")
STORAGE_TOO_SLOW = Reason("storage too slow")
STORAGE_USB = Reason("storage used by USB")
STORAGE_UNFORMATTED = Reason("storage not formatted")
STORAGE_FORMATTING = Reason("storage is formatting")
STORAGE_ERROR = Reason("storage error")
STORAGE_PASSWORD = Reason("storage needs password")
STORAGE_CHECKING = Reason("storage is checked")
STORAGE_STATE = Template("Storage {number}: {state}", number=2, state="storage needs password")
STORAGE_READY = Template("Storage {number}: ready", number=2)
RECORDING_ENDED = Template("Recording ended: {reason}", reason="insufficient storage space")
PHOTO_NOT_STORED = Template("Photo not stored: {reason}", reason="error no storage space")
PHOTO_SERIES_FAILED = Template("Photo series not ended: {error}", error=BELOW)
PHOTO_INTERVAL = Template("Photo interval is {seconds:g} s", seconds=999.5)
PHOTO_DISTANCE = Template("Photo distance is {metres:g} m", metres=999.5)
PHOTO_MODE_KEPT = Template("Photo mode not restored: {error}", error=BELOW)

# == Video ==

VIDEO_NEEDS_HOST = OperatorText("Video open to this computer only: set video.host")
VIDEO_NEEDS_PUBLIC_HOST = OperatorText("Video without URI: set video.public_host")

# == Parameters ==

PARAMETER_NOT_SET = Template("{name} not set: {reason}", name="N" * 16, reason="r" * 23)
WRONG_TYPE = Reason("wrong type")
READ_ONLY = Reason("read only")
OUT_OF_RANGE = Reason("out of range")
CAMERA_TAKES_PHOTOS = Reason("camera takes photos")
MISSION_USES_CAMERA = Reason("mission uses camera")
VALUE_KEPT = Reason("drone keeps its value")
RTL_ALT_FINAL = Template("RTL_ALT_FINAL: hovers at {height:.0f} m (ANF_RTH_END_ALT)", height=99)

# == Warnings of the drone ==

NOW = Reason("now")
IN_SECONDS = ReasonTemplate("in {seconds} s", seconds=999)
BATTERY_ALERT = Template("Battery {alert}: {level}", alert="gauge update required", level="critical")
BATTERY_LEVEL = Template("Battery {level}", level="critical")
BATTERY_PERCENT = Template("Battery {level} ({percent} %)", level="critical", percent=100)
CONTROLLER_BATTERY = Template("Skycontroller battery {level}", level="critical")
CONTROLLER_PERCENT = Template("Skycontroller battery {level} ({percent} %)", level="critical", percent=100)
CONTROLLER_SHUTDOWN = Template("Skycontroller switches off: {reason}", reason="poweroff button")
LANDS_BY_ITSELF = Template("Drone lands {when}: {reason}", when="in 999 s", reason="battery critical soon")
RETURNS_HOME_BY_ITSELF = Template("Drone returns home {when}: {reason}", when="in 999 s", reason="battery critical")
HOME_REACH = Template("Home: {reachability}", reachability="not reachable")
CONDITION = Template("{name}: {degree}", name="Vibration", degree="critical")
TOO_DARK = OperatorText("Too dark to hold the position without GPS")
TOO_HIGH = OperatorText("Too high to hold the position without GPS")
MOTOR_ERROR = Template("Motor: {error}", error="error battery voltage")
ALERT = Template("Alert: {alert}", alert="magneto pertubation")
ALARM = Template("Alarm: {alarm}", alarm="magneto pertubation")
SENSOR_FAILED = Template("Sensor failed: {sensor}", sensor="vertical camera")
CALIBRATE_MAGNETOMETER = OperatorText("Magnetometer calibration required")
MOTORS_CUT = OperatorText("Motors cut")
NO_HOME = OperatorText("No home: drone cannot return")
RETURN_OFF = OperatorText("Return at low battery is off (ANF_RTH_AUTO)")
RETURN_LOW = Template("Return height low: {height:g} m < {limit:g} m", height=99.5, limit=999.5)
RETURN_AT_ONCE = OperatorText("Return delay 0 s: each link loss is a return")
HOME_FAR = Template("Set home {distance:.0f} m away > max. {limit:g} m", distance=99999999, limit=4000)
GEOFENCE_OFF = Template("Geofence off: max. {distance:g} m > radio {limit:g} m", distance=4000, limit=4000)
POSITION_LOST = Template("Position unknown: no GPS location for {seconds:g} s", seconds=3)
POSITION_FOUND = OperatorText("Position known again")

# == Endpoints ==

ACCESS_DENIED = Template("Message refused: access of endpoint is {access}", access="observe")
COMMAND_LATE = OperatorText("Command refused: too old on arrival")
INPUT_LATE = OperatorText("Setpoint, sticks or target dropped: too old")
SYSTEM_ID_TAKEN = Template("System id {sysid}: another gateway has it on fabric", sysid=250)

# == Link to the drone ==

CONNECTION_REFUSED = Template("Connection refused by drone (status {status})", status=-99)
WRONG_AIRCRAFT = Template("Not connected: drone has serial {serial}", serial="PI040444BA9H000000")
OTHER_CONTROLLER = OperatorText("Drone connected to another controller")
COMMAND_WITHOUT_DRONE = OperatorText("Command failed: drone not connected")
RECONNECTING_IN = Template("Reconnecting in {seconds:.0f} s, or on a command", seconds=999)
RECONNECTING_BY = Template("Reconnecting: command of system {system}", system=255)
