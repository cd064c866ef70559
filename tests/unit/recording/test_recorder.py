"""The clock of a recorded session."""

from __future__ import annotations

from pathlib import Path

from support.laptop import LaptopClock

from anafi_mav.cli.replay import files_of, read_tlogs
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import Parser, frame, pack
from anafi_mav.mavlink.node import Node
from anafi_mav.recording.recorder import Recorder

BEAT = frame(pack(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)), 0, 255, 190)


class SetClock(LaptopClock):
    """A clock that a person sets, too."""

    set_by = 0.0

    def __init__(self) -> None:
        super().__init__()
        self.time = lambda: 1.7e9 + self.monotonic() + self.slept + self.set_by


async def test_times_of_a_recording_go_on_while_the_computer_is_suspended(tmp_path: Path) -> None:
    """They do not step when its clock is set."""
    clock = SetClock()
    recorder = Recorder(Node(clock=clock), clock, tmp_path, 1_000_000)
    recorder.start()
    (received,) = Parser().receive(BEAT)
    recorder.received(received)
    clock.slept += 3600.0
    recorder.received(received)
    clock.set_by -= 7200.0
    recorder.received(received)
    await recorder.close()
    first, second, third = (entry.time for entry in read_tlogs(files_of(recorder.files.path)[0]))
    assert 3600.0 <= second - first < 3600.1
    assert 0.0 <= third - second < 0.1
