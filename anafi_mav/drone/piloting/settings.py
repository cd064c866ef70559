"""Element piloting: the limits and habits of the drone in flight, as verbs.

Each returns what the drone confirms.
"""

from __future__ import annotations

from anafi_mav.arsdk.messages import ardrone3, obstacle_avoidance, piloting_style
from anafi_mav.arsdk.messages.obstacle_avoidance import Mode as AvoidanceMode
from anafi_mav.arsdk.messages.piloting_style import PilotingStyleStyle
from anafi_mav.drone.piloting.state import PilotingState
from anafi_mav.drone.settings import Commanding, same_as


class PilotingSettings(Commanding[PilotingState]):
    """Settings of the sticks' full deflection, of the fences and of turns."""

    async def set_max_tilt(self, degrees: float) -> float:
        """Set the tilt at full stick, deg."""
        return await self._set(ardrone3.MaxTilt(degrees), ardrone3.MaxTiltChanged, self.state.max_tilt)

    async def set_max_tilt_speed(self, degrees_per_second: float) -> float:
        """Set the highest rate of roll and pitch, deg/s."""
        return await self._set(
            ardrone3.MaxPitchRollRotationSpeed(degrees_per_second),
            ardrone3.MaxPitchRollRotationSpeedChanged,
            self.state.max_tilt_speed,
        )

    async def set_max_altitude(self, metres: float) -> float:
        """Set the ceiling, m above take-off."""
        return await self._set(ardrone3.MaxAltitude(metres), ardrone3.MaxAltitudeChanged, self.state.max_altitude)

    async def set_max_distance(self, metres: float) -> float:
        """Set the radius of the geofence, m."""
        return await self._set(ardrone3.MaxDistance(metres), ardrone3.MaxDistanceChanged, self.state.max_distance)

    async def set_geofence(self, on: bool) -> bool:
        """Switch the geofence.

        It keeps the drone within `max_distance` of `PilotingState.geofence_centre`.
        """
        self._commander.require_feature(self.state.geofence, ardrone3.NoFlyOverMaxDistance.NAME)
        return await self._change(
            ardrone3.NoFlyOverMaxDistance(int(on)),
            ardrone3.NoFlyOverMaxDistanceChanged,
            lambda message: bool(message.shouldNotFlyOver),
            same_as(on),
        )

    async def set_max_vertical_speed(self, metres_per_second: float) -> float:
        """Set the climb and descent at full stick, m/s."""
        return await self._set(
            ardrone3.MaxVerticalSpeed(metres_per_second),
            ardrone3.MaxVerticalSpeedChanged,
            self.state.max_vertical_speed,
        )

    async def set_max_rotation_speed(self, degrees_per_second: float) -> float:
        """Set the turn at full stick, deg/s."""
        return await self._set(
            ardrone3.MaxRotationSpeed(degrees_per_second),
            ardrone3.MaxRotationSpeedChanged,
            self.state.max_rotation_speed,
        )

    async def set_max_horizontal_speed(self, metres_per_second: float) -> float:
        """Set the highest speed over ground, m/s.

        Later generations only; elsewhere it is an argument of a move.
        """
        return await self._set(
            ardrone3.MaxHorizontalSpeed(metres_per_second),
            ardrone3.MaxHorizontalSpeedChanged,
            self.state.max_horizontal_speed,
        )

    async def set_banked_turn(self, on: bool) -> bool:
        """Switch banked turns, in which the drone leans into a turn."""
        self._commander.require_feature(self.state.banked_turn, ardrone3.BankedTurn.NAME)
        return await self._change(
            ardrone3.BankedTurn(int(on)), ardrone3.BankedTurnChanged, lambda message: bool(message.state), same_as(on)
        )

    async def set_style(self, style: PilotingStyleStyle) -> PilotingStyleStyle:
        """Set the frame of the sticks: the drone or the direction of the camera."""
        self._commander.require_feature(self.state.style, piloting_style.SetStyle.NAME)
        return await self._change(
            piloting_style.SetStyle(style),
            piloting_style.Style,
            lambda message: PilotingStyleStyle(message.style),
            same_as(style),
        )

    async def set_obstacle_avoidance(self, on: bool) -> bool:
        """Switch obstacle avoidance; `PilotingState.avoidance` reports if it can work now. Ai only."""
        self._commander.require_feature(self.state.avoidance, obstacle_avoidance.SetMode.NAME)
        return await self._change(
            obstacle_avoidance.SetMode(AvoidanceMode.STANDARD if on else AvoidanceMode.DISABLED),
            obstacle_avoidance.Status,
            lambda message: message.mode == AvoidanceMode.STANDARD,
            same_as(on),
        )
