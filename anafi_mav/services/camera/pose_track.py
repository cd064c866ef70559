"""Pose of drone and camera at a moment, for the geotag of a photo. No I/O.

Positions, heights and angles arrive in events of their own, and together with each picture of the live video. A moment
between two of them is interpolated; after the newest position the drone goes on at its reported velocity.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from typing import Any

import msgspec

from anafi_mav import geo
from anafi_mav.units import quaternion_from_euler, wrap_pi

SAMPLES = 96
"""Samples of each kind: three seconds of pictures at 30 Hz. A photo's pose is taken within half a second."""

FURTHEST = 1.5
"""s from the nearest sample at which a value is still taken for the moment; a position arrives once a second."""

SPACING = 0.05
"""s between two samples of events that are kept. An ANAFI reports five times a second; between samples at this distance
the way of a drone or gimbal is straight."""

DEGREES = 360.0
"""Degrees of a full turn."""

NEAR = 0.2
"""s from a picture within which the pictures of the video are the source: six of them."""


class CameraPose(msgspec.Struct, frozen=True):
    """Pose at a moment. None: unknown."""

    place: tuple[float, float] | None = None
    """Latitude, longitude, deg."""
    height: float | None = None
    """m above take-off."""
    camera: tuple[float, float, float] | None = None
    """Roll, pitch, yaw of the camera to the horizon and true north, rad."""

    @property
    def quaternion(self) -> tuple[float, float, float, float] | None:
        """Orientation of the camera, (w, x, y, z)."""
        return None if self.camera is None else quaternion_from_euler(*self.camera)


class SampleTrack:
    """Values of one kind over time.

    The samples are packed numbers in a ring: as objects, 256 of each kind, those of a drone took 0.2 MB.
    """

    def __init__(self, width: int, *, turn: float = math.inf, spacing: float = 0.0) -> None:
        """Create it empty.

        `width`: values of a sample, `spacing`: s between two samples that are kept. `turn`: a full turn in the unit of
        the values, if they are angles: between two of them the shorter way is interpolated.
        """
        self._turn = turn
        self._spacing = spacing
        self._row = struct.Struct(f"{1 + width}d")
        """Time and values of a sample."""
        self._ring = bytearray()
        """Empty before the first sample: most drones are flown without a video."""
        self._count = 0
        """Samples so far."""
        self.newest = -math.inf
        """Time of the newest sample."""

    def add(self, at: float, *values: float) -> None:
        """Add a sample.

        One that is not newer than the last by the spacing, or not finite, is left out.
        """
        if at - self.newest > self._spacing and math.isfinite(sum(values)):
            self._put(at, *values)

    def _put(self, at: float, *row: Any) -> None:
        if not self._ring:
            self._ring = bytearray(SAMPLES * self._row.size)
        self._row.pack_into(self._ring, self._count % SAMPLES * self._row.size, at, *row)
        self._count += 1
        self.newest = at

    def clear(self) -> None:
        """Forget all samples."""
        self._count, self.newest = 0, -math.inf

    def _latest_first(self) -> Iterator[tuple[float, tuple[float, ...]]]:
        """Yield time and values of each sample."""
        return self._rows()

    def _rows(self) -> Iterator[tuple[float, tuple[Any, ...]]]:
        for number in range(self._count - 1, max(self._count - SAMPLES, 0) - 1, -1):
            at, *values = self._row.unpack_from(self._ring, number % SAMPLES * self._row.size)
            yield at, tuple(values)

    def distance(self, at: float) -> float:
        """Return how far the nearest sample is from a moment, s."""
        return min((abs(time - at) for time, _ in self._latest_first()), default=math.inf)

    def value(self, at: float) -> tuple[float, ...] | None:
        """Return the values at a moment.

        Before the first and after the last sample they are those of that sample. None without a sample within
        `FURTHEST`.
        """
        before = after = None
        for sample in self._latest_first():
            if sample[0] <= at:
                before = sample
                break
            after = sample
        if before is not None and after is not None and after[0] - before[0] <= 2.0 * FURTHEST:
            share = (at - before[0]) / (after[0] - before[0])
            steps = [math.remainder(two - one, self._turn) for one, two in zip(before[1], after[1], strict=True)]
            return tuple(one + share * step for one, step in zip(before[1], steps, strict=True))
        nearest = min((s for s in (before, after) if s is not None), key=lambda s: abs(s[0] - at), default=None)
        return nearest[1] if nearest is not None and abs(nearest[0] - at) <= FURTHEST else None


