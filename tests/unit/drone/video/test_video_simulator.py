"""The video of the simulated models: what its pictures say is what the drone does, and what was set on it."""

from __future__ import annotations

import asyncio
import math
from itertools import pairwise

import pytest
from support.simulated import connected, take_off
from support.world import loopback

from anafi_mav.drone import Drone, PilotingCommand
from anafi_mav.drone.payload.camera_enums import CameraMode
from anafi_mav.drone.payload.gimbal import Aim
from anafi_mav.drone.video.video import VideoFrame, VideoState
from anafi_mav.errors import LinkLost, NotSupported
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.world.faults import Impairment

MODELS = ("4k", "thermal", "usa", "ai")


@pytest.mark.parametrize("model", MODELS)
async def test_the_pictures_say_what_the_drone_does(model: str) -> None:
    async with connected(model, speed=1.0) as pair:
        drone, real = pair
        await take_off(drone)
        await drone.piloting.move_by(0.0, 0.0, -3.0, math.radians(100.0))
        async with drone.video.watching():
            # Standing still, the newest picture and the drone itself say the same.
            said = (await drone.video.next_frame(10.0)).metadata
            frame, pose = drone.video.state.frame, real.pose
            assert frame is not None
            assert frame.attitude is not None
            assert frame.attitude.yaw == pytest.approx(pose.yaw, abs=0.02)
            assert said.ground_distance == pytest.approx(pose.up, abs=0.05)
            assert said.battery_percentage == real.battery.percent
            assert said.flying_state is not None
            assert int(said.flying_state) == int(real.flying_state)
            assert said.location is not None
            assert (said.location.latitude, said.location.longitude) == pytest.approx(real.firmware.place(), abs=1e-6)
            if model == "ai":
                assert said.starfish is not None
                assert said.wifi is None  # so that an Ai reports no goodput
            else:
                assert said.wifi is not None
                assert said.wifi.goodput > 0
            for _ in range(20):
                drone.piloting.pilot(PilotingCommand(roll_deg=8.0))
                frame = await drone.video.next_frame(10.0)
            assert frame.attitude is not None
            assert math.degrees(frame.attitude.roll) == pytest.approx(8.0, abs=1.5)
            drone.piloting.hover()


@pytest.mark.parametrize("model", MODELS)
async def test_camera_settings_are_visible_in_the_pictures(model: str) -> None:
    async with connected(model) as pair, pair.drone.video.watching():
        drone = pair.drone
        await drone.camera.set_mode(CameraMode.RECORDING)
        wide = (await drone.video.next_frame(10.0)).metadata
        await drone.camera.set_zoom_speed(10.0)
        await drone.camera.zoom(2.0)
        near = (await drone.video.next_frame(10.0)).metadata
        assert wide.hfov is not None
        assert near.hfov is not None
        assert math.tan(wide.hfov / 2) / math.tan(near.hfov / 2) == pytest.approx(2.0, rel=0.02)
        assert wide.hfov == pytest.approx(math.radians(68.0 if model == "ai" else 69.0), abs=0.01)
        await drone.gimbal.point(pitch=Aim(-30.0))
        frame = await drone.video.next_frame(10.0)
        assert frame.camera_attitude is not None
        assert math.degrees(frame.camera_attitude.pitch) == pytest.approx(-30.0, abs=1.5)


STREAMS = {
    "4k": ("DefaultVideo",),
    "thermal": ("DefaultVideo", "ParrotThermalVideo", "ParrotThermalBlendedVideo"),
    "usa": ("DefaultVideo", "ParrotThermalVideo", "ParrotThermalBlendedVideo"),
    "ai": ("Front camera", "Disparity map"),
}


@pytest.mark.parametrize("model", MODELS)
async def test_each_camera_has_a_stream_of_its_own(model: str) -> None:
    async with connected(model) as pair:
        drone = pair.drone
        for title in STREAMS[model]:
            async with drone.video.watching(title):
                shown = drone.video.state.shown
                assert shown is not None
                assert shown.title == title
                assert shown.offered == STREAMS[model]
                await drone.video.next_frame(10.0)
        other = "Front camera" if model != "ai" else "DefaultVideo"
        with pytest.raises(NotSupported, match=other):
            async with drone.video.watching(other):
                pass


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_a_bad_link_costs_pictures_and_not_their_order(model: str) -> None:
    """The Ai's metadata is spread over the packets of a picture: of what came in part nothing is reported."""
    async with connected(model) as pair, pair.drone.video.watching():
        frames: list[VideoFrame] = []
        pair.drone.video.subscribe(frames.append)
        pair.real.faults.down = Impairment(loss=0.2, duplicate=0.1, reorder=0.2)
        while len(frames) < 60:
            await pair.drone.video.next_frame(10.0)
        assert all(before.taken < after.taken for before, after in pairwise(frames))
        assert all(90 <= (frame.metadata.battery_percentage or 0) <= 100 for frame in frames)
        assert None not in {frame.metadata.hfov for frame in frames}
        pair.real.faults.down = Impairment()
    assert pair.drone.video.counters["lost"] > 0
    assert pair.drone.video.counters["late"] > 0


async def test_a_drone_that_falls_silent_takes_its_video_with_it() -> None:
    async with connected("4k") as pair:
        drone, real = pair
        async with drone.video.watching():
            await drone.video.next_frame(10.0)
            real.faults.mute = True
            real.faults.on_mute(True)
            await asyncio.wait({drone.lost})
            assert drone.video.state == VideoState()
            real.faults.mute = False
            real.faults.on_mute(False)
            await drone.connect()
            await drone.video.next_frame(10.0)
            assert drone.video.state.playing


@pytest.mark.parametrize(("model", "generation"), [("usa", 3), ("usa", 4), ("ai", 4)])
async def test_the_video_behind_a_skycontroller(model: str, generation: int) -> None:
    spec = DroneSpec(model=model, address=loopback(), http_port=None, rtsp_port=8554, skycontroller=generation)
    async with Simulator([spec], seed=1) as simulator:
        drone, real = Drone(spec.address, rtsp_port=8554, name="behind"), simulator.drones[0]
        await drone.connect()
        async with drone.video.watching():
            said = (await drone.video.next_frame(10.0)).metadata
            assert said.battery_percentage == real.battery.percent
            gone = drone.lost
            assert real.skycontroller is not None
            real.skycontroller.radio = False
            await asyncio.wait({gone})
            assert drone.video.state == VideoState()
        with pytest.raises(LinkLost):
            async with drone.video.watching():
                pass
        await drone.close()


async def test_several_viewers_share_one_session() -> None:
    async with connected("4k") as pair:
        drone, real = pair
        async with drone.video.watching(), drone.video.watching():
            await drone.video.next_frame(10.0)

        entries = [entry for entry in real.log if entry.kind == "video"]
        assert [entry.name for entry in entries] == ["setup", "play", "end"]
        assert entries[-1].args["reason"] == "teardown"
        assert entries[-1].args["pictures"] > 0
