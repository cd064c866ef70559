"""Parrot's message tables, one module per project or feature, in Parrot's words. No I/O.

Importing this package declares all of them. Ids, argument names, types and enum values are facts of Parrot's own
XML (arsdk-xml, in the parrot-olympe wheel) and are compared with it by ``tests/unit/arsdk/messages/test_xml.py``.
A message class is the PascalCase of Parrot's name; arguments keep Parrot's spelling. What the Ai says in protobuf is in
`proto`.
"""

from anafi_mav.arsdk.messages import (
    alarms,
    animation,
    ardrone3,
    battery,
    camera,
    common,
    controller_info,
    drone_manager,
    flight_plan,
    follow_me,
    generic,
    gimbal,
    mapper,
    mediastore,
    mission,
    move,
    obstacle_avoidance,
    piloting_style,
    poi,
    precise_home,
    proto,
    rth,
    skyctrl,
    stereo_vision_sensor,
    thermal,
    user_storage,
    user_storage_v2,
    wifi,
)

__all__ = [
    "alarms",
    "animation",
    "ardrone3",
    "battery",
    "camera",
    "common",
    "controller_info",
    "drone_manager",
    "flight_plan",
    "follow_me",
    "generic",
    "gimbal",
    "mapper",
    "mediastore",
    "mission",
    "move",
    "obstacle_avoidance",
    "piloting_style",
    "poi",
    "precise_home",
    "proto",
    "rth",
    "skyctrl",
    "stereo_vision_sensor",
    "thermal",
    "user_storage",
    "user_storage_v2",
    "wifi",
]
