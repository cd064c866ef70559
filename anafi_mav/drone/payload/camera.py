"""Element camera: pictures, films, zoom and light, the same for the cameras of every model.

What the two features of Parrot call it is in `camera_classic` (4K, Thermal, USA) and `camera_modern` (Ai). A camera
belongs to the one that reports it. Verbs that change a setting return the camera's state as the drone confirmed it: a
value that the drone does not take is clamped or refused by leaving it as it was.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, TypeAlias, TypeVar

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages.proto import antiflicker as mains
from anafi_mav.arsdk.messages.proto import camera2
from anafi_mav.drone.element import Reducer
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, require_number
from anafi_mav.drone.payload import camera_classic, camera_modern
from anafi_mav.drone.payload.camera_classic import ClassicCamera
from anafi_mav.drone.payload.camera_enums import (
    Antiflicker,
    CameraKind,
    CameraMode,
    PhotoMode,
    StoragePolicy,
    Streaming,
    Style,
    WhiteBalance,
    ev_of,
    ev_step,
)
from anafi_mav.drone.payload.camera_modern import ModernCamera
from anafi_mav.drone.payload.camera_state import (
    UNREPORTED,
    CamerasState,
    CameraState,
    CaptureProgress,
    CaptureUpdate,
    ExposureSettings,
    PhotoSettings,
    RecordingSettings,
    StyleSettings,
)
from anafi_mav.drone.settings import Commanding, Question, is_same, number, same_as
from anafi_mav.errors import (
    AnafiMavError,
    CommandRejected,
    CommandTimeout,
    LinkLost,
    LocalProtocolError,
    NotSupported,
)
from anafi_mav.units import clip

MAIN = 0
"""Id of the camera that every model has."""

STATE_TIMEOUT = 2.0
"""s after the report that a photo or recording has begun or ended in which the camera's state has it, too. Parrot
promises no order between the two events."""
TEMPERATURE_STEP = 250.0
"""K between two temperatures of the white balance."""
SAVE_TIMEOUT = 30.0
"""s between two signs of life of a photo: a burst or a full resolution DNG takes a while to be stored."""
ZOOM_TIMEOUT = 60.0
"""s that a zoom may take; how fast it is depends on a setting whose unit is tan(deg)/s."""
ZOOM_ARRIVED = 0.01
"""Of the wanted zoom."""
ZOOM_STILL = 1e-3

SERIES = frozenset({PhotoMode.TIME_LAPSE, PhotoMode.GPS_LAPSE})
"""Photo modes that go on until they are stopped."""

BEGUN = (CaptureProgress.STARTED, CaptureProgress.TAKEN)

_SPEECH: Mapping[str, type[ClassicCamera] | type[ModernCamera]] = {
    camera_classic.FEATURE: ClassicCamera,
    camera_modern.FEATURE: ModernCamera,
}

SettingsT = TypeVar("SettingsT", PhotoSettings, RecordingSettings, ExposureSettings)
Ask: TypeAlias = tuple[Message, type[Message]]


def _has(settings: SettingsT | None, wish: SettingsT) -> bool:
    """Return True if the settings have each value of the wish.

    A number has it to three digits: the drone may round.
    """
    for field in wish.__struct_fields__:
        wanted, value = getattr(wish, field), getattr(settings, field, None)
        if isinstance(wanted, float) and value is not None:
            if not math.isclose(wanted, value, rel_tol=1e-3):
                return False
        elif wanted is not None and wanted != value:
            return False
    return True


class Camera(Commanding[CamerasState]):
    """All cameras of the drone.

    `camera[id]` is the state of one camera; the verbs use the main one unless `id` names another.

    Verbs that change a setting return the value that the drone confirmed: one that it does not accept is clamped, or
    the setting stays as it was. Raises `NotSupported` for features that this camera does not have.
    """

    NOTHING = CamerasState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {**camera_classic.REDUCERS, **camera_modern.REDUCERS}

    PHOTO_EVENTS: ClassVar[tuple[type[Message], ...]] = (*ClassicCamera.photo_events, *ModernCamera.photo_events)
    """Events about a photo; `photo_update` reads them."""
    RECORDING_EVENTS: ClassVar[tuple[type[Message], ...]] = (
        *ClassicCamera.recording_events,
        *ModernCamera.recording_events,
    )
    """Events about a recording; `recording_update` reads them."""

    ZOOM_EVENTS: ClassVar[tuple[type[Message], ...]] = (ClassicCamera.zoom_event, ModernCamera.zoom_event)
    """Events that report the zoom; both have it as `level`."""

    @staticmethod
    def photo_update(message: Message) -> CaptureUpdate | None:
        """Return the progress that one of `PHOTO_EVENTS` reports, if any."""
        classic = isinstance(message, ClassicCamera.photo_events)
        return ClassicCamera.photo_news(message) if classic else ModernCamera.photo_news(message)

    @staticmethod
    def recording_update(message: Message) -> CaptureUpdate | None:
        """Return the progress that one of `RECORDING_EVENTS` reports, if any."""
        classic = isinstance(message, ClassicCamera.recording_events)
        return ClassicCamera.recording_news(message) if classic else ModernCamera.recording_news(message)

    FREQUENT: ClassVar[frozenset[type[Message]]] = frozenset(
        {*camera_classic.FREQUENT, *camera_modern.FREQUENT},
    )
    """Events that come several times a second, or with each picture, and report no setting."""

    SAMPLES: ClassVar[frozenset[type[Message]]] = frozenset({*camera_classic.SAMPLES, *camera_modern.SAMPLES})
    """Those of them that report zoom or exposure, and no progress of a photo or recording."""

    @property
    def active_id(self) -> int:
        """Id of the camera that takes the pictures: a thermal mode changes it."""
        return min(self.state.active, default=MAIN)

    def __getitem__(self, id: int) -> CameraState:
        """The state of this camera, an empty one when the drone has not reported it."""
        return self.state.cameras.get(id, UNREPORTED)

    # -- pictures

    async def set_mode(self, mode: CameraMode, id: int = MAIN) -> CameraMode | None:
        """Change to photo or recording mode."""
        state = await self._ask(id, "mode", lambda s, now: s.mode(id, now, mode), lambda state: state.mode is mode)
        return state.mode

    async def set_photo(self, wish: PhotoSettings, id: int = MAIN) -> PhotoSettings | None:
        """Change the photo settings; a field that is None stays as it is."""
        for interval in (wish.interval, wish.other_interval):
            if interval is not None:
                number(interval, "interval")
        state = await self._ask(
            id, "photo", lambda s, now: s.photo(id, now, wish), lambda state: _has(state.photo, wish)
        )
        return state.photo

    async def take_photo(
        self, id: int = MAIN, timeout: float = SAVE_TIMEOUT, *, until_saved: bool = True
    ) -> str | None:
        """Take a photo; return its media id once it is stored.

        A series returns None as soon as it has begun, and so does any photo with `until_saved` False.

        Raises `CommandRejected` when no photo can be taken (in mode RECORDING, or the storage is full).
        """
        speech, now = self._known(id)
        if now.photo_available is False:
            raise CommandRejected("the camera cannot take a photo now")
        series = now.photo is not None and now.photo.mode in SERIES
        has_begun = False

        def judge(update: CaptureUpdate) -> str | bool | AnafiMavError | None:
            nonlocal has_begun
            has_begun = has_begun or (update.progress in BEGUN and not update.is_state)
            if update.progress is CaptureProgress.SAVED:
                return update.media if has_begun else None  # else of the photo before, reported late
            if update.progress is CaptureProgress.FAILED:
                return CommandRejected(f"photo: {update.reason}")
            return True if (series or not until_saved) and update.progress in BEGUN else None

        result = await self._capture(
            id, speech.take_photo(id), speech.photo_events, speech.photo_news, judge, ANSWER_TIMEOUT, timeout
        )
        if series:
            await self._until_state(id, "taking", True)
        return result if isinstance(result, str) else None

    async def stop_photo(self, id: int = MAIN, timeout: float = SAVE_TIMEOUT) -> str | None:
        """End a series; return its media id if the drone reports one.

        Raises `CommandRejected` without a series.
        """
        speech, now = self._known(id)
        if now.taking is False:
            raise CommandRejected("no photo is being taken")
        saved: str | None = None

        def judge(update: CaptureUpdate) -> str | bool | AnafiMavError | None:
            nonlocal saved
            if update.progress is CaptureProgress.SAVED:
                saved = update.media
                return saved if speech is ModernCamera else None
            if update.progress is CaptureProgress.FAILED:
                return CommandRejected(f"photo: {update.reason}")
            return True if update.progress is CaptureProgress.ENDED else None

        await self._capture(
            id, speech.stop_photo(id), speech.photo_events, speech.photo_news, judge, ANSWER_TIMEOUT, timeout
        )
        await self._until_state(id, "taking", False)
        return saved

    # -- films

    async def set_recording(self, wish: RecordingSettings, id: int = MAIN) -> RecordingSettings | None:
        """Change the recording settings; a field that is None stays as it is."""
        state = await self._ask(
            id, "recording", lambda s, now: s.recording(id, now, wish), lambda state: _has(state.recording, wish)
        )
        return state.recording

    async def start_recording(self, id: int = MAIN) -> None:
        """Start to record; returns when the camera records. Raises `CommandRejected` in mode PHOTO."""
        speech, now = self._known(id)
        if now.recording_now:
            return
        if now.recording_available is False:
            raise CommandRejected("the camera cannot record now")

        def judge(update: CaptureUpdate) -> bool | AnafiMavError | None:
            if update.progress is CaptureProgress.STARTED:
                return True
            is_refused = update.progress is CaptureProgress.FAILED or update.is_refused
            return CommandRejected(f"recording: {update.reason}") if is_refused else None

        command = speech.start_recording(id)
        await self._capture(id, command, speech.recording_events, speech.recording_news, judge, ANSWER_TIMEOUT, None)
        await self._until_state(id, "recording_now", True)

    async def stop_recording(self, id: int = MAIN, timeout: float = 2 * ANSWER_TIMEOUT) -> str:
        """Stop recording; return the media id once the video is stored."""
        speech, now = self._known(id)
        if now.recording_now is False:
            raise CommandRejected("the camera does not record")

        def judge(update: CaptureUpdate) -> str | AnafiMavError | None:
            if update.progress is CaptureProgress.ENDED:
                is_repeated = update.media != "" and update.media == now.last_recording
                return None if is_repeated else update.media
            return CommandRejected(f"recording: {update.reason}") if update.progress is CaptureProgress.FAILED else None

        command = speech.stop_recording(id)
        media = await self._capture(id, command, speech.recording_events, speech.recording_news, judge, timeout, None)
        await self._until_state(id, "recording_now", False)
        return str(media)

    async def set_storage_policy(self, policy: StoragePolicy, id: int = MAIN) -> StoragePolicy | None:
        """Choose the storage that pictures and videos are written to. Ai only."""
        state = await self._ask(
            id,
            "storage_policy",
            lambda s, now: s.storage_policy(id, now, policy),
            lambda state: state.storage_policy is policy,
        )
        return state.storage_policy

    async def set_autorecord(self, on: bool, id: int = MAIN) -> bool | None:
        """Switch automatic recording from take-off to landing."""
        state = await self._ask(
            id, "autorecord", lambda s, now: s.autorecord(id, now, on), lambda state: state.autorecord == on
        )
        return state.autorecord

    # -- zoom

    async def zoom(self, level: float, id: int = MAIN, timeout: float = ZOOM_TIMEOUT) -> float:
        """Zoom to a factor, 1 being no zoom; return it once it is reached.

        The factor is clipped to the range of the camera.
        """
        speech, now = self._known(id)
        wanted = clip(number(level, "zoom"), 1.0, self._zoom_max(now))

        def judge(message: Any) -> float | None:
            there = speech.camera_of(message) == id and abs(message.level - wanted) <= ZOOM_ARRIVED * wanted
            return float(message.level) if there else None

        answer = self._commander.expect((speech.zoom_event,), judge)
        return await self._insist(("zoom", id), speech.zoom(id, wanted), answer, timeout)

    def zoom_to(self, level: float, id: int = MAIN) -> None:
        """Send a zoom factor once, without waiting: for targets that arrive in a stream."""
        speech, now = self._known(id)
        self._order(("zoom", id), speech.zoom(id, clip(number(level, "zoom"), 1.0, self._zoom_max(now))))

    def zoom_rate(self, share: float, id: int = MAIN) -> None:
        """Zoom in (up to 1) or out (down to -1), as a share of `CameraState.zoom_speed`, sent once.

        The drone goes on until the next target or the end of the range. Zero stops it, but it can be lost: `stop_zoom`
        makes sure.
        """
        speech, now = self._known(id)
        self._zoom_max(now)
        self._order(("zoom", id), speech.zoom_rate(id, clip(number(share, "zoom rate"), -1.0, 1.0)))

    async def start_zoom(self, share: float, id: int = MAIN) -> float:
        """Zoom by rate as `zoom_rate`; return the factor once the zoom moves or is at its end.

        The command is repeated until the drone reports that.
        """
        speech, now = self._known(id)
        most = self._zoom_max(now)
        wanted = clip(number(share, "zoom rate"), -1.0, 1.0)
        if wanted == 0.0:
            return await self.stop_zoom(id)
        if not now.zoom_may_degrade:
            most = min(most, now.zoom_max_lossless or most)
        first: float | None = now.zoom

        def judge(message: Any) -> float | None:
            nonlocal first
            if speech.camera_of(message) != id:
                return None
            if first is None:
                first = message.level
            moves = (message.level - first) * wanted > 0.0 and abs(message.level - first) > ZOOM_STILL
            ends = message.level <= 1.0 + ZOOM_ARRIVED if wanted < 0.0 else message.level >= most * (1.0 - ZOOM_ARRIVED)
            return float(message.level) if moves or ends else None

        answer = self._commander.expect((speech.zoom_event,), judge)
        return await self._insist(("zoom", id), speech.zoom_rate(id, wanted), answer, ANSWER_TIMEOUT)

    async def stop_zoom(self, id: int = MAIN) -> float:
        """Stop the zoom; return the factor at which it stands."""
        speech, now = self._known(id)
        self._zoom_max(now)
        last = math.nan
        seen = 0

        def judge(message: Any) -> float | None:
            nonlocal last, seen
            if speech.camera_of(message) != id:
                return None
            stands = seen > 1 and abs(message.level - last) <= ZOOM_STILL
            last, seen = message.level, seen + 1
            return float(message.level) if stands else None

        answer = self._commander.expect((speech.zoom_event,), judge)
        return await self._insist(("zoom", id), speech.zoom_rate(id, 0.0), answer, ANSWER_TIMEOUT)

    async def reset_zoom(self, id: int = MAIN) -> float:
        """Reset the zoom; return the factor then."""
        speech, now = self._known(id)
        self._zoom_max(now)
        self._orders["zoom", id] += 1

        def judge(message: Any) -> float | None:
            there = speech.camera_of(message) == id and abs(message.level - 1.0) <= ZOOM_ARRIVED
            return float(message.level) if there else None

        return await self._commander.confirm(speech.reset_zoom(id), (speech.zoom_event,), judge, ZOOM_TIMEOUT)

    async def set_zoom_speed(self, speed: float, id: int = MAIN) -> float | None:
        """Set the highest zoom speed, tan(deg)/s."""
        number(speed, "zoom speed")
        state = await self._ask(
            id,
            "zoom_speed",
            lambda s, now: s.zoom_speed(id, now, speed),
            lambda state: is_same(state.zoom_speed, float(speed)),
        )
        return state.zoom_speed

    async def set_zoom_may_degrade(self, allowed: bool, id: int = MAIN) -> bool | None:
        """Allow or forbid a zoom by rate beyond the lossless range."""
        state = await self._ask(
            id,
            "zoom_may_degrade",
            lambda s, now: s.zoom_may_degrade(id, now, allowed),
            lambda state: state.zoom_may_degrade == allowed,
        )
        return state.zoom_may_degrade

    # -- light

    async def set_ev(self, ev: float, id: int = MAIN) -> float | None:
        """Set the exposure compensation, EV, to the nearest third."""
        state = await self._ask(
            id, "ev", lambda s, now: s.ev(id, now, ev), lambda state: state.ev == ev_of(ev_step(ev))
        )
        return state.ev

    async def set_exposure(self, wish: ExposureSettings, id: int = MAIN) -> ExposureSettings | None:
        """Change the exposure; a field that is None stays. Shutter and ISO take the nearest step."""
        state = await self._ask(
            id, "exposure", lambda s, now: s.exposure(id, now, wish), lambda state: _has(state.exposure, wish)
        )
        return state.exposure

    async def lock_exposure(
        self, on: bool = True, at: tuple[float, float] | None = None, id: int = MAIN
    ) -> bool | None:
        """Lock or unlock the exposure.

        With `at` (x, y: 0 to 1 from the upper left) it is locked to the exposure of that place.
        """
        if not self[id].exposure_lockable:
            self._commander.require_feature(None, "exposure lock")
        state = await self._ask(
            id,
            "exposure",
            lambda s, now: s.lock_exposure(id, now, on, at),
            lambda state: state.exposure_locked == on,
        )
        return state.exposure_locked

    async def set_white_balance(
        self, mode: WhiteBalance, temperature_k: float | None = None, id: int = MAIN
    ) -> tuple[WhiteBalance | None, float | None]:
        """Set the white balance; `temperature_k` (to the nearest 250 K) is for CUSTOM. Return both."""

        def is_wanted(state: CameraState) -> bool:
            if state.white_balance is not mode or temperature_k is None or state.temperature_k is None:
                return state.white_balance is mode
            return abs(state.temperature_k - temperature_k) <= TEMPERATURE_STEP / 2

        state = await self._ask(
            id,
            "white_balance",
            lambda s, now: s.white_balance(id, now, mode, temperature_k),
            is_wanted,
        )
        return state.white_balance, state.temperature_k

    async def lock_white_balance(self, on: bool = True, id: int = MAIN) -> bool | None:
        """Lock or unlock the white balance."""
        if not self[id].white_balance_lockable:
            self._commander.require_feature(None, "white balance lock")
        state = await self._ask(
            id,
            "white_balance",
            lambda s, now: s.lock_white_balance(id, now, on),
            lambda state: state.white_balance_locked == on,
        )
        return state.white_balance_locked

    async def set_hdr(self, on: bool, id: int = MAIN) -> bool | None:
        """Switch HDR on or off."""
        return (await self._ask(id, "hdr", lambda s, now: s.hdr(id, now, on), lambda state: state.hdr == on)).hdr

    async def set_style(self, style: Style, id: int = MAIN) -> Style | None:
        """Choose the style of the picture."""
        state = await self._ask(
            id,
            "style",
            lambda s, now: s.style(id, now, style),
            lambda state: state.style is not None and state.style.style is style,
        )
        return None if state.style is None else state.style.style

    async def set_style_params(
        self, saturation: float, contrast: float, sharpness: float, id: int = MAIN
    ) -> CameraState:
        """Set the levels of the present style; their ranges are in `StyleSettings`."""
        for value in (saturation, contrast, sharpness):
            number(value, "style")

        def is_wanted(state: CameraState) -> bool:
            style = state.style or StyleSettings()
            levels = [
                None if one is None else one.current for one in (style.saturation, style.contrast, style.sharpness)
            ]
            return is_same(tuple(levels), (float(saturation), float(contrast), float(sharpness)))

        return await self._ask(
            id, "style", lambda s, now: s.style_params(id, now, saturation, contrast, sharpness), is_wanted
        )

    async def set_streaming(self, mode: Streaming, id: int = MAIN) -> Streaming | None:
        """Choose between low latency and reliability of the live video."""
        state = await self._ask(
            id, "streaming", lambda s, now: s.streaming(id, now, mode), lambda state: state.streaming is mode
        )
        return state.streaming

    async def set_alignment(self, yaw: float, pitch: float, roll: float, id: int = MAIN) -> CameraState:
        """Set the corrections against the other camera, deg."""
        for angle in (yaw, pitch, roll):
            number(angle, "alignment")
        wanted = {"yaw": float(yaw), "pitch": float(pitch), "roll": float(roll)}
        return await self._ask(
            id,
            "alignment",
            lambda s, now: s.alignment(id, now, yaw, pitch, roll),
            lambda state: all(is_same(one.current, wanted.get(axis)) for axis, one in state.alignment.items()),
        )

    async def set_antiflicker(self, mode: Antiflicker) -> Antiflicker | None:
        """Set the mains frequency that the exposure adapts to; one for all cameras."""
        self._commander.require_feature(self.state.antiflicker, "antiflicker")
        speech, _ = self._known(min(self.state.cameras, default=MAIN))
        command, answer = speech.antiflicker(mode)
        return await self._change(command, answer, lambda message: self.state.antiflicker, same_as(mode))

    # -- the connection

    def questions(self) -> list[Question]:
        """Return the queries for a drone that speaks protobuf.

        It reports its cameras only on request.
        """
        return [
            (camera2.ListCameras(), camera2.CameraList, lambda message: True),
            (mains.GetState(include_default_capabilities=True), mains.State, lambda message: True),
        ]

    def details(self) -> list[Question]:
        """Return the queries to send once the cameras are known."""

        def about(id: int) -> Question:
            command = camera2.GetState(camera_id=id, include_default_capabilities=True)
            return command, camera2.State, lambda message: True if ModernCamera.camera_of(message) == id else None

        return [about(id) for id, camera in self.state.cameras.items() if camera.feature == camera_modern.FEATURE]

    # -- inside

    def _queries(self) -> list[Message]:
        return [*super()._queries(), *(command for command, *_ in self.details())]

    async def until_active(self, kind: CameraKind) -> None:
        """Wait until the camera of this kind is reported to take the pictures.

        A thermal mode changes that. Returns without it when the drone does not report it in `STATE_TIMEOUT`.
        """

        def judge(message: Message) -> bool | None:
            return True if self._is_active(kind) else None

        if self.state.active and not self._is_active(kind):
            with contextlib.suppress(CommandTimeout, LinkLost):
                answer = self._commander.expect((camera_classic.ACTIVE_EVENT,), judge)
                answer.expire_after(STATE_TIMEOUT, camera_classic.ACTIVE_EVENT.NAME)
                await answer.wait()

    def _is_active(self, kind: CameraKind) -> bool:
        """Return True if the active camera is of this kind.

        If no camera is reported with a thermal kind, it is any but the main one.
        """
        id = self.active_id
        if kind is CameraKind.MAIN or kind not in (camera.kind for camera in self.state.cameras.values()):
            return (id == MAIN) is (kind is CameraKind.MAIN)
        return self[id].kind is kind

    def _known(self, id: int) -> tuple[type[ClassicCamera] | type[ModernCamera], CameraState]:
        """How to ask this camera, and its state."""
        now = self[id]
        self._commander.require_feature(now.feature, f"camera {id}")
        assert now.feature is not None
        return _SPEECH[now.feature], now

    @staticmethod
    def _zoom_max(now: CameraState) -> float:
        if now.zoom_max is None or now.zoom_max <= 1.0:
            raise NotSupported("zoom")
        return now.zoom_max

    async def _ask(
        self,
        id: int,
        field: str,
        ask: Callable[[type[ClassicCamera] | type[ModernCamera], CameraState], Ask],
        is_wanted: Callable[[CameraState], bool],
    ) -> CameraState:
        """Change a setting; returns the state after the drone's answer.

        `field` must have been reported.
        """
        speech, now = self._known(id)
        self._commander.require_feature(getattr(now, field), f"camera {id}: {field.replace('_', ' ')}")
        first, answer = ask(speech, now)
        if isinstance(first, camera2.Configure) and first.config == camera2.Config():
            raise LocalProtocolError("nothing to change")

        def judge(message: Any) -> CameraState | None:
            # A state of camera2 can be about something else, such as the end of a photo.
            is_other = isinstance(first, camera2.Configure) and message.config is None
            return None if is_other or speech.camera_of(message) != id else self[id]

        return await self._change(lambda: ask(speech, self[id])[0], answer, judge, is_wanted)

    async def _capture(
        self,
        id: int,
        command: Message,
        events: tuple[type[Message], ...],
        read: Callable[[Any], CaptureUpdate | None],
        judge: Callable[[CaptureUpdate], Any],
        first: float,
        next: float | None,
    ) -> Any:
        """Send a command and judge the progress reports of this camera.

        `first` is the timeout, s; each report restarts it with `next` s, unless that is None.
        """

        def listen(message: Any) -> Any:
            update = read(message)
            if update is None or update.camera != id:
                return None
            if next is not None:
                answer.expire_after(next, command.NAME)
            return judge(update)

        require_number(next)  # before the command: later it would end the wait for what the camera has begun
        answer = self._commander.expect(events, listen)
        self._commander.dispatch(answer, command, first)
        return await answer.wait()

    async def _until_state(self, id: int, field: str, value: bool) -> None:
        """Wait until the state has what was reported to have begun or ended.

        The next command goes by it. It has begun, or ended, also without a link.
        """

        def judge(message: Any) -> bool | None:
            return True if getattr(self[id], field) is value else None

        speech, now = self._known(id)
        if getattr(now, field) not in (value, None):
            with contextlib.suppress(CommandTimeout, LinkLost):
                answer = self._commander.expect(speech.state_events, judge)
                answer.expire_after(STATE_TIMEOUT, field)
                await answer.wait()
