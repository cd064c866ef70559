"""Pictures from the drone's events about photos: times, numbers, and what is lost."""

from __future__ import annotations

import pytest

from anafi_mav.drone.payload.camera_state import CaptureProgress, CaptureUpdate
from anafi_mav.services.camera.shot_tracker import LOST, MOST, UNSAVED, CapturedShot, ShotTracker, named

STARTED, TAKEN, SAVED, ENDED, FAILED = (
    CaptureProgress.STARTED,
    CaptureProgress.TAKEN,
    CaptureProgress.SAVED,
    CaptureProgress.ENDED,
    CaptureProgress.FAILED,
)


def feed(tracker: ShotTracker, *events: tuple[float, CaptureProgress, int | None]) -> list[CapturedShot]:
    """Events of (time, progress, count); the pictures that they complete."""
    return [
        shot for at, progress, count in events for shot in tracker.receive(CaptureUpdate(0, progress, count=count), at)
    ]


def saved(media: str, count: int | None = None, *, is_last: bool = False) -> CaptureUpdate:
    return CaptureUpdate(0, SAVED, media, count=count, is_last=is_last)


def test_single_photo_has_the_time_of_its_shutter() -> None:
    tracker = ShotTracker()
    assert feed(tracker, (1.0, STARTED, None), (1.1, STARTED, None), (1.2, TAKEN, 1)) == []
    assert tracker.pending == (1.2,)
    assert feed(tracker, (1.6, SAVED, 1)) == [CapturedShot(1, 1, 1.2, True)]
    assert feed(tracker, (1.6, ENDED, None), (1.7, SAVED, 1)) == []  # the same report again
    assert feed(tracker, (2.0, STARTED, None), (2.1, TAKEN, 1), (2.5, SAVED, 1)) == [CapturedShot(2, 1, 2.1, True)]


def test_shutter_of_a_single_photo_that_is_reported_twice_is_one_picture() -> None:
    tracker = ShotTracker()
    for at, progress in ((1.0, STARTED), (1.2, TAKEN), (1.3, TAKEN)):
        assert tracker.receive(CaptureUpdate(0, progress), at, 1) == []
    assert tracker.receive(saved("a", is_last=True), 1.6, 1) == [CapturedShot(1, 1, 1.2, True)]


def test_shutter_of_a_time_lapse_that_is_reported_twice_is_one_picture() -> None:
    """Pictures every 3 s; a report may be 1.2 s late, so that two of them are at least 1.8 s apart."""
    tracker = ShotTracker()
    for at, progress in (
        (0.0, STARTED),
        (0.1, TAKEN),
        (1.1, TAKEN),
        (3.1, TAKEN),
        (4.8, TAKEN),
        (7.2, TAKEN),
        (9.1, TAKEN),
    ):
        tracker.receive(CaptureUpdate(0, progress), at, interval=3.0)
    assert (tracker.pending, tracker.taken) == (pytest.approx((0.1, 3.1, 7.2, 9.1)), 4)


def test_shutters_of_a_time_lapse_that_are_reported_together_after_a_gap_are_pictures_each() -> None:
    """The link was bad for some seconds. What follows later is repeated again."""
    tracker = ShotTracker()
    for at, progress in ((0.0, STARTED), (0.1, TAKEN), *((6.5 + 0.1 * n, TAKEN) for n in range(3)), (9.1, TAKEN)):
        tracker.receive(CaptureUpdate(0, progress), at, interval=3.0)
    assert tracker.taken == 4
    tracker.receive(CaptureUpdate(0, TAKEN), 9.3, interval=3.0)
    assert tracker.taken == 4


@pytest.mark.parametrize("interval", [0.0, -1.0])
def test_time_lapse_without_an_interval_counts_each_shutter(interval: float) -> None:
    tracker = ShotTracker()
    for at, progress in ((0.0, STARTED), (0.1, TAKEN), (0.2, TAKEN)):
        tracker.receive(CaptureUpdate(0, progress), at, interval=interval)
    assert tracker.taken == 2


def test_time_lapse_has_no_more_pictures_than_its_time_allows() -> None:
    """Pictures every second look like repeated reports, but no more than 3 are taken in 1.1 s."""
    tracker = ShotTracker()
    for at, progress in ((0.0, STARTED), *((0.1 + 0.1 * n, TAKEN) for n in range(11))):
        tracker.receive(CaptureUpdate(0, progress), at, interval=1.0)
    assert tracker.taken == 3


