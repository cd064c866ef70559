"""Conversions between ARSDK's units, MAVLink's and ours, and numbers in words. No I/O.

Pure functions of plain numbers. Angles wrap here and nowhere else. MAVLink integers saturate instead of wrapping
round: a value the field cannot hold is reported as the nearest it can.
"""

from __future__ import annotations

import math

RAD_PER_DEG = math.pi / 180.0
DEG_PER_RAD = 180.0 / math.pi

LARGEST = 1e30
"""Size of a number that is a measure: sums of several fit a float of 32 bits, which MAVLink's fields are."""


def counted(number: int, what: str) -> str:
    """So many of them, in words: "1 item", "2 items"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def is_finite(*values: float) -> bool:
    """Return True for numbers whose sum a float holds; an int may be too large for one."""
    try:
        return math.isfinite(sum(values))
    except OverflowError:
        return False


def wrap_pi(angle: float) -> float:
    """The same angle (rad) in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def wrap_360(angle: float) -> float:
    """The same angle (deg) in [0, 360)."""
    wrapped = angle % 360.0
    return 0.0 if wrapped >= 360.0 else wrapped  # -1e-17 % 360.0 is 360.0


def clip(value: float, low: float, high: float) -> float:
    """`value` limited to [low, high]; NaN stays NaN."""
    return low if value < low else high if value > high else value


SIGNED = {bits: (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) for bits in (8, 16, 32)}
"""The least and the largest integer of a signed field, by its bits."""

UNSIGNED = {bits: (0, (1 << bits) - 1) for bits in (8, 16, 32)}
"""The same of an unsigned field."""


def saturate(value: float, bits: int, *, signed: bool = True) -> int:
    """`value` rounded to the nearest integer that a field of `bits` bits can hold."""
    low, high = (SIGNED if signed else UNSIGNED)[bits]
    number = round(value)
    return low if number < low else high if number > high else number


def deg_e7(degrees: float) -> int:
    """Latitude or longitude (deg) as MAVLink's degE7 (int32)."""
    return saturate(degrees * 1e7, 32)


def millimetres(metres: float) -> int:
    """A length (m) as MAVLink's mm (int32)."""
    return saturate(metres * 1e3, 32)


def centimetres(metres: float) -> int:
    """A length or speed (m, m/s) as MAVLink's cm, cm/s (int16)."""
    return saturate(metres * 1e2, 16)


def centidegrees(radians: float) -> int:
    """A heading (rad, clockwise from north) as MAVLink's cdeg in 0..35999 (uint16)."""
    return round(wrap_360(radians * DEG_PER_RAD) * 100.0) % 36000


def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Body attitude (rad, aerospace order yaw, pitch, roll; FRD in NED) as (w, x, y, z), w >= 0."""
    cr, sr = math.cos(roll / 2.0), math.sin(roll / 2.0)
    cp, sp = math.cos(pitch / 2.0), math.sin(pitch / 2.0)
    cy, sy = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    cc, cs, sc, ss = cr * cp, cr * sp, sr * cp, sr * sp
    w = cc * cy + ss * sy
    x = sc * cy - cs * sy
    y = cs * cy + sc * sy
    z = cc * sy - ss * cy
    return (w, x, y, z) if w >= 0.0 else (-w, -x, -y, -z)


def unit_quaternion(w: float, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """The same rotation, (w, x, y, z), with length 1.

    Raises `ValueError` for a length of zero, NaN or infinity.
    """
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if not norm > 0.0 or not math.isfinite(norm):
        raise ValueError(f"not a rotation: quaternion of length {norm}")
    return w / norm, x / norm, y / norm, z / norm


def euler_from_quaternion(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """(roll, pitch, yaw) in rad of a rotation given as (w, x, y, z) of any length but zero.

    At pitch = +-90 degrees roll and yaw turn about the same axis; roll is then reported as 0.
    """
    norm = math.sqrt(w * w + x * x + y * y + z * z)  # as in `unit_quaternion`, without a call for each setpoint
    if not norm > 0.0 or not math.isfinite(norm):
        raise ValueError(f"not a rotation: quaternion of length {norm}")
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    sin_pitch = clip(2.0 * (w * y - z * x), -1.0, 1.0)
    if abs(sin_pitch) > 1.0 - 1e-9:
        return 0.0, math.asin(sin_pitch), wrap_pi(math.copysign(2.0, -sin_pitch) * math.atan2(x, w))
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, math.asin(sin_pitch), yaw
