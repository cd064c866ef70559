"""Services of an Ai besides its camera.

They are the small protobuf services, obstacle avoidance, and the unmet conditions of a move. Olympe queries most of
these when it connects and waits seconds for those that do not answer. Settings are kept and reported; none of them
changes how the simulated drone flies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from anafi_mav.arsdk.codec.protobuf import Empty
from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import flight_plan, move, obstacle_avoidance
from anafi_mav.arsdk.messages.proto import antiflicker, connectivity, developer, network, piloting, pointnfly, privacy
from anafi_mav.sim.features.wireless import Radio
from anafi_mav.units import clip

HOVERING_ALTITUDES = (1.0, 10.0)
"""m that a take-off may end at. Assumed."""
QUALITY = 5
"""Of the link: 0 to 5."""


class Services:
    """The settings of one Ai's services."""

    def __init__(self, ssid: str) -> None:
        self._radio = Radio(ssid)
        self._antiflicker = antiflicker.Mode.AUTOMATIC
        self._shell = developer.Shell()
        self._airsdk_log = False
        self._policy = network.RoutingPolicy.ALL
        self._bitrate = 0
        self._direct = network.DirectConnectionMode.LEGACY
        self._log_storage = privacy.LogStorage.PERSISTENT
        self._log_persistence = privacy.LogConfigPersistence.PERSISTENT
        self._log_encrypted = False
        self._pairing = privacy.Authorization.ALWAYS
        self._speed_mode = piloting.SpeedMode.NORMAL_SPEED_MODE
        self._hovering_altitude = 1.0
        self._avoidance = obstacle_avoidance.Mode.STANDARD
        self._missing: tuple[int, int] = (-1, -1)
        """Unmet conditions of a move and of a flight plan, as last reported."""

    def handle(self, message: Message) -> list[Message] | None:
        """The answer to a command; None when it belongs to none of these services."""
        handler = _HANDLERS.get(type(message))
        return None if handler is None else list(handler(self, message))

    def lacks(self, fix: bool, calibrated: bool, flying: bool) -> list[Message]:
        """Report the unmet conditions of a move and of a flight plan, if they changed."""
        plan = (not fix) << move.Indicator.DRONE_GPS | (not calibrated) << move.Indicator.DRONE_MAGNETO
        missing = (plan | (not flying) << move.Indicator.DRONE_FLYING, plan)
        if missing == self._missing:
            return []
        self._missing = missing
        return self._lack_report()

    def states_report(self) -> list[Message]:
        """Return the messages of these services in the AllStates answer.

        The other services answer queries only.
        """
        return [
            self._avoidance_report(),
            obstacle_avoidance.Alerts(0),
            *self._lack_report(),
            flight_plan.Capabilities(
                1 << flight_plan.SupportedCapabilities.START_AT | 1 << flight_plan.SupportedCapabilities.START_AT_V2
            ),
        ]

    def _lack_report(self) -> list[Message]:
        moving, flying = (max(0, missing) for missing in self._missing)
        return [move.Info(moving), flight_plan.Info(flying)]

    # -- antiflicker

    def _antiflicker_state(self, default: bool = False) -> Message:
        modes = antiflicker.Capabilities(supported_modes=tuple(antiflicker.Mode)) if default else None
        match self._antiflicker:
            case antiflicker.Mode.DISABLED:
                return antiflicker.State(default_capabilities=modes, disabled=Empty())
            case antiflicker.Mode.AUTOMATIC:
                return antiflicker.State(default_capabilities=modes, automatic=antiflicker.Frequency._50_HZ)
            case antiflicker.Mode._60_HZ:
                return antiflicker.State(default_capabilities=modes, fixed=antiflicker.Frequency._60_HZ)
        return antiflicker.State(default_capabilities=modes, fixed=antiflicker.Frequency._50_HZ)

    def _get_antiflicker(self, m: antiflicker.GetState) -> Iterable[Message]:
        yield self._antiflicker_state(m.include_default_capabilities)

    def _set_antiflicker(self, m: antiflicker.SetMode) -> Iterable[Message]:
        if m.mode in tuple(antiflicker.Mode):
            self._antiflicker = m.mode
        yield self._antiflicker_state()

    # -- developer

    def _developer_state(self) -> Message:
        return developer.State(shell=self._shell, airsdklog=developer.EventAirSdkLog(enabled=self._airsdk_log))

    def _developer(self, m: Message) -> Iterable[Message]:
        match m:
            case developer.EnableShell():
                self._shell = developer.Shell(enabled=True, public_key=m.public_key)
            case developer.DisableShell():
                self._shell = developer.Shell()
            case developer.AirSdkLog():
                self._airsdk_log = m.enable
        yield self._developer_state()

    # -- network

    def _network_state(self, default: bool = False) -> Message:
        modes = (network.DirectConnectionMode.LEGACY, network.DirectConnectionMode.SECURE)
        capabilities = network.Capabilities(
            cellular_min_bitrate=1000, cellular_max_bitrate=10_000, supported_direct_connection_modes=modes
        )
        wlan = network.LinksStatusLinkInfo(
            type=network.LinkType.WLAN, status=network.LinkStatus.RUNNING, quality=QUALITY
        )
        cellular = network.LinksStatusLinkInfo(
            type=network.LinkType.CELLULAR,
            status=network.LinkStatus.DOWN,
            cellular_status=network.CellularStatus.SIM_ABSENT,
        )
        return network.State(
            default_capabilities=capabilities if default else None,
            routing_info=network.RoutingInfo(policy=self._policy, current_link=network.RoutingLink.WLAN),
            global_link_quality=network.GlobalLinkQuality(quality=QUALITY),
            links_status=network.LinksStatus(links=(wlan, cellular)),
            cellular_max_bitrate=network.CellularMaxBitrate(max_bitrate=self._bitrate),
            direct_connection_mode=self._direct,
        )

    def _network(self, m: Message) -> Iterable[Message]:
        match m:
            case network.SetRoutingPolicy() if m.policy in tuple(network.RoutingPolicy):
                self._policy = m.policy
            case network.SetCellularMaxBitrate():
                self._bitrate = 0 if m.max_bitrate <= 0 else min(max(m.max_bitrate, 1000), 10_000)
            case network.SetDirectConnection() if m.mode in tuple(network.DirectConnectionMode):
                self._direct = m.mode
        yield self._network_state(isinstance(m, network.GetState) and m.include_default_capabilities)

    # -- connectivity

    def _connectivity(self, m: Message) -> Iterable[Message]:
        return self._radio.handle(m)

    # -- privacy

    def _privacy_state(self, default: bool = False) -> Message:
        capabilities = privacy.Capabilities(
            supported_log_storage=tuple(privacy.LogStorage),
            supported_log_config_persistence=tuple(privacy.LogConfigPersistence),
            supported_authorizations=tuple(privacy.Authorization),
        )
        return privacy.State(
            default_capabilities=capabilities if default else None,
            log_storage=self._log_storage,
            log_config_persistence=self._log_persistence,
            log_encryption=privacy.LogEncryption(enabled=self._log_encrypted),
            pairing_authorization=privacy.PairingAuthorization(value=self._pairing),
        )

    def _privacy(self, m: Message) -> Iterable[Message]:
        match m:
            case privacy.SetLogMode():
                self._log_storage, self._log_persistence = m.log_storage, m.log_config_persistence
            case privacy.EnableLogEncryption():
                self._log_encrypted = True
            case privacy.DisableLogEncryption():
                self._log_encrypted = False
            case privacy.AuthorizePairing() if m.value in tuple(privacy.Authorization):
                self._pairing = m.value
        yield self._privacy_state(isinstance(m, privacy.GetState) and m.include_default_capabilities)

    # -- pointing and flying, which is not simulated

    def _point(self, m: Message) -> Iterable[Message]:
        yield pointnfly.State(unavailable=pointnfly.StateUnavailable())

    def _execute_point(self, m: Message) -> Iterable[Message]:
        yield pointnfly.Execution(status=pointnfly.ExecutionStatus.FAILED)

    # -- piloting

    def _piloting_state(self) -> Message:
        return piloting.State(
            speed_mode=piloting.SpeedModeValue(value=self._speed_mode),
            takeoff_hovering_altitude=self._hovering_altitude,
        )

    def _piloting(self, m: Message) -> Iterable[Message]:
        match m:
            case piloting.SetSpeedMode() if m.speed_mode in tuple(piloting.SpeedMode):
                self._speed_mode = m.speed_mode
            case piloting.SetTakeoffHoveringAltitude() if m.altitude == m.altitude:
                self._hovering_altitude = clip(m.altitude, *HOVERING_ALTITUDES)
        yield self._piloting_state()

    def _piloting_capabilities(self, m: Message) -> Iterable[Message]:
        low, high = HOVERING_ALTITUDES
        yield piloting.Capabilities(
            speed_modes=tuple(piloting.SpeedMode),
            supported_features=(piloting.Feature.HAND_LAUNCH,),
            takeoff_hovering_altitude_range=piloting.FloatRange(min=low, max=high),
        )

    # -- obstacle avoidance: there are no obstacles

    def _avoid(self, m: obstacle_avoidance.SetMode) -> Iterable[Message]:
        if m.mode in tuple(obstacle_avoidance.Mode):
            self._avoidance = m.mode
        yield self._avoidance_report()

    def _avoidance_report(self) -> Message:
        active = self._avoidance is obstacle_avoidance.Mode.STANDARD
        state = obstacle_avoidance.State.ACTIVE if active else obstacle_avoidance.State.INACTIVE
        return obstacle_avoidance.Status(self._avoidance, state, obstacle_avoidance.Availability.AVAILABLE)