def test_shutter_without_a_count_is_of_a_photo_that_is_announced_soon_or_of_none() -> None:
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, None))
    assert tracker.receive(saved("a", is_last=True), 1.6) == [CapturedShot(1, 1, 1.2, True)]
    feed(tracker, (2.0, TAKEN, None), (2.2, STARTED, None))  # the events of one photo, in another order
    assert tracker.receive(saved("b", is_last=True), 2.6) == [CapturedShot(2, 1, 2.0, True)]
    feed(tracker, (3.0, TAKEN, None), (9.0, STARTED, None), (9.2, TAKEN, None))  # that of the second photo again
    assert tracker.receive(saved("c", is_last=True), 9.6) == [CapturedShot(3, 1, 9.2, True)]
    feed(tracker, (20.0, TAKEN, None))
    assert tracker.expire(20.1 + LOST, is_series=False) == []
    assert (tracker.is_open, tracker.pending) == (False, ())


def test_burst_with_left_out_reports_spreads_its_times() -> None:
    tracker = ShotTracker()
    shots = feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, 2), (2.0, TAKEN, 4), (2.3, SAVED, 4))
    assert [(shot.number, pytest.approx(shot.at)) for shot in shots] == [(1, 1.1), (2, 1.2), (3, 1.6), (4, 2.0)]


def test_count_wraps_and_older_count_adds_nothing() -> None:
    tracker = ShotTracker()
    shots = feed(
        tracker, (0.0, STARTED, None), (1.0, TAKEN, 100), (2.0, TAKEN, 200), (3.0, TAKEN, 44), (3.5, TAKEN, 40)
    )
    assert shots == []
    assert tracker.taken == 300  # 44 is 300 modulo 256


def test_saved_without_other_reports_is_a_picture() -> None:
    tracker = ShotTracker()
    assert feed(tracker, (5.0, SAVED, None)) == [CapturedShot(1, 1, 5.0, True)]


def test_end_before_saved_loses_nothing() -> None:
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, None), (1.3, ENDED, None))
    assert tracker.expire(1.3 + LOST / 2, is_series=False) == []
    assert feed(tracker, (2.0, SAVED, None)) == [CapturedShot(1, 1, 1.2, True)]
    assert tracker.expire(1.3 + LOST, is_series=False) == []


def test_refused_second_photo_loses_nothing() -> None:
    tracker = ShotTracker()
    refused = CaptureUpdate(0, FAILED, reason="error bad state", is_refused=True)
    feed(tracker, (1.0, STARTED, None))
    assert tracker.receive(refused, 1.1) == []
    feed(tracker, (1.2, TAKEN, 1))
    assert tracker.receive(refused, 1.3) == []
    assert tracker.receive(saved("a", 1), 1.6) == [CapturedShot(1, 1, 1.2, True)]


def test_repeated_media_is_no_picture_of_the_next_photo() -> None:
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, None))
    assert tracker.receive(saved("a", is_last=True), 1.6) == [CapturedShot(1, 1, 1.2, True)]
    assert tracker.receive(saved("a", is_last=True), 1.7) == []
    feed(tracker, (2.0, STARTED, None), (2.2, TAKEN, None))
    assert tracker.receive(saved("a", is_last=True), 2.3) == []
    assert tracker.receive(saved("b", is_last=True), 2.6) == [CapturedShot(2, 1, 2.2, True)]


@pytest.mark.parametrize(("count", "is_last", "ended"), [(1, False, True), (1, False, False), (None, True, False)])
def test_media_without_other_reports_is_a_picture(count: int | None, is_last: bool, ended: bool) -> None:
    """`ended`: the end of the photo before was reported."""
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, count))
    tracker.receive(saved("a", count, is_last=is_last), 1.6)
    if ended:
        feed(tracker, (1.7, ENDED, None))
    assert tracker.receive(saved("b", count, is_last=is_last), 5.0) == [CapturedShot(2, 1, 5.0, True)]
    assert tracker.receive(saved("c", count, is_last=is_last), 90.0) == [CapturedShot(3, 1, 90.0, True)]
    assert tracker.receive(saved("b", count, is_last=is_last), 91.0) == []


def test_pictures_of_a_series_are_one_media() -> None:
    tracker = ShotTracker()
    feed(tracker, (0.0, STARTED, None), (1.0, TAKEN, 1))
    assert tracker.receive(saved("a", 1), 1.3) == [CapturedShot(1, 1, 1.0, True)]
    feed(tracker, (2.0, TAKEN, 2))
    assert tracker.receive(saved("a", 2), 2.3) == [CapturedShot(1, 2, 2.0, True)]
    feed(tracker, (2.4, ENDED, None))
    assert tracker.receive(saved("a", 2), 2.5) == []


