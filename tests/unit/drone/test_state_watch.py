"""Updates of a drone's elements, and the watch that notices them."""

from __future__ import annotations

from anafi_mav.arsdk.messages import common
from anafi_mav.drone import Drone
from anafi_mav.drone.element import StateWatch
from anafi_mav.drone.payload.camera_state import CamerasState, changed
from anafi_mav.drone.status.battery import Battery
from anafi_mav.drone.status.link import Link


def test_watch_notices_the_first_look_and_each_update_of_its_elements() -> None:
    battery, link = Battery(), Link()
    watch = StateWatch(battery, link)
    assert watch.has_changed()
    assert not watch.has_changed()
    message = common.BatteryStateChanged(percent=70)
    battery.set_state(Battery.REDUCERS[common.BatteryStateChanged](battery.state, message))
    assert watch.has_changed()
    assert not watch.has_changed()
    battery.reset()
    assert watch.has_changed()


def test_watch_after_a_reset_notices_the_next_look() -> None:
    watch = StateWatch(Battery())
    assert watch.has_changed()
    watch.reset()
    assert watch.has_changed()


def test_camera_that_reports_a_value_again_keeps_its_state() -> None:
    first = changed(CamerasState(), 0, zoom=1.5)
    assert changed(first, 0, zoom=1.5) is first
    other = changed(first, 0, zoom=1.6)
    assert other is not first
    assert other.cameras[0].zoom == 1.6


def test_camera_that_reports_no_known_value_is_known_afterwards() -> None:
    assert 3 in changed(CamerasState(), 3, zoom=None).cameras


async def test_drones_share_the_table_of_reducers() -> None:
    one, other = Drone("127.0.42.1"), Drone("127.0.42.2")
    assert one._routes is other._routes
    one._handle(common.BatteryStateChanged(percent=70), 0.0)
    assert (one.battery.state.percent, other.battery.state.percent) == (70, None)