class EventTrack(SampleTrack):
    """Samples that are the bytes of events, read when a moment is looked up: photos are rare."""

    def __init__(
        self, size: int, read: Callable[[bytes], tuple[float, ...] | None], *, turn: float = math.inf, spacing: float
    ) -> None:
        """Create it empty.

        `size`: bytes that are kept of an event, `read`: returns its values; None: they are unknown.
        """
        super().__init__(0, turn=turn, spacing=spacing)
        self._row = struct.Struct(f"d{size}s")
        self._read = read

    def add_event(self, at: float, data: bytes) -> None:
        """Add a sample, unless it is not newer than the last by the spacing."""
        if at - self.newest > self._spacing:
            self._put(at, data)

    def _latest_first(self) -> Iterator[tuple[float, tuple[float, ...]]]:
        for at, (data,) in self._rows():
            values = self._read(data)
            if values is not None and math.isfinite(sum(values)):
                yield at, values


class PoseSource:
    """Samples of one source: the drone's events, or the pictures of its video."""

    def __init__(self, spacing: float = 0.0) -> None:
        """`spacing`: s between two samples of a kind that are kept."""
        self.places = SampleTrack(2, turn=DEGREES, spacing=spacing)
        """Latitude, longitude, deg."""
        self.velocities = SampleTrack(2, spacing=spacing)
        """North, east, m/s."""
        self.heights = SampleTrack(1, spacing=spacing)
        """m above take-off."""
        self.gimbals = SampleTrack(3, turn=math.tau, spacing=spacing)
        """Roll and pitch of the camera to the horizon, its yaw to `headings`, rad."""
        self.headings = SampleTrack(1, turn=math.tau, spacing=spacing)
        """Yaw of the drone, rad; 0 in a source whose camera's yaw is that to true north."""

    def clear(self) -> None:
        """Forget all samples."""
        for track in (self.places, self.velocities, self.heights, self.gimbals, self.headings):
            track.clear()

    def place(self, at: float) -> tuple[float, float] | None:
        """Return latitude and longitude at a moment."""
        found = self.places.value(at)
        if found is None:
            return None
        latitude, longitude = found[0], math.remainder(found[1], DEGREES)
        late = at - self.places.newest
        velocity = self.velocities.value(at)
        if late <= 0.0 or velocity is None:
            return latitude, longitude
        return geo.destination(latitude, longitude, velocity[0] * late, velocity[1] * late)

    def camera(self, at: float) -> tuple[float, float, float] | None:
        """Return roll, pitch and yaw of the camera to the horizon and true north at a moment, rad."""
        gimbal, heading = self.gimbals.value(at), self.headings.value(at)
        if gimbal is None or heading is None:
            return None
        return gimbal[0], gimbal[1], wrap_pi(heading[0] + gimbal[2])


class PoseTrack:
    """The pose of the last seconds, from events and from pictures."""

    def __init__(self, events: PoseSource | None = None) -> None:
        self.events = events or PoseSource(SPACING)
        self.pictures = PoseSource()

    def clear(self) -> None:
        """Forget all samples: the link was lost."""
        self.events.clear()
        self.pictures.clear()

    def is_complete(self, at: float) -> bool:
        """True when nothing that is still to come makes the pose of this moment better."""
        sources = (self.events, self.pictures)
        return any(min(source.places.newest, source.gimbals.newest) >= at for source in sources)

    def pose(self, at: float) -> CameraPose:
        """Return the pose at a moment, by the pictures if one is near it, else by the events."""
        events, pictures = self.events, self.pictures
        by_picture = pictures.gimbals.distance(at) <= NEAR
        place = pictures.place(at) if by_picture and pictures.places.distance(at) <= NEAR else events.place(at)
        height = (pictures.heights if pictures.heights.distance(at) <= NEAR else events.heights).value(at)
        camera = (pictures if by_picture else events).camera(at)
        return CameraPose(place, None if height is None else height[0], camera)