@pytest.mark.parametrize(("taken", "count", "number"), [(0, 7, 7), (4, 7, 7), (300, 50, 306), (7, 7, 0)])
def test_series_under_way_at_the_begin_of_a_connection_has_no_pictures_of_before(
    taken: int, count: int, number: int
) -> None:
    """`number` of the picture, by hand: 50 is 306 modulo 256. 0: there is none."""
    tracker = ShotTracker(3)
    tracker.join(0, taken, 10.0)
    assert tracker.receive(saved("a", (taken - 1) % 256), 11.0) == []  # stored late, and taken before
    feed(tracker, (12.0, TAKEN, count))
    expected = [CapturedShot(4, number, 12.0, True)] if number else []
    assert tracker.receive(saved("a", count), 12.3) == expected
    feed(tracker, (14.0, TAKEN, count + 1))
    assert tracker.receive(saved("a", count + 1), 14.3) == [CapturedShot(4, max(number, taken) + 1, 14.0, True)]


def test_series_under_way_without_counts_goes_on_behind_the_pictures_of_before() -> None:
    tracker = ShotTracker()
    tracker.join(0, 5, 10.0)
    feed(tracker, (12.0, TAKEN, None))
    assert tracker.expire(12.0 + UNSAVED, is_series=True) == [CapturedShot(1, 6, 12.0, True)]
    assert tracker.receive(saved("a", is_last=True), 13.0) == []


def test_picture_that_is_never_saved_is_lost() -> None:
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, None), (1.3, ENDED, None))
    assert tracker.expire(1.3 + LOST, is_series=False) == [CapturedShot(1, 1, 1.2, False)]
    assert tracker.expire(2.0 + LOST, is_series=False) == []


def test_lost_picture_is_reported_beside_the_photos_after_it() -> None:
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, None), (1.3, ENDED, None))
    feed(tracker, (3.0, STARTED, None), (3.2, TAKEN, None))
    assert tracker.receive(saved("b"), 3.4) == [CapturedShot(2, 1, 3.2, True)]
    feed(tracker, (3.5, ENDED, None))
    assert tracker.expire(1.3 + LOST, is_series=False) == [CapturedShot(1, 1, 1.2, False)]
    assert tracker.pending == ()


def test_picture_is_lost_when_a_second_photo_begins_after_it() -> None:
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, None), (1.3, ENDED, None))
    assert feed(tracker, (2.0, STARTED, None), (2.2, TAKEN, None), (2.3, ENDED, None)) == []
    assert feed(tracker, (3.0, STARTED, None)) == [CapturedShot(1, 1, 1.2, False)]
    assert tracker.pending == (2.2,)


@pytest.mark.parametrize("count", [1, None])
def test_photo_stored_after_the_next_one_has_begun_is_one_picture(count: int | None) -> None:
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, count), (1.3, ENDED, None), (1.4, STARTED, None))
    assert tracker.receive(saved("a", count), 1.5) == [CapturedShot(1, 1, 1.2, True)]
    assert tracker.receive(saved("a", count), 1.55) == []  # the same report again
    feed(tracker, (1.6, TAKEN, count))
    assert tracker.receive(saved("b", count), 1.8) == [CapturedShot(2, 1, 1.6, True)]
    assert (tracker.capture_of("a"), tracker.capture_of("b")) == (1, 2)
    feed(tracker, (1.9, ENDED, None))
    assert tracker.expire(2.0 + LOST, is_series=False) == []


def test_photos_stored_after_both_were_taken_are_two_pictures() -> None:
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, 1), (1.3, ENDED, None), (1.4, STARTED, None), (1.6, TAKEN, 1))
    shots = [*tracker.receive(saved("a", 1), 1.7), *tracker.receive(saved("b", 1), 1.9)]
    assert sorted(shot.at for shot in shots) == [1.2, 1.6]
    assert all(shot.is_saved for shot in shots)
    assert {tracker.media_of(shot.capture): shot.at for shot in shots} == {"a": 1.2, "b": 1.6}


