"""Photos and recordings of one camera, from the command to the file on the card.

The sequence of the events is that of Parrot's camera.xml: a photo's state becomes active, its progress is reported,
and the state becomes inactive when the media is on the card (a lapse: when it is stopped).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import camera
from anafi_mav.arsdk.messages.camera import (
    Availability,
    BracketingPreset,
    BurstValue,
    CameraCameraMode,
    CameraPhotoMode,
    CameraRecordingMode,
    Framerate,
    HyperlapseValue,
    PhotoFileFormat,
    PhotoResult,
    RecordingResult,
    State,
)
from anafi_mav.sim.payload import jpeg_scene
from anafi_mav.sim.payload.camera import Camera
from anafi_mav.sim.payload.jpeg_scene import Scene
from anafi_mav.sim.payload.media import MAX_RESOURCES, Media, MediaKind, MediaStore, Resource
from anafi_mav.sim.payload.storage import MediaVolume
from anafi_mav.sim.world.calendar import Calendar

SHOT_TIME = 0.1
"""s from the button to the shot, and between the shots of a bracketing. Assumed."""
SAVE_TIME = 0.3
"""s from a shot to its file on the card. Assumed."""
BURST_REPORT = 0.1
"""s between two reports of a burst at least (Parrot's camera.xml)."""
LAPSE_REPORT = 0.5
"""s between two reports of what is left to the next shot of a lapse (Parrot's camera.xml)."""
LEAST_ROOM = 1024
"""Bytes: with less than this on the card nothing is begun."""

_BURSTS = {
    BurstValue.BURST_14_OVER_4S: (14, 4.0),
    BurstValue.BURST_14_OVER_2S: (14, 2.0),
    BurstValue.BURST_14_OVER_1S: (14, 1.0),
    BurstValue.BURST_10_OVER_4S: (10, 4.0),
    BurstValue.BURST_10_OVER_2S: (10, 2.0),
    BurstValue.BURST_10_OVER_1S: (10, 1.0),
    BurstValue.BURST_4_OVER_4S: (4, 4.0),
    BurstValue.BURST_4_OVER_2S: (4, 2.0),
    BurstValue.BURST_4_OVER_1S: (4, 1.0),
}
_BRACKETS = {
    BracketingPreset.PRESET_1EV: 3,
    BracketingPreset.PRESET_2EV: 3,
    BracketingPreset.PRESET_3EV: 3,
    BracketingPreset.PRESET_1EV_2EV: 5,
    BracketingPreset.PRESET_1EV_3EV: 5,
    BracketingPreset.PRESET_2EV_3EV: 5,
    BracketingPreset.PRESET_1EV_2EV_3EV: 7,
}
_RATIOS = {
    HyperlapseValue.RATIO_15: 15,
    HyperlapseValue.RATIO_30: 30,
    HyperlapseValue.RATIO_60: 60,
    HyperlapseValue.RATIO_120: 120,
    HyperlapseValue.RATIO_240: 240,
}
_RATES = {
    Framerate.FPS_48: 48,
    Framerate.FPS_50: 50,
    Framerate.FPS_60: 60,
    Framerate.FPS_96: 96,
    Framerate.FPS_100: 100,
    Framerate.FPS_120: 120,
}
_PLAYED_AT = 30
"""Frames per second of a slow motion when it is played."""

_KINDS = {
    PhotoFileFormat.JPEG: (MediaKind.JPG,),
    PhotoFileFormat.DNG: (MediaKind.DNG,),
    PhotoFileFormat.DNG_JPEG: (MediaKind.JPG, MediaKind.DNG),
}
_PHOTO_MODES = {
    CameraPhotoMode.SINGLE: "SINGLE",
    CameraPhotoMode.BRACKETING: "BRACKETING",
    CameraPhotoMode.BURST: "BURST",
    CameraPhotoMode.TIME_LAPSE: "TIMELAPSE",
    CameraPhotoMode.GPS_LAPSE: "GPSLAPSE",
}
"""In the words of the web server."""


@dataclass(frozen=True)
class Studio:
    """Parts of a drone that all its cameras share."""

    media: MediaStore
    place: MediaVolume
    calendar: Calendar
    scene: Callable[[], Scene]


@dataclass(frozen=True)
class _Shot:
    """A picture on its way to the card."""

    number: int
    scene: Scene
    date: str
    captured: float
    """When it was taken."""
    due: float
    """When it has arrived there."""


@dataclass
class _Shoot:
    """Photos that are being taken."""

    mode: CameraPhotoMode
    media: Media
    shots: list[float]
    """When the next ones are due; a lapse knows only one ahead."""
    kinds: tuple[MediaKind, ...]
    interval: float = 0.0
    taken: list[_Shot] = field(default_factory=list)
    """Shots that are not on the card yet."""
    count: int = 0
    last: tuple[float, float] | None = None
    """Position of the last shot of a GPS lapse: m north, east."""
    next_report: float = 0.0
    reported_at: float = -math.inf
    result: Message | None = None
    """Last progress message sent."""
    open: bool = False
    """A panorama: its shots come when the drone looks where they are to be taken, and it is not over yet."""

    @property
    def lapse(self) -> bool:
        return self.mode in (CameraPhotoMode.TIME_LAPSE, CameraPhotoMode.GPS_LAPSE)


@dataclass
class _Take:
    """A recording that is going on."""

    media: Media
    scene: Scene
    began: float
    milliseconds: int
    scale: float
    """s of video per s of recording."""


class Capture:
    """One camera at work."""

    def __init__(self, camera: Camera, studio: Studio) -> None:
        self.camera = camera
        self._id = camera.id
        self._studio = studio
        self._shoot: _Shoot | None = None
        self._take: _Take | None = None

    @property
    def shooting(self) -> bool:
        return self._shoot is not None

    @property
    def recording(self) -> bool:
        return self._take is not None

    @property
    def busy(self) -> bool:
        return self.shooting or self.recording

    @property
    def lapsing(self) -> bool:
        """True while a lapse takes photos until it is stopped."""
        return self._shoot is not None and self._shoot.lapse

    @property
    def shots(self) -> int:
        """Pictures that have been taken of what is being photographed."""
        return 0 if self._shoot is None else self._shoot.count

    # -- photos

    def _refusal(self) -> PhotoResult | None:
        """Why no photo can be taken now."""
        if not self._ready(CameraCameraMode.PHOTO) or self.busy:
            return PhotoResult.ERROR_BAD_STATE
        return PhotoResult.ERROR_NO_STORAGE_SPACE if self._studio.place.free < LEAST_ROOM else None

    def begin_panorama(self, kind: str, count: int, time: float) -> Iterable[Message]:
        """Begin a panorama: one media of `count` pictures, the first of which is taken soon.

        `kind` is the web server's name of the panorama.
        """
        refusal = self._refusal()
        if refusal is None:
            media = self._studio.media.begin(
                video=False, mode="PANORAMA", date=self._date(time), panorama=kind, expected=count
            )
            kinds = _KINDS[PhotoFileFormat.JPEG]
            self._shoot = _Shoot(CameraPhotoMode.SINGLE, media, [], kinds, open=True)
            yield self.photo_state()
            yield self._tell(self._shoot, PhotoResult.TAKING_PHOTO, time)
        else:
            yield self._photo(refusal)
            yield self.photo_state()

    def panorama_shot(self, time: float) -> Iterable[Message]:
        """A picture of what the camera sees now; nothing when no panorama is taken."""
        if self._shoot is not None and self._shoot.open:
            yield from self._press(self._shoot, time)

    def end_panorama(self, time: float) -> Iterable[Message]:
        """End the panorama and write the pictures taken so far."""
        shoot = self._shoot
        if shoot is None or not shoot.open:
            return
        shoot.open = False
        if not shoot.count:
            self._shoot = None
            yield self._photo(PhotoResult.ERROR)
            yield self.photo_state()

    def take_photo(self, time: float) -> Iterable[Message]:
        refusal = self._refusal()
        if refusal is not None:
            yield self._photo(refusal)
            yield self.photo_state()
            return
        settings = self.camera
        mode, first = settings.photo_mode, time + SHOT_TIME
        shots = [first]
        if mode is CameraPhotoMode.BURST:
            count, seconds = _BURSTS[settings.burst]
            shots = [time + seconds * number / count for number in range(1, count + 1)]
        elif mode is CameraPhotoMode.BRACKETING:
            shots = [first + SHOT_TIME * number for number in range(_BRACKETS[settings.bracketing])]
        media = self._studio.media.begin(
            video=False, mode=_PHOTO_MODES[mode], date=self._date(time), thermal=settings.id > 0
        )
        self._shoot = _Shoot(mode, media, shots, _KINDS[settings.photo_file], settings.interval)
        self._shoot.next_report = time + LAPSE_REPORT
        yield self.photo_state()
        yield self._tell(self._shoot, PhotoResult.TAKING_PHOTO, time)

    def stop_photo(self, time: float) -> Iterable[Message]:
        shoot = self._shoot
        if shoot is None or not shoot.lapse:
            yield self._photo(PhotoResult.ERROR_BAD_STATE)
            yield self.photo_state()
            return
        if shoot.count == 0:
            yield from self._press(shoot, time)
        if shoot.taken:
            shoot.taken = [replace(shot, due=time) for shot in shoot.taken]
            yield from self._save(shoot, time)
        elif shoot.result is not None:
            yield shoot.result
        if self._shoot is not None:
            self._shoot = None
            yield self.photo_state()

    def _advance_photo(self, shoot: _Shoot, time: float) -> Iterable[Message]:
        if shoot.mode is CameraPhotoMode.GPS_LAPSE and not shoot.shots and self._way(shoot) >= shoot.interval:
            shoot.shots.append(time)
        while shoot.shots and time >= shoot.shots[0]:
            yield from self._press(shoot, shoot.shots.pop(0))
        yield from self._save(shoot, time)
        if self._shoot is shoot and shoot.lapse and time >= shoot.next_report:
            shoot.next_report = max(shoot.next_report + LAPSE_REPORT, time)
            yield camera.NextPhotoDelay(shoot.mode, self._left(shoot, time))

    def _press(self, shoot: _Shoot, time: float) -> Iterable[Message]:
        """A shot."""
        shoot.count += 1
        scene = self._studio.scene()
        shoot.taken.append(_Shot(shoot.count, scene, self._date(time), time, time + SAVE_TIME))
        shoot.last = (scene.north, scene.east)
        if shoot.mode is CameraPhotoMode.TIME_LAPSE and not shoot.shots:
            shoot.shots.append(time + shoot.interval)
        last = not shoot.shots or shoot.lapse
        is_due = shoot.mode is CameraPhotoMode.BURST and time >= shoot.reported_at + BURST_REPORT - 1e-9
        if last or is_due:
            yield self._tell(shoot, PhotoResult.PHOTO_TAKEN, time)

    def _save(self, shoot: _Shoot, time: float) -> Iterable[Message]:
        """Write what has arrived by `time`, and say so when nothing of it is on its way any more."""
        arrived = [shot for shot in shoot.taken if shot.due <= time]
        del shoot.taken[: len(arrived)]
        written, full = self._write(shoot, arrived)
        if full:
            self._shoot = None
            yield self._photo(PhotoResult.ERROR_NO_STORAGE_SPACE)
            yield self.photo_state()
        elif written if shoot.lapse else shoot.count and not (shoot.open or shoot.shots or shoot.taken):
            yield self._tell(shoot, PhotoResult.PHOTO_SAVED, time)
            if not shoot.lapse:
                self._shoot = None
                yield self.photo_state()

    def _write(self, shoot: _Shoot, shots: list[_Shot]) -> tuple[bool, bool]:
        """Write the shots; return (a file was written, the storage has no room for another)."""
        media, room = self._studio.media, self._studio.place.free
        written: list[Resource] = []
        full = bool(shots) and shots[-1].number >= MAX_RESOURCES
        for shot in shots:
            files = [
                media.develop(shoot.media, kind, shot.number, shot.scene, shot.date, captured=shot.captured)
                for kind in shoot.kinds
            ]
            size = sum(file.size for file in files)
            if size > room:
                full = True
                break
            room -= size
            written += files
        if written:
            media.add(shoot.media, written)
        return bool(written), full

    def _way(self, shoot: _Shoot) -> float:
        """m since the last shot."""
        if shoot.last is None:
            return 0.0
        scene = self._studio.scene()
        return math.hypot(scene.north - shoot.last[0], scene.east - shoot.last[1])

    def _left(self, shoot: _Shoot, time: float) -> float:
        """s or m to the next shot."""
        if shoot.mode is CameraPhotoMode.GPS_LAPSE:
            return max(0.0, shoot.interval - self._way(shoot))
        return max(0.0, shoot.shots[0] - time)

    def _tell(self, shoot: _Shoot, result: PhotoResult, time: float) -> Message:
        # camera.xml has a count with photo_taken; Olympe 7's photo example reads it off photo_saved.
        shoot.reported_at = time
        shoot.result = self._photo(
            result,
            shoot.count & 0xFF if result in (PhotoResult.PHOTO_TAKEN, PhotoResult.PHOTO_SAVED) else 0,
            shoot.media.id if result is PhotoResult.PHOTO_SAVED else "",
        )
        return shoot.result

    # -- recordings

    def start_recording(self, time: float) -> Iterable[Message]:
        if self._take is not None or not self._ready(CameraCameraMode.RECORDING) or not self.camera.lens.recordings:
            yield self._recording(RecordingResult.ERROR_BAD_STATE)
            yield self.recording_state()
            return
        if self._studio.place.free < LEAST_ROOM:
            yield self._recording(RecordingResult.STOPPED_NO_STORAGE_SPACE)
            yield self.recording_state()
            return
        settings, studio = self.camera, self._studio
        scale = 1.0
        if settings.recording_mode is CameraRecordingMode.HYPERLAPSE:
            scale = 1.0 / _RATIOS[settings.hyperlapse]
        elif settings.recording_mode is CameraRecordingMode.SLOW_MOTION:
            scale = _RATES.get(settings.framerate, _PLAYED_AT) / _PLAYED_AT
        media = studio.media.begin(
            video=True, mode=settings.recording_mode.name, date=self._date(time), thermal=settings.id > 0
        )
        self._take = _Take(media, studio.scene(), time, studio.calendar.milliseconds(time), scale)
        yield self._recording(RecordingResult.STARTED)
        yield self.recording_state()

    def stop_recording(self, time: float, result: RecordingResult = RecordingResult.STOPPED) -> Iterable[Message]:
        take = self._take
        if take is None:
            yield self._recording(RecordingResult.ERROR_BAD_STATE)
            yield self.recording_state()
            return
        self._take = None
        studio = self._studio
        room = self._release()
        seconds = (time - take.began) * take.scale
        if jpeg_scene.mp4_size(take.scene, seconds) > room:
            seconds, result = _fitting(take, room), RecordingResult.STOPPED_NO_STORAGE_SPACE
        name = ""
        if seconds >= 0.0:
            file = studio.media.develop(take.media, MediaKind.MP4, 1, take.scene, take.media.date, seconds)
            studio.media.add(take.media, [file])
            name = take.media.id
        yield self._recording(result, name)
        yield self.recording_state()

    def _advance_recording(self, take: _Take, time: float) -> Iterable[Message]:
        place = self._studio.place
        written = place.reserved
        room = self._release()
        size = jpeg_scene.mp4_size(take.scene, (time - take.began) * take.scale)
        place.reserved = size if size <= room else written
        if size > room:
            yield from self.stop_recording(time, RecordingResult.STOPPED_NO_STORAGE_SPACE)

    def _release(self) -> int:
        """Release the storage that a recording has reserved, and return the bytes it can use.

        What it has already written is included.
        """
        place = self._studio.place
        written, place.reserved = place.reserved, 0
        return max(place.free, written)

    def recorded(self, time: float) -> float:
        """Return the duration of the current recording in s; 0 when not recording."""
        return 0.0 if self._take is None else time - self._take.began

    # -- both

    def tick(self, time: float) -> Iterable[Message]:
        """Advance to `time` (s) and return the messages that are due."""
        if self._shoot is not None:
            yield from self._advance_photo(self._shoot, time)
        if self._take is not None:
            yield from self._advance_recording(self._take, time)

    def interrupt(self, time: float) -> Iterable[Message]:
        """Something else is set up: a recording ends, photos that are not saved are lost."""
        if self._take is not None:
            yield from self.stop_recording(time, RecordingResult.STOPPED_RECONFIGURED)
        if self._shoot is not None:
            self._shoot = None
            yield self._photo(PhotoResult.ERROR)
            yield self.photo_state()

    def states(self) -> list[Message]:
        return [self.photo_state(), self.recording_state()]

    def photo_state(self) -> Message:
        state = State.ACTIVE if self.shooting else State.INACTIVE
        return camera.PhotoState(self._id, self._available(CameraCameraMode.PHOTO), state)

    def recording_state(self) -> Message:
        take = self._take
        available = self._available(CameraCameraMode.RECORDING)
        if take is None:
            return camera.RecordingState(self._id, available, State.INACTIVE, 0)
        return camera.RecordingState(self._id, available, State.ACTIVE, take.milliseconds)

    def _available(self, mode: CameraCameraMode) -> Availability:
        return Availability.AVAILABLE if self._ready(mode) else Availability.NOT_AVAILABLE

    def _ready(self, mode: CameraCameraMode) -> bool:
        settings = self.camera
        return settings.active and settings.mode is mode and not self._studio.place.formatting

    def _photo(self, result: PhotoResult, count: int = 0, media_id: str = "") -> Message:
        return camera.PhotoProgress(self._id, result, count, media_id)

    def _recording(self, result: RecordingResult, media_id: str = "") -> Message:
        return camera.RecordingProgress(self._id, result, media_id)

    def _date(self, time: float) -> str:
        return self._studio.calendar.date(time)


def _fitting(take: _Take, room: int) -> float:
    """Return the s of video that fit into `room` (bytes); negative when not one frame fits."""
    one = jpeg_scene.mp4_size(take.scene, jpeg_scene.FRAME_TIME)
    frame = jpeg_scene.mp4_size(take.scene, 2 * jpeg_scene.FRAME_TIME) - one
    return jpeg_scene.FRAME_TIME * (1 + (room - one) // frame)
