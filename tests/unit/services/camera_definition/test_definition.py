"""The definition of each model's camera, read with the rules of the ground stations."""

from __future__ import annotations

import lzma
import math
import sys
from typing import Any

import pytest
from msgspec.structs import replace
from support.camera_states import MODEL_KEYS, catalogue, states
from support.definition_readers import read_definition

from anafi_mav.drone.payload.camera_enums import PhotoFile, PhotoFormat, PhotoMode, RecordingMode, Resolution
from anafi_mav.drone.payload.camera_state import (
    CameraState,
    PhotoOption,
    PhotoSettings,
    RecordingOption,
    RecordingSettings,
)
from anafi_mav.services.camera_definition.catalogue import SETTINGS, Catalogue
from anafi_mav.services.camera_definition.definition_file import definition_file
from anafi_mav.services.camera_definition.param_ext_codec import ExtType
from anafi_mav.services.camera_definition.setting_fit import fitting_photo, fitting_recording
from anafi_mav.services.camera_definition.setting_table import ev_text, shutter_text


def values(definition: Any) -> dict[str, float]:
    return {name: one.default for name, one in definition.parameters.items()}


@pytest.mark.parametrize("model", MODEL_KEYS)
def test_definition_is_read_by_ground_stations_rules(model: str) -> None:
    made = definition_file(catalogue(model), "ANAFI")
    read = read_definition(made.content)
    assert (read.vendor, read.model, read.version) == ("Parrot", "ANAFI", made.version)
    assert 0 < made.version <= 0xFFFF
    assert len(lzma.compress(made.content)) < 4096  # a second at 57600 baud


@pytest.mark.parametrize("model", MODEL_KEYS)
def test_definition_is_read_by_mavproxy(model: str) -> None:
    from MAVProxy.modules.mavproxy_camera.definition import CameraDefinition

    made = definition_file(catalogue(model), "ANAFI")
    theirs, ours = CameraDefinition(lzma.compress(made.content)), read_definition(made.content)
    assert set(theirs.parameters) == set(ours.parameters)
    now = values(ours)
    for option in ours.parameters["CAM_MODE"].options:
        now["CAM_MODE"] = option.value
        shown = {name: [value for _, value in choices] for name, choices in theirs.controls(now).items()}
        hidden = ours.hidden(now)
        expected = {
            name: ours.options(name, now)
            for name, one in ours.parameters.items()
            if one.is_listed and name not in hidden
        }
        assert shown == expected


def test_definition_changes_with_capabilities_alone() -> None:
    cameras, thermal = states("4k")
    first, second = Catalogue(), Catalogue()
    assert first.learn(cameras, thermal)
    main = cameras.cameras[0]
    other = replace(main, ev=1.0, hdr=True, shutter_s=0.5)
    assert not first.learn(replace(cameras, cameras={0: other}), thermal)
    second.learn(replace(cameras, cameras={0: other}), thermal)
    before = definition_file(first, "ANAFI 4K")
    assert definition_file(second, "ANAFI 4K") == before
    second.learn(replace(cameras, cameras={0: replace(other, evs=(*main.evs, 4.0))}), thermal)
    assert definition_file(second, "ANAFI 4K").version != before.version
    second.learn(replace(cameras, cameras={0: main}), thermal)
    assert 4.0 in [option.value for option in second["CAM_EV"].options]


@pytest.mark.parametrize("most", [3600.5, sys.float_info.max, math.inf])
def test_numbers_beyond_their_type_make_no_limit_and_no_option(most: float) -> None:
    """A drone may report the largest double for an interval without an end."""
    cameras, thermal = states("ai")
    main = replace(
        cameras.cameras[0],
        time_lapse_bounds=(1.0, most),
        zoom_speed_bounds=(0.1, sys.float_info.max),
        bitrates=(100_000_000, 3_000_000_000),
        zoom_speed=sys.float_info.max,
    )
    learned = Catalogue()
    assert learned.learn(replace(cameras, cameras={0: main}), thermal)
    assert learned["CAM_PHOTOLAPSE"].limits == (1.0, 3600.0, None)
    assert [option.value for option in learned["CAM_VIDRATE"].options] == [100_000_000]
    assert "CAM_ZOOMSPEED" not in learned.index
    assert read_definition(definition_file(learned, "ANAFI Ai").content).parameters


def test_equal_cameras_of_two_drones_share_their_options() -> None:
    catalogues = Catalogue(), Catalogue()
    for one in catalogues:
        one.learn(*states("4k"))
    assert catalogues[0].entries is catalogues[1].entries
    assert catalogues[0].index is catalogues[1].index
    mine, others = ([entry.options for entry in one.entries] for one in catalogues)
    assert sum(len(options) for options in mine) > 100
    for options, same in zip(mine, others, strict=True):
        assert all(one is other for one, other in zip(options, same, strict=True))


def test_settings_of_a_4k_are_those_it_reports() -> None:
    found = catalogue("4k")
    assert "CAM_THERMAL" not in found.index
    assert "CAM_SHUTTERSPD" not in found.index  # no manual mode
    assert [option.text for option in found["CAM_VIDRES"].options] == [
        "4096 x 2160 (DCI 4K)",
        "3840 x 2160 (UHD 4K)",
        "2704 x 1524 (2.7K)",
        "1920 x 1080",
        "1280 x 720",
    ]
    assert [option.value for option in found["CAM_EV"].options][:2] == [
        ExtType.REAL32.normalise(-3.0),
        ExtType.REAL32.normalise(-8.0 / 3.0),
    ]