@pytest.mark.parametrize(
    ("first", "second", "stored"),
    [((1.1, 1.2, 1.3), (1.6,), 1.7), ((1.1,), (1.6, 1.7, 1.8), 1.65)],
    ids=["burst first", "photo first"],
)
def test_burst_and_photo_of_which_the_first_is_stored_late_keep_their_pictures(
    first: tuple[float, ...], second: tuple[float, ...], stored: float
) -> None:
    tracker, shots = ShotTracker(), list[CapturedShot]()
    events = [
        (at, CaptureUpdate(0, TAKEN, count=number)) for taken in (first, second) for number, at in enumerate(taken, 1)
    ]
    events += [(1.0, CaptureUpdate(0, STARTED)), (1.4, CaptureUpdate(0, ENDED)), (1.5, CaptureUpdate(0, STARTED))]
    events += [(stored, saved("a", len(first))), (1.9, CaptureUpdate(0, ENDED)), (2.0, saved("b", len(second)))]
    for at, update in sorted(events, key=lambda event: event[0]):
        shots += tracker.receive(update, at)
    assert all(shot.is_saved for shot in shots)
    taken = {media: [shot.at for shot in shots if shot.capture == tracker.capture_of(media)] for media in "ab"}
    assert taken == {"a": list(first), "b": list(second)}


def test_failure_of_a_photo_that_is_reported_after_the_next_one_has_begun_is_its_own() -> None:
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, 1), (1.3, ENDED, None), (1.4, STARTED, None))
    assert tracker.awaits_capture_before
    assert feed(tracker, (1.5, FAILED, None)) == [CapturedShot(1, 1, 1.2, False)]
    assert not tracker.awaits_capture_before
    feed(tracker, (1.6, TAKEN, 1))
    assert tracker.receive(saved("b", 1), 1.9) == [CapturedShot(2, 1, 1.6, True)]
    assert tracker.expire(2.0 + LOST, is_series=False) == []


def test_last_picture_of_a_series_is_stored_after_the_next_photo_has_begun() -> None:
    tracker = ShotTracker()
    feed(tracker, (0.0, STARTED, None), (1.0, TAKEN, 1))
    tracker.receive(saved("a", 1), 1.3)
    feed(tracker, (2.0, TAKEN, 2), (2.1, ENDED, None), (3.0, STARTED, None), (3.2, TAKEN, 1))
    assert tracker.receive(saved("a", 2), 3.3) == [CapturedShot(1, 2, 2.0, True)]
    assert tracker.receive(saved("b", 1), 3.5) == [CapturedShot(2, 1, 3.2, True)]


def test_photo_of_another_camera_is_one_of_its_own() -> None:
    """The end of the photo before was not reported: a thermal mode has ended it."""
    tracker = ShotTracker()
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, None))
    assert tracker.receive(CaptureUpdate(2, STARTED), 3.0) == []
    tracker.receive(CaptureUpdate(2, TAKEN), 3.2)
    assert tracker.camera == 2
    assert tracker.receive(CaptureUpdate(2, SAVED, "b"), 3.4) == [CapturedShot(2, 1, 3.2, True)]
    assert tracker.expire(3.0 + LOST, is_series=False) == [CapturedShot(1, 1, 1.2, False)]


def test_pictures_of_a_series_that_are_reported_after_its_end_are_its_own() -> None:
    """The drone promises no order between a photo's end and the reports of its pictures."""
    tracker = ShotTracker()
    feed(tracker, (0.0, STARTED, None), (1.0, TAKEN, 1))
    tracker.receive(saved("a", 1), 1.3)
    feed(tracker, (4.0, ENDED, None))
    for number in (2, 3):
        assert feed(tracker, (4.1 * number, TAKEN, number)) == []
        assert tracker.receive(saved("a", number), 4.1 * number + 0.1) == [CapturedShot(1, number, 4.1 * number, True)]
        assert tracker.receive(saved("a", number), 4.1 * number + 0.2) == []
    feed(tracker, (20.0, STARTED, None), (20.2, TAKEN, 1))
    assert tracker.receive(saved("b", 1), 20.4) == [CapturedShot(2, 1, 20.2, True)]
    assert tracker.expire(20.4 + LOST, is_series=False) == []


def test_shutter_of_a_series_that_is_reported_again_after_its_end_begins_no_photo() -> None:
    tracker = ShotTracker()
    feed(tracker, (0.0, STARTED, None), (1.0, TAKEN, 1), (1.3, SAVED, 1))
    feed(tracker, (3.0, TAKEN, 2), (3.1, ENDED, None), (3.2, TAKEN, 2))
    assert feed(tracker, (3.4, SAVED, 2)) == [CapturedShot(1, 2, 3.0, True)]
    assert tracker.expire(3.4 + LOST, is_series=True) == []


