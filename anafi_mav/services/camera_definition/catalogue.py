"""The settings that one drone has, with their options and how they limit each other. No I/O.

A drone with a thermal camera has three cameras, and its thermal mode decides which of them works. Their settings are
one list here: QGroundControl loads a definition once for each camera component. CAM_THERMAL limits what the camera at
work cannot do.

Options only grow while a drone is connected. It reports shutter times and ISO values for its present mode of
recording (camera.xml exposure_settings): a definition that follows them would change with each of its own settings.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from msgspec.structs import replace

from anafi_mav.drone import (
    CameraKind,
    CamerasState,
    CameraState,
    PhotoOption,
    Range,
    RecordingOption,
    StyleSettings,
    ThermalState,
)
from anafi_mav.drone.events import ThermalMode
from anafi_mav.drone.payload.thermal import ACTIVE_CAMERAS
from anafi_mav.services.camera_definition import setting_table, thermal_table
from anafi_mav.services.camera_definition.camera_setting import CameraSetting, Option, ValueLimits, View

SETTINGS: tuple[CameraSetting, ...] = (
    setting_table.CAMERA_SETTINGS[0],
    *thermal_table.THERMAL_SETTINGS[:1],
    *setting_table.CAMERA_SETTINGS[1:],
    *thermal_table.THERMAL_SETTINGS[1:],
)
"""All settings of all models, in the order of the list."""

_SETS = (
    "modes",
    "exposures",
    "white_balances",
    "styles",
    "bursts",
    "brackets",
    "meterings",
    "streamings",
    "codecs",
    "storage_policies",
)
_SORTED = ("evs", "temperatures", "shutters", "isos", "max_isos", "megapixels", "bitrates", "hyperlapses")
_LISTS = ("photos", "recordings")
_BOUNDS = ("zoom_speed_bounds", "time_lapse_bounds", "gps_lapse_bounds")
_FLAGS = ("exposure_lockable", "white_balance_lockable", "signable", "live_video_keepable")

MAX_OPTIONS = 64
"""Options that are kept of a list. A camera has a dozen combinations, and Parrot's longest enumeration 50 values; more
is a confused drone."""


SHARED = 64
"""Cameras with different offers that are remembered: a model has up to three."""


class Restriction(NamedTuple):
    """While a setting has a value, and the others theirs, the target has these options only."""

    setting: str
    value: float
    target: str
    options: tuple[Option, ...]
    conditions: tuple[tuple[str, float], ...] = ()
    """Other settings with the value that they must have."""


class CatalogueEntry(NamedTuple):
    """A setting that the drone has: either with options, or with limits."""

    setting: CameraSetting
    options: tuple[Option, ...]
    limits: ValueLimits | None

    @property
    def default(self) -> float:
        """The possible value that is nearest to the default of the table."""
        wanted = self.setting.kind.normalise(self.setting.default)
        if self.limits is not None:
            return min(max(wanted, self.limits.low), self.limits.high)
        return min((option.value for option in self.options), key=lambda value: abs(value - wanted))


class CameraOffers(NamedTuple):
    """Everything of one camera that the definition depends on."""

    kind: CameraKind | None
    photos: tuple[PhotoOption, ...]
    recordings: tuple[RecordingOption, ...]
    settings: tuple[tuple[tuple[Option, ...], ValueLimits | None], ...]
    """Options and limits of each of `SETTINGS`."""


Offers = tuple[tuple[int, CameraOffers], ...]
"""Of each camera by its id, in the order in which they were reported."""


@lru_cache(maxsize=SHARED)
def _shared(offers: CameraOffers) -> CameraOffers:
    """Return one object for equal cameras of different drones: each has hundreds of options."""
    return offers


class Catalogue:
    """The settings of one connected drone."""

    def __init__(self) -> None:
        self._cameras: dict[int, CameraState] = {}
        self._shared = CamerasState()
        self._thermal = ThermalState()
        self.entries: tuple[CatalogueEntry, ...] = ()
        self.index: Mapping[str, int] = {}
        """Place of each setting in the list."""
        self._offers: dict[int, CameraOffers] = {}

    def learn(self, cameras: CamerasState, thermal: ThermalState) -> bool:
        """Take in what the drone reports that it can do; return True when that has changed."""
        for id, camera in cameras.cameras.items():
            self._cameras[id] = grown(self._cameras.get(id), camera)
        self._shared, self._thermal = cameras, thermal
        offers = {id: _shared(self._offers_of(camera)) for id, camera in self._cameras.items()}
        if offers == self._offers:
            return False
        self._offers = offers
        self.entries, self.index = _entries_of(tuple(offers.values()))
        return True

    @property
    def offers(self) -> Offers:
        """Everything that the definition depends on, beside the model."""
        return tuple(self._offers.items())

    def __getitem__(self, name: str) -> CatalogueEntry:
        return self.entries[self.index[name]]

    def exclusions(self) -> Mapping[tuple[str, float], tuple[str, ...]]:
        """Return the settings that do not count while another has a value, by its name and value."""
        found: dict[tuple[str, float], list[str]] = {}
        for entry in self.entries:
            for name, values in entry.setting.only_in.items():
                for option in self[name].options if name in self.index else ():
                    if option.value not in values:
                        found.setdefault((name, option.value), []).append(entry.setting.name)
        for value, view in self._thermal_views():
            for entry in self.entries:
                hidden = found.setdefault(("CAM_THERMAL", value), [])
                if not entry.setting.is_of(view) and entry.setting.name not in hidden:
                    hidden.append(entry.setting.name)
        return {key: tuple(names) for key, names in found.items() if names}

    def restrictions(self) -> list[Restriction]:
        """Return the limits that settings set each other.

        QGroundControl and MAVProxy apply the first one that is true for a target. MAVSDK knows no conditions and takes
        the last one for each pair of setting and target, which is the most general therefore.
        """
        if not self._cameras:
            return []
        thermal = (("CAM_THERMAL", float(ThermalMode.DISABLED)),) if "CAM_THERMAL" in self.index else ()
        main = self._cameras[min(self._cameras)]
        words = setting_table
        recordings = [
            (
                {words.VIDEO_MODES[mode][0] for mode in one.modes},
                {words.RESOLUTIONS[size][0] for size in one.resolutions},
                set(one.framerates),
            )
            for one in main.recordings
        ]
        photos = [
            (
                {words.PHOTO_MODES[mode][0] for mode in one.modes},
                {words.PHOTO_FORMATS[format][0] for format in one.formats},
                {words.PHOTO_FILES[file][0] for file in one.files},
            )
            for one in main.photos
        ]
        return [
            *self._combinations(("CAM_VIDMODE", "CAM_VIDRES", "CAM_VIDFPS"), recordings, thermal),
            *self._combinations(("CAM_PHOTOMODE", "CAM_PHOTOPROJ", "CAM_PHOTOFMT"), photos, thermal),
            *self._of_thermal_modes(),
        ]

    def _offers_of(self, camera: CameraState) -> CameraOffers:
        view = self._view(camera)
        settings = tuple((setting.options_of(view), setting.limits_of(view)) for setting in SETTINGS)
        return CameraOffers(camera.kind, camera.photos, camera.recordings, settings)

    def _view(self, camera: CameraState) -> View:
        return View(camera, self._shared, self._thermal)

    def _thermal_views(self) -> Iterable[tuple[float, View]]:
        """Yield the value of each thermal mode with the camera that it makes the active one."""
        if "CAM_THERMAL" not in self.index:
            return
        for option in self["CAM_THERMAL"].options:
            kind = ACTIVE_CAMERAS[ThermalMode(round(option.value))]
            for camera in self._cameras.values():
                if camera.kind is kind:
                    yield option.value, self._view(camera)

    def _of_thermal_modes(self) -> Iterable[Restriction]:
        combined = {"CAM_VIDRES", "CAM_VIDFPS", "CAM_PHOTOPROJ", "CAM_PHOTOFMT"}
        for value, view in self._thermal_views():
            for entry in self.entries:
                options = entry.setting.options_of(view)
                if not options or len(options) == len(entry.options):
                    continue
                if value == ThermalMode.DISABLED and entry.setting.name in combined:
                    continue  # its combinations limit it
                yield Restriction("CAM_THERMAL", value, entry.setting.name, options)

    def _combinations(
        self,
        names: tuple[str, str, str],
        accepted: list[tuple[set[int], set[int], set[Any]]],
        conditions: tuple[tuple[str, float], ...],
    ) -> Iterable[Restriction]:
        """Yield the limits of three settings of which each narrows the next ones."""
        first, second, third = names
        if any(name not in self.index for name in names):
            return
        for option in self[first].options:
            fits = {value for ones, twos, _ in accepted if option.value in ones for value in twos}
            yield from self._narrow(first, option, second, fits, conditions)
        for option in self[second].options:
            every = {value for _, twos, threes in accepted if option.value in twos for value in threes}
            depends = False
            for above in self[first].options:
                fits = {
                    value
                    for ones, twos, threes in accepted
                    if above.value in ones and option.value in twos
                    for value in threes
                }
                if fits and fits != every:
                    depends = True
                    yield from self._narrow(second, option, third, fits, ((first, above.value), *conditions))
            yield from self._narrow(second, option, third, every, conditions, always=depends)

    def _narrow(
        self,
        name: str,
        option: Option,
        target: str,
        fits: set[Any],
        conditions: tuple[tuple[str, float], ...],
        *,
        always: bool = False,
    ) -> Iterable[Restriction]:
        """Yield a limit, unless it leaves all options.

        `always`: it follows one with more conditions, and is yielded in any case.
        """
        kind = self[target].setting.kind
        values = {kind.normalise(value) for value in fits}
        options = tuple(one for one in self[target].options if one.value in values)
        if options and (always or len(options) < len(self[target].options)):
            yield Restriction(name, option.value, target, options, conditions)


@lru_cache(maxsize=SHARED)
def _entries_of(cameras: tuple[CameraOffers, ...]) -> tuple[tuple[CatalogueEntry, ...], Mapping[str, int]]:
    """Return the settings of these cameras, and the place of each; equal drones share them."""
    found = (_entry(cameras, place, setting) for place, setting in enumerate(SETTINGS))
    entries = tuple(entry for entry in found if entry is not None)
    return entries, {entry.setting.name: place for place, entry in enumerate(entries)}


def _entry(cameras: tuple[CameraOffers, ...], place: int, setting: CameraSetting) -> CatalogueEntry | None:
    """Return a setting with the options of all cameras; None when no camera has it."""
    offered = [offers.settings[place] for offers in cameras]
    options: dict[float, Option] = {}
    for some, _ in offered:
        options.update((option.value, option) for option in some)
    # Choices are in the sequence of the table, numbers in their own.
    ordered = list(options.values()) if setting.kind.is_choice else sorted(options.values())
    limits = [found for _, found in offered if found is not None]
    if not options and not limits:
        return None
    widest = None
    if limits:
        steps = {one.step for one in limits}
        step = steps.pop() if len(steps) == 1 else None
        widest = ValueLimits(min(one.low for one in limits), max(one.high for one in limits), step)
    return CatalogueEntry(setting, tuple(ordered), widest)


def grown(known: CameraState | None, now: CameraState) -> CameraState:
    """Return the present state with every option that was ever reported."""
    if known is None:
        return now
    changes: dict[str, Any] = {}
    for name in _SETS:
        before, after = getattr(known, name), getattr(now, name)
        changes[name] = after if before is None else before | (after or frozenset())
    for name in _SORTED:
        changes[name] = tuple(sorted({*getattr(known, name), *getattr(now, name)}))[:MAX_OPTIONS]
    for name in _LISTS:
        before = getattr(known, name)
        changes[name] = (*before, *(one for one in getattr(now, name) if one not in before))[:MAX_OPTIONS]
    for name in _BOUNDS:
        before, after = getattr(known, name), getattr(now, name)
        if before is not None and after is not None:
            after = (min(before[0], after[0]), max(before[1], after[1]))
        changes[name] = after or before
    for name in _FLAGS:
        changes[name] = bool(getattr(known, name)) or getattr(now, name)
    changes["style"] = _grown_style(known.style, now.style)
    axes = {**known.alignment, **now.alignment}
    changes["alignment"] = {axis: _wider(known.alignment.get(axis), now.alignment.get(axis)) for axis in axes}
    for name in ("photo", "recording", "exposure", "autorecord", "hdr", "zoom_may_degrade", "zoom_speed"):
        if getattr(now, name) is None:
            changes[name] = getattr(known, name)
    return replace(now, **changes)


def _grown_style(known: StyleSettings | None, now: StyleSettings | None) -> StyleSettings | None:
    if known is None or now is None:
        return now or known
    levels = {
        name: _wider(getattr(known, name), getattr(now, name)) for name in ("saturation", "contrast", "sharpness")
    }
    return replace(now, **levels)


def _wider(known: Range | None, now: Range | None) -> Range | None:
    if known is None or now is None:
        return now or known
    return Range(now.current, min(known.min, now.min), max(known.max, now.max))