_HANDLERS: dict[type[Message], Callable[[Services, Any], Iterable[Message]]] = {
    antiflicker.GetState: Services._get_antiflicker,
    antiflicker.SetMode: Services._set_antiflicker,
    developer.GetState: Services._developer,
    developer.EnableShell: Services._developer,
    developer.DisableShell: Services._developer,
    developer.AirSdkLog: Services._developer,
    network.GetState: Services._network,
    network.SetRoutingPolicy: Services._network,
    network.SetCellularMaxBitrate: Services._network,
    network.SetDirectConnection: Services._network,
    connectivity.ListRadios: Services._connectivity,
    connectivity.GetState: Services._connectivity,
    connectivity.SetMode: Services._connectivity,
    connectivity.Scan: Services._connectivity,
    connectivity.Configure: Services._connectivity,
    privacy.GetState: Services._privacy,
    privacy.SetLogMode: Services._privacy,
    privacy.EnableLogEncryption: Services._privacy,
    privacy.DisableLogEncryption: Services._privacy,
    privacy.AuthorizePairing: Services._privacy,
    pointnfly.GetState: Services._point,
    pointnfly.Deactivate: Services._point,
    pointnfly.Execute: Services._execute_point,
    piloting.GetState: Services._piloting,
    piloting.GetCapabilities: Services._piloting_capabilities,
    piloting.SetSpeedMode: Services._piloting,
    piloting.SetTakeoffHoveringAltitude: Services._piloting,
    obstacle_avoidance.SetMode: Services._avoid,
}
