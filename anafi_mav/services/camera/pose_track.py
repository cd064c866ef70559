"""Pose of drone and camera at a moment, for the geotag of a photo. No I/O.

Positions, heights and angles arrive in events of their own, and together with each picture of the live video. A moment
between two of them is interpolated; after the newest position the drone goes on at its reported velocity.
"""

from __future__ import annotations

import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence

import msgspec

from anafi_mav import geo
from anafi_mav.units import quaternion_from_euler, wrap_pi

SAMPLES = 96
"""Samples of each kind: three seconds of pictures at 30 Hz. A photo's pose is taken within half a second."""

FURTHEST = 1.5
"""s from the nearest sample at which a value is still taken for the moment; a position arrives once a second."""

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


class ValueTrack(ABC):
    """Values of one kind over time."""

    def __init__(self, turn: float = math.inf) -> None:
        """`turn`: a full turn in the unit of the values, if they are angles.

        Between two of them the shorter way is interpolated.
        """
        self._turn = turn

    @abstractmethod
    def latest_first(self) -> Iterator[tuple[float, Sequence[float]]]:
        """Yield time and values of each sample."""

    @property
    def newest(self) -> float:
        """Time of the newest sample; -inf without one."""
        return next((at for at, _ in self.latest_first()), -math.inf)

    def distance(self, at: float) -> float:
        """Return how far the nearest sample is from a moment, s."""
        return min((abs(time - at) for time, _ in self.latest_first()), default=math.inf)

    def value(self, at: float) -> Sequence[float] | None:
        """Return the values at a moment.

        Before the first and after the last sample they are those of that sample. None without a sample within
        `FURTHEST`.
        """
        before = after = None
        for sample in self.latest_first():
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


class SampleTrack(ValueTrack):
    """Samples that are packed numbers in a ring.

    As objects, 256 of each kind, those of a drone took 0.2 MB.
    """

    def __init__(self, width: int, *, turn: float = math.inf) -> None:
        """Create it empty. `width`: values of a sample, `turn`: see `ValueTrack`."""
        super().__init__(turn)
        self._row = struct.Struct(f"{1 + width}d")
        """Time and values of a sample."""
        self._ring = bytearray()
        """Empty before the first sample: most drones are flown without a video."""
        self._count = 0
        """Samples so far."""

    def add(self, at: float, *values: float) -> None:
        """Add a sample; one that is not newer than the last, or not finite, is left out."""
        if at > self.newest and math.isfinite(sum(values)):
            if not self._ring:
                self._ring = bytearray(SAMPLES * self._row.size)
            self._row.pack_into(self._ring, self._count % SAMPLES * self._row.size, at, *values)
            self._count += 1

    def clear(self) -> None:
        """Forget all samples."""
        self._count = 0

    def latest_first(self) -> Iterator[tuple[float, Sequence[float]]]:
        for number in range(self._count - 1, max(self._count - SAMPLES, 0) - 1, -1):
            at, *values = self._row.unpack_from(self._ring, number % SAMPLES * self._row.size)
            yield at, tuple(values)


class PoseSource(ABC):
    """Samples of one source: the drone's events, or the pictures of its video."""

    places: ValueTrack
    """Latitude, longitude, deg."""
    velocities: ValueTrack
    """North, east, m/s."""
    heights: ValueTrack
    """m above take-off."""
    gimbals: ValueTrack
    """Roll and pitch of the camera to the horizon, its yaw to `headings`, rad."""
    headings: ValueTrack
    """Yaw of the drone, rad; 0 in a source whose camera's yaw is that to true north."""

    @abstractmethod
    def clear(self) -> None:
        """Forget all samples."""

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


class SampledPoses(PoseSource):
    """Samples that are added one by one."""

    def __init__(self) -> None:
        self.places: SampleTrack = SampleTrack(2, turn=DEGREES)
        self.velocities: SampleTrack = SampleTrack(2)
        self.heights: SampleTrack = SampleTrack(1)
        self.gimbals: SampleTrack = SampleTrack(3, turn=math.tau)
        self.headings: SampleTrack = SampleTrack(1, turn=math.tau)

    def clear(self) -> None:
        for track in (self.places, self.velocities, self.heights, self.gimbals, self.headings):
            track.clear()


class PoseTrack:
    """The pose of the last seconds, from events and from pictures."""

    def __init__(self, events: PoseSource) -> None:
        self.events = events
        self.pictures = SampledPoses()

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
