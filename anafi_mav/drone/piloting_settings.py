"""Element piloting: the limits and habits of the drone in flight, as verbs. Each returns what the drone confirms."""

from __future__ import annotations

from anafi_mav.arsdk.messages import ardrone3, obstacle_avoidance, piloting_style
from anafi_mav.arsdk.messages.obstacle_avoidance import Mode as AvoidanceMode
from anafi_mav.arsdk.messages.piloting_style import PilotingStyleStyle
from anafi_mav.drone.piloting_state import PilotingState
from anafi_mav.drone.settings import Commanding


class PilotingSettings(Commanding[PilotingState]):
    """What 100 % stick means, where the drone may fly, and how it turns."""

    async def set_max_tilt(self, degrees: float) -> float:
        return await self._set(ardrone3.MaxTilt(degrees), ardrone3.MaxTiltChanged, self.state.max_tilt)

    async def set_max_tilt_speed(self, degrees_per_second: float) -> float:
        """How fast roll and pitch change."""
        return await self._set(
            ardrone3.MaxPitchRollRotationSpeed(degrees_per_second),
            ardrone3.MaxPitchRollRotationSpeedChanged,
            self.state.max_tilt_speed,
        )

    async def set_max_altitude(self, metres: float) -> float:
        """Ceiling above take-off."""
        return await self._set(ardrone3.MaxAltitude(metres), ardrone3.MaxAltitudeChanged, self.state.max_altitude)

    async def set_max_distance(self, metres: float) -> float:
        """Radius of the geofence."""
        return await self._set(ardrone3.MaxDistance(metres), ardrone3.MaxDistanceChanged, self.state.max_distance)

    async def set_geofence(self, on: bool) -> bool:
        """Whether the drone stays within `max_distance`."""
        self._require(self.state.geofence, ardrone3.NoFlyOverMaxDistance.NAME)
        return await self._change(
            ardrone3.NoFlyOverMaxDistance(int(on)),
            ardrone3.NoFlyOverMaxDistanceChanged,
            lambda message: bool(message.shouldNotFlyOver),
        )

    async def set_max_vertical_speed(self, metres_per_second: float) -> float:
        return await self._set(
            ardrone3.MaxVerticalSpeed(metres_per_second),
            ardrone3.MaxVerticalSpeedChanged,
            self.state.max_vertical_speed,
        )

    async def set_max_rotation_speed(self, degrees_per_second: float) -> float:
        return await self._set(
            ardrone3.MaxRotationSpeed(degrees_per_second),
            ardrone3.MaxRotationSpeedChanged,
            self.state.max_rotation_speed,
        )

    async def set_max_horizontal_speed(self, metres_per_second: float) -> float:
        """Speed over ground: firmware of later generations only. Elsewhere it is an argument of a move."""
        return await self._set(
            ardrone3.MaxHorizontalSpeed(metres_per_second),
            ardrone3.MaxHorizontalSpeedChanged,
            self.state.max_horizontal_speed,
        )

    async def set_banked_turn(self, on: bool) -> bool:
        """Whether the drone leans into a turn."""
        self._require(self.state.banked_turn, ardrone3.BankedTurn.NAME)
        return await self._change(
            ardrone3.BankedTurn(int(on)), ardrone3.BankedTurnChanged, lambda message: bool(message.state)
        )

    async def set_style(self, style: PilotingStyleStyle) -> PilotingStyleStyle:
        """Whether the sticks are relative to the drone or to where the camera looks."""
        self._require(self.state.style, piloting_style.SetStyle.NAME)
        return await self._change(
            piloting_style.SetStyle(style), piloting_style.Style, lambda message: PilotingStyleStyle(message.style)
        )

    async def set_obstacle_avoidance(self, on: bool) -> bool:
        """Whether the drone shall fly around obstacles; whether it can now is `PilotingState.avoidance`. Ai only."""
        self._require(self.state.avoidance, obstacle_avoidance.SetMode.NAME)
        return await self._change(
            obstacle_avoidance.SetMode(AvoidanceMode.STANDARD if on else AvoidanceMode.DISABLED),
            obstacle_avoidance.Status,
            lambda message: message.mode == AvoidanceMode.STANDARD,
        )