def test_frame_rates_follow_video_mode_and_resolution() -> None:
    read = read_definition(definition_file(catalogue("4k"), "ANAFI").content)
    now = values(read) | {"CAM_VIDMODE": 0.0, "CAM_VIDRES": 3.0}
    assert read.options("CAM_VIDFPS", now) == pytest.approx([23.97, 25.0, 29.97], abs=0.1)
    now["CAM_VIDMODE"] = 2.0
    slow = read.options("CAM_VIDFPS", now)
    assert slow == pytest.approx([48.0, 50.0, 60.0], abs=0.1)
    assert read.options("CAM_VIDRES", now) == [3.0, 4.0]
    assert set(slow) <= set(read.options_of_mavsdk("CAM_VIDFPS", now))


def test_thermal_mode_limits_what_its_camera_cannot_do() -> None:
    read = read_definition(definition_file(catalogue("thermal"), "ANAFI").content)
    now = values(read)
    assert {"CAM_THM_RENDER", "CAM_THM_EMISS"} <= read.hidden(now)
    assert 7.0 not in read.options("CAM_VIDRES", now)
    now["CAM_THERMAL"] = 2.0
    assert {"CAM_PHOTOMODE", "CAM_ZOOMSPEED", "CAM_SHUTTERSPD"} <= read.hidden(now)
    assert "CAM_THM_RENDER" not in read.hidden(now)
    assert read.options("CAM_VIDRES", now) == [7.0]
    assert read.options("CAM_VIDFPS", now) == [9.0]


def test_settings_have_distinct_names_and_known_relations() -> None:
    names = [setting.name for setting in SETTINGS]
    assert len(set(names)) == len(names)
    for setting in SETTINGS:
        assert set(setting.only_in) <= set(names)
        assert all(name == name.upper() for name in names)


RECORDINGS = (
    RecordingOption(frozenset({RecordingMode.STANDARD}), frozenset({Resolution.UHD_4K}), (24.0, 30.0), True),
    RecordingOption(frozenset({RecordingMode.SLOW_MOTION}), frozenset({Resolution.R1080P}), (50.0, 60.0), False),
)


def test_video_mode_takes_resolution_and_rate_with_it() -> None:
    now = RecordingSettings(RecordingMode.STANDARD, Resolution.UHD_4K, 30.0)
    camera = CameraState(recording=now, recordings=RECORDINGS)
    wish = fitting_recording(camera, RecordingSettings(mode=RecordingMode.SLOW_MOTION))
    assert wish == RecordingSettings(RecordingMode.SLOW_MOTION, Resolution.R1080P, 50.0)


def test_frame_rate_alone_takes_nothing_with_it() -> None:
    now = RecordingSettings(RecordingMode.STANDARD, Resolution.UHD_4K, 30.0)
    camera = CameraState(recording=now, recordings=RECORDINGS)
    assert fitting_recording(camera, RecordingSettings(framerate=60.0)) == RecordingSettings(framerate=60.0)


def test_photo_mode_takes_projection_and_file_with_it() -> None:
    photos = (
        PhotoOption(
            frozenset({PhotoMode.SINGLE}),
            frozenset({PhotoFormat.FULL_FRAME}),
            frozenset({PhotoFile.JPEG, PhotoFile.DNG}),
            True,
        ),
        PhotoOption(
            frozenset({PhotoMode.BURST}), frozenset({PhotoFormat.RECTILINEAR}), frozenset({PhotoFile.JPEG}), False
        ),
    )
    now = PhotoSettings(PhotoMode.SINGLE, PhotoFormat.FULL_FRAME, PhotoFile.DNG)
    wish = fitting_photo(CameraState(photo=now, photos=photos), PhotoSettings(mode=PhotoMode.BURST))
    assert (wish.mode, wish.format, wish.file) == (PhotoMode.BURST, PhotoFormat.RECTILINEAR, PhotoFile.JPEG)


@pytest.mark.parametrize(
    ("seconds", "text"), [(1.0 / 60.0, "1/60"), (1.0 / 10000.0, "1/10000"), (1.0 / 2.5, "1/2.5"), (1.0, "1")]
)
def test_shutter_time_is_written_as_a_fraction(seconds: float, text: str) -> None:
    assert shutter_text(seconds) == text


@pytest.mark.parametrize(
    ("ev", "text"), [(0.0, "0"), (1.0 / 3.0, "+1/3"), (-2.0, "-2"), (5.0 / 3.0, "+1 2/3"), (-8.0 / 3.0, "-2 2/3")]
)
def test_exposure_compensation_is_written_in_thirds(ev: float, text: str) -> None:
    assert ev_text(ev) == text


def test_float_is_found_again_by_its_printed_text() -> None:
    # MAVSDK prints six decimals and compares what it reads back from them, as single precision.
    for value in (1.0 / 6400.0, 1.0 / 3.0, 29.97, -8.0 / 3.0, 3600.0):
        held = ExtType.REAL32.normalise(value)
        assert ExtType.REAL32.decode(ExtType.REAL32.encode(held)) == held
        assert ExtType.REAL32.normalise(float(ExtType.REAL32.text(held))) == held


def test_values_lie_little_endian_at_the_start_of_their_field() -> None:
    assert ExtType.INT32.encode(-2) == b"\xfe\xff\xff\xff" + bytes(124)
    assert ExtType.CHOICE.encode(7) == b"\x07" + bytes(127)
    assert ExtType.REAL32.encode(1.0) == b"\x00\x00\x80\x3f" + bytes(124)
    assert ExtType.UINT32.decode(b"\x01\x02") == 0x201
    assert ExtType.REAL32.decode(b"\x00\x00\xc0\x7f") is None
    with pytest.raises(ValueError, match="int32"):
        ExtType.CHOICE.normalise(2**31)
