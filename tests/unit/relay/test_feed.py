"""Pictures for viewers: packets, timestamps, what is kept for new viewers and what slow ones miss."""

from __future__ import annotations

from collections.abc import Sequence

from anafi_mav.arsdk.video.rtp import Packet, decode_packet
from anafi_mav.arsdk.video.rtp_h264 import Picture, PictureReceiver
from anafi_mav.relay import feed as feed_module
from anafi_mav.relay.admission import MAX_ENTRY_WAIT, MAX_WAITING, RESUME_BELOW
from anafi_mav.relay.feed import (
    BURST_STEP,
    MAX_KEPT_PICTURES,
    Feed,
    FeedReader,
    is_entry,
)

SPS, PPS = bytes.fromhex("6742c01e95a0280f68"), bytes.fromhex("68ce3c80")
IDR, SLICE, LARGE = b"\x65" + bytes(50), b"\x41" + bytes(20), b"\x41" + bytes(3000)
RECOVERY = bytes((6, 6, 1, 0x80))
STEP = 3000
"""90 kHz for 30 pictures a second."""


def picture(timestamp: int, *units: bytes, complete: bool = True) -> Picture:
    return Picture(timestamp, units, None, complete)


def packets(datagrams: Sequence[bytes]) -> list[Packet]:
    found = [decode_packet(datagram) for datagram in datagrams]
    assert None not in found
    return [one for one in found if one is not None]


def units(datagrams: Sequence[bytes]) -> list[tuple[bytes, ...]]:
    """The pictures as a viewer receives them."""
    receiver = PictureReceiver()
    return [one.units for datagram in datagrams for one in receiver.receive(datagram, 0.0)]


def playing(count: int, *, key_every: int = 30) -> tuple[Feed, float]:
    """A feed after so many pictures, and the time of the next."""
    feed = Feed(0xABCD, 65535, 0)
    for number in range(count):
        entry = number % key_every == 0
        feed.add(picture(number * STEP, *((SPS, PPS, IDR) if entry else (SLICE,))), 10.0 + number / 30)
    return feed, 10.0 + count / 30


def test_picture_is_packed_into_numbered_packets() -> None:
    feed = Feed(0xABCD, 65535, 1000)
    first = feed.add(picture(5000, SPS, PPS, IDR), 10.0)
    second = feed.add(picture(5000 + STEP, LARGE), 10.0 + 1 / 30)
    assert first is not None
    assert second is not None
    (one,) = packets(first.datagrams)
    assert (one.sequence, one.timestamp, one.ssrc, one.payload_type, one.marker) == (65535, 1000, 0xABCD, 96, True)
    rest = packets(second.datagrams)
    assert [(p.sequence, p.timestamp, p.marker) for p in rest] == [
        (0, 4000, False), (1, 4000, False), (2, 4000, True),
    ]  # fmt: skip
    assert units([*first.datagrams, *second.datagrams]) == [(SPS, PPS, IDR), (LARGE,)]
    assert all(len(datagram) <= 1400 for datagram in second.datagrams)
    assert (first.is_entry, second.is_entry) == (True, False)


def test_entry_without_parameter_sets_gets_them() -> None:
    feed = Feed(1, 0, 0)
    feed.set_parameters(SPS, PPS)
    packed = feed.add(picture(0, IDR), 10.0)
    assert packed is not None
    assert units(packed.datagrams) == [(SPS, PPS, IDR)]
    other = SPS[:-1] + b"\x69"
    feed.add(picture(STEP, other, PPS, IDR), 10.1)
    feed.set_parameters(SPS, PPS)  # what the pictures say counts
    assert feed.sps == other


def test_recovery_point_is_an_entry() -> None:
    assert is_entry([RECOVERY, SLICE])
    assert is_entry([SPS, PPS, IDR])
    assert not is_entry([bytes((6, 5, 1, 0x80)), SLICE])
    feed = Feed(1, 0, 0)
    damaged = feed.add(picture(0, SPS, PPS, IDR, complete=False), 10.0)
    assert damaged is not None
    assert not damaged.is_entry
    assert not feed.kept
    assert feed.add(picture(STEP), 10.1) is None
    assert feed.counts == {"pictures": 1, "incomplete": 1, "empty": 1}


def test_timestamps_go_on_after_a_restart_of_the_drones_clock() -> None:
    feed = Feed(1, 0, 0xFFFFFFFF - STEP + 1)
    times = []
    for at, timestamp in ((10.0, 700), (10.0 + 1 / 30, 700 + STEP), (12.0, 900_000_000), (12.1, 900_009_000)):
        packed = feed.add(picture(timestamp, SLICE), at)
        assert packed is not None
        times.append(packed.timestamp)
    # From the second to the third picture 1.9667 s passed here, which is 177000 units.
    assert times == [0xFFFFFFFF - STEP + 1, 0, 177000, 186000]


