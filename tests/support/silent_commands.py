"""Commands that the simulator answers with no event at once, and why. docs/silence.md is made of this."""

from __future__ import annotations

from typing import NamedTuple

CLASSIC = ("4k", "thermal", "usa")
EVERYWHERE = (*CLASSIC, "ai")


class Silence(NamedTuple):
    names: str
    """Of commands, with blanks between them; a * at the end stands for anything."""
    where: tuple[str, ...]
    """Models, or generations of the Skycontroller."""
    reason: str


DRONES: tuple[Silence, ...] = (
    Silence(
        "ardrone3.Piloting.PCMD gimbal.set_target gimbal.reset_orientation",
        EVERYWHERE,
        "takes effect; what it does is seen in the telemetry, Parrot's XML names no event",
    ),
    Silence(
        "controller_info.barometer",
        EVERYWHERE,
        "takes effect: follow_me.mode_info no longer lists the barometer among what would be better",
    ),
    Silence("thermal.trigg_shutter", ("thermal", "usa"), "takes effect; thermal.xml names no event"),
    Silence(
        "common.Common.AllStates common.Settings.AllSettings",
        EVERYWHERE,
        "answered where the sockets are, with everything the drone has to say (test_sim_drone)",
    ),
    Silence(
        "common.Common.Reboot common.Factory.Reset",
        EVERYWHERE,
        "the drone is gone a second later and comes back (test_drone_poi); nothing is said before that",
    ),
    Silence(
        "logsync.Command.SyncRequest mission.custom_msg_enable mission.custom_msg_disable flight_plan.pre_config",
        EVERYWHERE,
        "Parrot names no event that would answer it",
    ),
    Silence(
        "mission.load mission.activate mission.unload mission.custom_cmd",
        EVERYWHERE,
        "missions are programs of the Air SDK aboard an Ai; none is aboard the simulated one",
    ),
    Silence("common.Common.PowerOff", EVERYWHERE, "of later aircraft (091f, 0920, …)"),
    Silence("ardrone3.PilotingSettings.MaxHorizontalSpeed", EVERYWHERE, "of later aircraft (091f, 0920, …)"),
    Silence("storage.Command.*", EVERYWHERE, "of later aircraft (0920, …); an Ai has user_storage_v2"),
    Silence(
        "camera2.Command.SetAlignmentOffsets camera2.Command.SetThermalPalette camera2.Command.SetThermalRendering "
        "camera2.Command.ZoomGotoPreset camera2.Command.SetUserLfic camera2.Command.NotifyStreamCamera",
        EVERYWHERE,
        "of later aircraft (091f, 0920, …)",
    ),
    Silence(
        "piloting.Command.SetAssistanceMode piloting.Command.StartFlightMode piloting.Command.SetPreferredAttiMode",
        EVERYWHERE,
        "of later aircraft (0925), or a feature (ATTI_MODE) that an Ai's capabilities do not name",
    ),
    Silence("network.Command.SetEthernetIpConfig", EVERYWHERE, "an Ai has no Ethernet"),
    Silence("animation.start_flip", EVERYWHERE, "no ANAFI flips: it is never among the available animations"),
    Silence(
        "follow_me.start_*_anim follow_me.stop_animation follow_me.configure_leash",
        EVERYWHERE,
        "deprecated for feature animation, or of the Bebop 2 (090c); a leash is no mode of an ANAFI",
    ),
    Silence("ardrone3.Piloting.Circle", EVERYWHERE, "of the Disco (090e)"),
    Silence("ardrone3.Piloting.CancelMoveBy", EVERYWHERE, "supported by no aircraft; a moveBy of zeros ends one"),
    Silence(
        "ardrone3.GPSSettings.SetHome ardrone3.GPSSettings.ResetHome common.Controller.isPiloting "
        "common.Network.Disconnect",
        EVERYWHERE,
        "deprecated",
    ),
    Silence(
        "common.Settings.Country common.Settings.AutoCountry common.GPS.ControllerPositionForRun",
        EVERYWHERE,
        "of aircraft before the ANAFI; wifi.set_country is answered",
    ),
    Silence("common.Controller.PeerStateChanged", EVERYWHERE, "from a Skycontroller to its drone; it asks nothing"),
    Silence(
        "camera2.Command.* antiflicker.Command.* connectivity.Command.* developer.Command.* network.Command.* "
        "piloting.Command.* pointnfly.Command.* privacy.Command.*",
        CLASSIC,
        "protobuf, which an ANAFI before the Ai does not speak",
    ),
    Silence("obstacle_avoidance.set_mode user_storage_v2.*", CLASSIC, "the Ai's"),
    Silence("animation.start_super_wide_photo_panorama", CLASSIC, "the Ai's"),
    Silence("thermal.*", ("4k", "ai"), "the model has no thermal camera"),
    Silence("camera.set_alignment_offsets camera.reset_alignment_offsets", ("4k",), "there is one camera"),
    Silence("camera.* user_storage.*", ("ai",), "an Ai speaks camera2 and user_storage_v2 in their place"),
)

CONTROLLERS: tuple[Silence, ...] = (
    Silence(
        "mapper.map_axis_action mapper.map_button_action mapper.set_expo mapper.set_inverted",
        ("3", "4"),
        "sticks and buttons of the simulated controller are mapped as it left the factory",
    ),
    Silence("skyctrl.Settings.Reset skyctrl.Factory.Reset", ("3", "4"), "there is nothing to reset"),
    Silence(
        "devicemanager.Command.StopDiscovery devicemanager.Command.ChangeConnectionParameters",
        ("3", "4"),
        "Parrot names no event that would answer it",
    ),
    Silence(
        "devicemanager.Command.* controllerNetwork.Command.*",
        ("3",),
        "protobuf, which a Skycontroller 3 does not speak",
    ),
)


def reason(name: str, where: str, table: tuple[Silence, ...]) -> str | None:
    """Why a command is silent on a model or controller; None: it is not in the table."""
    for silence in table:
        if where in silence.where and any(_fits(name, pattern) for pattern in silence.names.split()):
            return silence.reason
    return None


def _fits(name: str, pattern: str) -> bool:
    head, star, tail = pattern.partition("*")
    return name == pattern if not star else name.startswith(head) and name.endswith(tail)
