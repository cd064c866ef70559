"""The simulated memory card: room, a card that is full, monitoring, formatting; both of the Ai's."""

from __future__ import annotations

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import camera, mediastore, user_storage, user_storage_v2
from anafi_mav.arsdk.messages.camera import Availability, CameraCameraMode, PhotoResult, RecordingResult, State
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.messages.mediastore import MediastoreState
from anafi_mav.arsdk.messages.user_storage import (
    FormattingResult,
    FormattingStep,
    FormattingType,
    FsState,
    PhyState,
)
from anafi_mav.sim.payload.storage import MediaVolume


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.send(camera.SetCameraMode(0, CameraCameraMode.PHOTO))
    return bench


def place(bench: Bench) -> MediaVolume:
    return bench.firmware.payload.storage.place


def shoot(bench: Bench) -> PhotoResult:
    """One photo; what became of it."""
    bench.send(camera.TakePhoto(0))
    bench.run_until(lambda: bench.of(camera.PhotoState)[-1].state is State.INACTIVE)
    return bench.of(camera.PhotoProgress)[-1].result


def format(bench: Bench, command: Message) -> list[Message]:
    before = len(bench.events)
    bench.send(command)
    bench.run_until(lambda: bool(bench.of(user_storage.FormatResult)))
    bench.run(1.0)
    return bench.events[before:]


def test_photos_take_room(bench: Bench) -> None:
    assert place(bench).free == 64_000_000_000
    assert shoot(bench) is PhotoResult.PHOTO_SAVED
    (media,) = bench.firmware.payload.media
    assert place(bench).free == 64_000_000_000 - len(media.resources[0].content())


def test_a_card_fills(bench: Bench) -> None:
    shoot(bench)
    size = bench.firmware.payload.media.used
    place(bench).capacity = 3 * size + size // 2
    results = [shoot(bench) for _ in range(4)]
    assert results == [PhotoResult.PHOTO_SAVED] * 2 + [PhotoResult.ERROR_NO_STORAGE_SPACE] * 2
    assert len(bench.firmware.payload.media) == 3
    assert bench.of(camera.PhotoState)[-1] == camera.PhotoState(0, Availability.AVAILABLE, State.INACTIVE)


def test_a_burst_keeps_what_there_was_room_for(bench: Bench) -> None:
    shoot(bench)
    size = bench.firmware.payload.media.used
    place(bench).capacity = size * 6
    settings = camera.CameraPhotoMode.BURST, camera.PhotoFormat.FULL_FRAME, camera.PhotoFileFormat.JPEG
    rest = camera.BurstValue.BURST_14_OVER_1S, camera.BracketingPreset.PRESET_1EV, 2.0
    bench.send(camera.SetPhotoMode(0, *settings, *rest))
    assert shoot(bench) is PhotoResult.ERROR_NO_STORAGE_SPACE
    burst = list(bench.firmware.payload.media)[1]
    assert 4 <= len(burst.resources) <= 5
    assert place(bench).free < size


def test_a_recording_ends_when_the_card_is_full(bench: Bench) -> None:
    bench.send(camera.SetCameraMode(0, CameraCameraMode.RECORDING))
    place(bench).capacity = 6000
    bench.send(camera.StartRecording(0))
    bench.run(1.0)
    free = place(bench).free
    bench.run(2.0)
    assert place(bench).free < free  # while it is being written
    bench.run_until(lambda: bench.of(camera.RecordingState)[-1].state is State.INACTIVE)
    progress = bench.of(camera.RecordingProgress)[-1]
    assert progress == camera.RecordingProgress(0, RecordingResult.STOPPED_NO_STORAGE_SPACE, "10000001")
    (media,) = bench.firmware.payload.media
    # The last second that fitted is there, the next would not have.
    frame = 6000 - media.size
    assert 0 <= frame < 900
    place(bench).capacity = media.size
    assert bench.send(camera.StartRecording(0)) == [
        camera.RecordingProgress(0, RecordingResult.STOPPED_NO_STORAGE_SPACE, ""),
        camera.RecordingState(0, Availability.AVAILABLE, State.INACTIVE, 0),
    ]


def test_a_fault_fills_it(bench: Bench) -> None:
    bench.faults.storage_full = True
    bench.run(0.1)
    assert shoot(bench) is PhotoResult.ERROR_NO_STORAGE_SPACE
    format(bench, user_storage.Format(""))
    assert bench.faults.storage_full is False
    assert shoot(bench) is PhotoResult.PHOTO_SAVED


def test_a_fault_ends_a_recording_which_keeps_what_it_has(bench: Bench) -> None:
    bench.send(camera.SetCameraMode(0, CameraCameraMode.RECORDING))
    bench.send(camera.StartRecording(0))
    bench.run(2.5)
    bench.faults.storage_full = True
    bench.run(1.0)
    progress = bench.of(camera.RecordingProgress)[-1]
    assert progress == camera.RecordingProgress(0, RecordingResult.STOPPED_NO_STORAGE_SPACE, "10000001")
    (media,) = bench.firmware.payload.media
    assert media.describe()["duration"] == 3000  # the third second was begun


def test_a_lapse_outlives_its_deleted_photos(bench: Bench) -> None:
    lapse = camera.SetPhotoMode(
        0,
        camera.CameraPhotoMode.TIME_LAPSE,
        camera.PhotoFormat.RECTILINEAR,
        camera.PhotoFileFormat.JPEG,
        camera.BurstValue.BURST_14_OVER_1S,
        camera.BracketingPreset.PRESET_1EV,
        2.0,
    )
    bench.send(lapse)
    bench.send(camera.TakePhoto(0))
    bench.run(3.0)
    media = bench.firmware.payload.media
    assert media.remove("10000001")
    bench.run(2.0)
    bench.send(camera.StopPhoto(0))
    (left,) = media
    assert [resource.id for resource in left.resources] == ["100000010003.JPG"]
    assert media.used == left.size