def test_picture_of_a_series_that_is_reported_after_the_next_photo_is_its_own() -> None:
    tracker = ShotTracker()
    feed(tracker, (0.0, STARTED, None), (1.0, TAKEN, 1))
    tracker.receive(saved("a", 1), 1.3)
    feed(tracker, (3.1, ENDED, None), (3.2, STARTED, None), (3.4, TAKEN, 1))
    assert tracker.receive(saved("a", 2), 3.5) == [CapturedShot(1, 2, 3.5, True)]
    assert tracker.receive(saved("b", 1), 3.6) == [CapturedShot(2, 1, 3.4, True)]


def state(tracker: ShotTracker, at: float, *, is_active: bool) -> list[CapturedShot]:
    """Report the camera's state, which may arrive before or after its progress."""
    return tracker.receive(CaptureUpdate(0, STARTED if is_active else ENDED, is_state=True), at)


@pytest.mark.parametrize("is_next_active", [False, True])
def test_burst_whose_end_is_reported_before_its_last_shutters_is_one_media(is_next_active: bool) -> None:
    """`is_next_active`: the state has reported the begin of the next one, too."""
    tracker = ShotTracker()
    state(tracker, 1.0, is_active=True)
    feed(tracker, (1.1, STARTED, None), (1.2, TAKEN, 2))
    state(tracker, 1.3, is_active=False)
    if is_next_active:
        state(tracker, 1.35, is_active=True)
    feed(tracker, (1.4, TAKEN, 4))
    shots = tracker.receive(saved("a", 4), 1.5)
    assert [(shot.capture, shot.number, shot.is_saved) for shot in shots] == [(1, n, True) for n in (1, 2, 3, 4)]
    feed(tracker, (1.6, STARTED, None), (1.8, TAKEN, 2), (2.0, TAKEN, 4))
    shots = tracker.receive(saved("b", 4), 2.1)
    assert [(shot.capture, shot.number) for shot in shots] == [(2, n) for n in (1, 2, 3, 4)]
    assert tracker.expire(2.1 + LOST, is_series=False) == []


def test_photo_has_the_time_of_its_shutter_although_the_end_of_the_one_before_is_late() -> None:
    tracker = ShotTracker()
    state(tracker, 1.0, is_active=True)
    feed(tracker, (1.0, STARTED, None), (1.2, TAKEN, 1))
    assert tracker.receive(saved("a", 1), 1.4) == [CapturedShot(1, 1, 1.2, True)]
    feed(tracker, (2.0, STARTED, None))
    state(tracker, 2.05, is_active=False)  # of the first
    state(tracker, 2.1, is_active=True)
    feed(tracker, (2.2, TAKEN, 1))
    assert tracker.receive(saved("b", 1), 2.4) == [CapturedShot(2, 1, 2.2, True)]


def test_failure_before_the_shutter_is_one_lost_picture() -> None:
    tracker = ShotTracker()
    assert feed(tracker, (1.0, FAILED, None)) == []  # a photo that never began
    assert feed(tracker, (1.0, STARTED, None), (1.4, FAILED, None)) == [CapturedShot(1, 1, 1.4, False)]


def test_series_of_newer_feature_is_reported_before_its_media() -> None:
    tracker = ShotTracker()
    feed(tracker, (0.0, STARTED, None), (1.0, TAKEN, None))
    assert tracker.expire(1.0 + UNSAVED, is_series=True) == [CapturedShot(1, 1, 1.0, True)]
    feed(tracker, (3.0, TAKEN, None))
    last = CaptureUpdate(0, SAVED, "media", is_last=True)
    assert tracker.receive(last, 3.2) == [CapturedShot(1, 2, 3.0, True)]
    assert feed(tracker, (5.0, STARTED, None), (5.1, TAKEN, None), (5.4, SAVED, None)) == [
        CapturedShot(2, 1, 5.1, True)
    ]


def test_pictures_that_are_never_saved_are_bounded() -> None:
    tracker = ShotTracker()
    feed(tracker, (0.0, STARTED, None), *((float(at), TAKEN, None) for at in range(1, MOST + 50)))
    assert len(tracker.pending) == MOST
    assert len(feed(tracker, (5000.0, FAILED, None))) == MOST


def test_file_of_a_picture_is_its_jpeg() -> None:
    files = [("a2.DNG", 1), ("a2.JPG", 2), ("a1.JPG", 3), ("a1.DNG", 4), ("a3.DNG", 5)]
    assert named(files) == [3, 2, 5]
