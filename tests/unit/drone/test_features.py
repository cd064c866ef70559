"""What a drone has is what it reported."""

from __future__ import annotations

import pytest
from support.scripted_device import ScriptedDevice
from support.simulated import connected

from anafi_mav.drone.features import Feature, Support

EVERYWHERE = {
    Feature.CAMERA,
    Feature.CAMERA_ZOOM,
    Feature.CAMERA_HDR,
    Feature.GIMBAL,
    Feature.STORAGE,
    Feature.MEDIA,
    Feature.FLIGHT_PLAN,
    Feature.RETURN_HOME,
    Feature.PRECISE_HOME,
    Feature.POI,
    Feature.FOLLOW_ME,
    Feature.ANIMATIONS,
    Feature.PILOTING_STYLE,
    Feature.GEOFENCE,
    Feature.MAGNETOMETER_CALIBRATION,
    Feature.ALERT_SOUND,
}
OLDER = {Feature.CAMERA_STREAMING_MODE}
LOCKS = {Feature.CAMERA_EXPOSURE_LOCK, Feature.CAMERA_WHITE_BALANCE_LOCK}
AI = {
    Feature.GIMBAL_YAW,
    Feature.SECOND_GIMBAL,
    Feature.SECOND_STORAGE,
    Feature.FLIGHT_PLAN_V2,
    Feature.FLIGHT_PLAN_START_AT,
    Feature.OBSTACLE_AVOIDANCE,
}
EXPECTED = {
    "4k": EVERYWHERE | OLDER,
    "thermal": EVERYWHERE | OLDER | LOCKS | {Feature.THERMAL},
    "usa": EVERYWHERE | OLDER | LOCKS | {Feature.THERMAL},
    "ai": EVERYWHERE | LOCKS | AI,
}


@pytest.mark.parametrize("model", EXPECTED)
async def test_the_models(model: str) -> None:
    async with connected(model) as (drone, _):
        has = {feature for feature, support in drone.features.items() if support is not Support.ABSENT}
        assert has == EXPECTED[model]
        assert Support.UNKNOWN not in drone.features.values()
        # It stands on the ground: nothing to look at from there.
        assert drone.features[Feature.POI] is Support.UNAVAILABLE
        assert drone.features[Feature.FOLLOW_ME] is Support.UNAVAILABLE
        assert drone.features[Feature.ANIMATIONS] is Support.UNAVAILABLE
        assert drone.features[Feature.CAMERA] is Support.AVAILABLE
        await drone.close()
        assert set(drone.features.values()) == {Support.UNKNOWN}


async def test_features_of_a_drone_with_few_reports_are_absent() -> None:
    async with ScriptedDevice() as device:
        drone = device.drone()
        await drone.connect()
        assert drone.features[Feature.RETURN_HOME] is Support.AVAILABLE
        assert {f for f, s in drone.features.items() if s is not Support.ABSENT} == {Feature.RETURN_HOME}
        await drone.close()