def test_new_viewer_gets_everything_since_the_last_entry() -> None:
    feed, now = playing(34)
    viewer = FeedReader(feed)
    assert viewer.start == (feed.kept[0].sequence, feed.timestamp - 3 * BURST_STEP)
    burst = viewer.begin(now)
    assert units(burst) == [(SPS, PPS, IDR), (SLICE,), (SLICE,), (SLICE,)]
    assert [p.timestamp for p in packets(burst)] == [feed.timestamp - n * BURST_STEP for n in (3, 2, 1, 0)]
    live = feed.add(picture(34 * STEP, SLICE), now)
    assert live is not None
    follows = viewer.take(live, 0, now)
    assert follows is live.datagrams
    numbers = [p.sequence for p in packets([*burst, *follows])]
    assert numbers == [(numbers[0] + n) & 0xFFFF for n in range(5)]


def test_kept_pictures_are_bounded() -> None:
    feed, _ = playing(1)
    for number in range(1, MAX_KEPT_PICTURES):
        feed.add(picture(number * STEP, SLICE), 10.0 + number / 30)
    assert len(feed.kept) == MAX_KEPT_PICTURES
    feed.add(picture(MAX_KEPT_PICTURES * STEP, SLICE), 20.0)
    assert not feed.kept
    feed.add(picture(301 * STEP, SPS, PPS, IDR), 20.1)
    for number in range(2):
        feed.add(picture((302 + number) * STEP, b"\x41" + bytes(feed_module.MAX_KEPT_BYTES // 2)), 20.2 + number / 30)
    assert not feed.kept
    feed.add(picture(305 * STEP, SPS, PPS, IDR), 20.3)
    feed.interrupt()
    assert not feed.kept


def test_slow_viewer_misses_whole_pictures_until_an_entry() -> None:
    feed, now = playing(1)
    viewer = FeedReader(feed)
    got = list(viewer.begin(now))
    waits = {3: MAX_WAITING + 1, 4: MAX_WAITING, 5: RESUME_BELOW + 1, 6: RESUME_BELOW}
    for number in range(1, 12):
        entry = number == 9
        packed = feed.add(picture(number * STEP, *((SPS, PPS, IDR) if entry else (LARGE,))), now + number / 30)
        assert packed is not None
        got += viewer.take(packed, waits.get(number, 0), now + number / 30)
    # Pictures 3 to 5 found it slow, 6 to 8 do not help a decoder.
    assert units(got) == [(SPS, PPS, IDR), (LARGE,), (LARGE,), (SPS, PPS, IDR), (LARGE,), (LARGE,)]
    numbers = [p.sequence for p in packets(got)]
    assert numbers == [(numbers[0] + n) & 0xFFFF for n in range(len(got))]
    assert viewer.counts == {"pictures": 6, "dropped pictures": 6}
    assert viewer.packets == len(got)
    assert viewer.octets == sum(len(one) - 12 for one in got)


def test_viewer_of_a_stream_without_entries_begins_after_a_wait() -> None:
    feed, viewer_units, got = Feed(1, 0, 0), [], []
    feed.set_parameters(SPS, PPS)
    viewer = FeedReader(feed)
    assert viewer.start is None
    assert viewer.begin(10.0) == []
    for number in range(70):
        now = 10.0 + number / 30
        packed = feed.add(picture(number * STEP, SLICE), now)
        assert packed is not None
        got += viewer.take(packed, 0, now)
        if got and not viewer_units:
            viewer_units = units(got)
            assert now - 10.0 >= MAX_ENTRY_WAIT > now - 10.0 - 1 / 30
    assert viewer_units == [(SPS, PPS, SLICE)]
    numbers = [p.sequence for p in packets(got)]
    assert numbers == [(numbers[0] + n) & 0xFFFF for n in range(len(got))]


def test_viewer_that_missed_one_packet_begins_with_the_parameter_sets() -> None:
    """The packet of the parameter sets then has the number of the one that it missed."""
    feed = Feed(1, 0, 0)
    feed.set_parameters(SPS, PPS)
    viewer = FeedReader(feed)
    viewer.begin(10.0)
    first = feed.add(picture(0, SLICE), 10.0)
    assert first is not None
    assert viewer.take(first, 0, 10.0) == ()
    later = feed.add(picture(90 * STEP, SLICE), 13.0)
    assert later is not None
    got = viewer.take(later, 0, 13.0)
    assert units(got) == [(SPS, PPS, SLICE)]
    assert [one.sequence for one in packets(got)] == [0, 1]


def test_sender_report_names_the_time_of_the_stream() -> None:
    feed, _ = playing(31)
    report = feed.report(11.0 + 0.5, 1_700_000_000.25, packets=(1 << 32) + 7, octets=9)
    # The newest picture came at 11.0 with timestamp 90000; half a second is 45000.
    assert (report.timestamp, report.time, report.packets, report.octets) == (135000, 1_700_000_000_250_000, 7, 9)
    feed.add(picture(31 * STEP, SLICE), 11.0 + 1 / 30, 11.0 + 1 / 30 - 0.1)
    # One of 93000 that was taken a tenth of a second before it arrived, 0.5667 s before the report.
    assert feed.report(11.5, 0.0, packets=0, octets=0).timestamp == 93000 + 51000


def test_description_names_parameter_sets() -> None:
    feed, _ = playing(1)
    text = feed.description("alpha", "alpha visible", "anafi-mav", "video").decode()
    assert "a=fmtp:96 packetization-mode=1;profile-level-id=42c01e;sprop-parameter-sets=Z0LAHpWgKA9o,aM48gA==" in text
    assert "i=alpha visible\r\na=control:video\r\n" in text