def test_monitoring(bench: Bench) -> None:
    state = user_storage.State(PhyState.AVAILABLE, FsState.READY, 0, 1, 2)
    assert bench.send(user_storage.StartMonitoring(2)) == [state, user_storage.Monitor(64_000_000_000)]
    bench.events.clear()
    bench.run(5.0)
    assert len(bench.of(user_storage.Monitor)) == 2
    assert bench.send(user_storage.StopMonitoring()) == [user_storage.State(PhyState.AVAILABLE, FsState.READY, 0, 0, 0)]
    bench.run(5.0)
    assert len(bench.of(user_storage.Monitor)) == 2
    # 0 asks for Parrot's default, a second.
    assert bench.send(user_storage.StartMonitoring(0))[0] == user_storage.State(
        PhyState.AVAILABLE, FsState.READY, 0, 1, 1
    )


@pytest.mark.parametrize(
    ("command", "steps"),
    [
        (user_storage.FormatWithType("films", FormattingType.FULL), tuple(FormattingStep)),
        (
            user_storage.FormatWithType("films", FormattingType.QUICK),
            (FormattingStep.PARTITIONING, FormattingStep.CREATING_FS),
        ),
        (user_storage.Format("films"), (FormattingStep.PARTITIONING, FormattingStep.CREATING_FS)),
    ],
)
def test_formatting(bench: Bench, command: Message, steps: tuple[FormattingStep, ...]) -> None:
    shoot(bench)
    observed = format(bench, command)
    states = [message.file_system_state for message in observed if isinstance(message, user_storage.State)]
    assert states == [FsState.FORMATTING, FsState.READY]
    progress = [message for message in observed if isinstance(message, user_storage.FormatProgress)]
    assert tuple(dict.fromkeys(message.step for message in progress)) == steps
    assert progress[-1] == user_storage.FormatProgress(FormattingStep.CREATING_FS, 100)
    assert user_storage.Info("films", 64_000_000_000) in observed
    assert user_storage.FormatResult(FormattingResult.SUCCESS) in observed
    index = [message.state for message in observed if isinstance(message, mediastore.State)]
    assert index == [MediastoreState.NOT_AVAILABLE, MediastoreState.INDEXING, MediastoreState.INDEXED]
    assert [message for message in observed if isinstance(message, mediastore.Counters)] == [
        mediastore.Counters(-1, -1, -1, -1),
        mediastore.Counters(0, 0, 0, 0),
    ]
    # There is no photo to be had meanwhile, and there is one afterwards.
    available = [message.available for message in observed if isinstance(message, camera.PhotoState)]
    assert available == [Availability.NOT_AVAILABLE, Availability.AVAILABLE]
    assert len(bench.firmware.payload.media) == 0


def test_formatting_is_denied_while_a_camera_writes(bench: Bench) -> None:
    bench.send(camera.TakePhoto(0))
    denied = [user_storage.FormatResult(FormattingResult.DENIED)]
    assert bench.send(user_storage.Format("")) == denied
    bench.run(2.0)
    bench.send(user_storage.Format(""))
    assert bench.send(user_storage.Format("")) == denied
    assert bench.send(camera.TakePhoto(0))[0] == camera.PhotoProgress(0, PhotoResult.ERROR_BAD_STATE, 0, "")


def test_nothing_is_encrypted(bench: Bench) -> None:
    assert bench.send(user_storage.FormatWithEncryption("", "secret", FormattingType.QUICK)) == [
        user_storage.FormatResult(FormattingResult.DENIED)
    ]
    assert bench.send(user_storage.EncryptionPassword("secret", user_storage.PasswordUsage.RECORD)) == [
        user_storage.Decryption(user_storage.PasswordResult.WRONG_USAGE)
    ]
    assert bench.send(user_storage.FormatWithType("", FormattingType(9))) == [
        user_storage.FormatResult(FormattingResult.ERROR)
    ]


def test_an_ai_has_two_places_with_numbers() -> None:
    bench = Bench("ai")
    report = bench.firmware.payload.storage.states_report()
    infos = [message for message in report if isinstance(message, user_storage_v2.Info)]
    first, last = 1 << ListFlags.FIRST, 1 << ListFlags.LAST
    assert infos == [
        user_storage_v2.Info(0, "Internal", 8_000_000_000, first),
        user_storage_v2.Info(1, "SD", 64_000_000_000, last),
    ]
    types = [m.storage_type for m in report if isinstance(m, user_storage_v2.Capabilities)]
    assert types == [user_storage_v2.StorageType.INTERNAL_STORAGE, user_storage_v2.StorageType.REMOVABLE_STORAGE]
    assert bench.send(user_storage_v2.StartMonitoring(1, 1))[1] == user_storage_v2.Monitor(1, 64_000_000_000, 0)
    assert bench.send(user_storage_v2.StartMonitoring(7, 1)) == []
    bench.send(user_storage_v2.FormatWithType(1, "films", user_storage_v2.FormattingType.QUICK))
    bench.run_until(lambda: bool(bench.of(user_storage_v2.FormatResult)))
    assert bench.of(user_storage_v2.FormatResult) == [
        user_storage_v2.FormatResult(1, user_storage_v2.FormattingResult.SUCCESS, 0)
    ]
    states = [m.file_system_state.name for m in bench.of(user_storage_v2.State)]
    assert states == ["READY", "FORMATTING", "READY"]
    assert Bench("4k").send(user_storage_v2.StartMonitoring(0, 1)) == []
