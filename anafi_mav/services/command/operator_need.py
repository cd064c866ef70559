"""Role that a message needs while a station is the operator; stops of a flight. No I/O.

Every client reads and stops: Hold, Land, Return, pause and disarm. The gimbal is decided by its manager
(MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE). Sticks, setpoints and targets are judged by their services, which know the
centred stick that asks for nothing. All else that changes something needs a role: also a message that is added later.
"""

from __future__ import annotations

from collections.abc import Callable

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import COMMANDS, Access, needed_access
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import EFFECT_OF_MODE, Command, Effect, is_stop_of_flight
from anafi_mav.services.flavours import flavour_of
from anafi_mav.vehicle.operator_control import Need

INPUT_MESSAGES = frozenset(
    {
        dialect.MAVLINK_MSG_ID_MANUAL_CONTROL,
        dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE,
        dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET,
        dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
        dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
        dialect.MAVLINK_MSG_ID_FOLLOW_TARGET,
    }
)
"""Their services ask `input_objection`. So does mode Follow, for the position of a station."""

GIMBAL_MESSAGES = frozenset(
    {
        dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_ATTITUDE,
        dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_PITCHYAW,
        dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_MANUAL_CONTROL,
        dialect.MAVLINK_MSG_ID_MOUNT_CONFIGURE,
        dialect.MAVLINK_MSG_ID_MOUNT_CONTROL,
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    }
)
"""The last one is the place of another system, at which the gimbal may look."""

GIMBAL_COMMANDS = frozenset(
    {
        dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
        dialect.MAV_CMD_DO_MOUNT_CONFIGURE,
        dialect.MAV_CMD_DO_MOUNT_CONTROL,
        dialect.MAV_CMD_DO_SET_ROI_LOCATION,
        dialect.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET,
        dialect.MAV_CMD_DO_SET_ROI_SYSID,
        dialect.MAV_CMD_DO_SET_ROI_NONE,
        dialect.MAV_CMD_DO_SET_ROI,
    }
)
"""Those that turn the aircraft too are flight tasks, and refused as such by `operator_refusal_of`."""

ACKNOWLEDGEMENTS = frozenset({dialect.MAVLINK_MSG_ID_COMMAND_ACK})


def need_of(inbound: Inbound, action_of: Callable[[Inbound], Command | None]) -> Need:
    """Return the role that a message needs.

    `action_of` decodes a COMMAND_LONG or COMMAND_INT that changes something; None for a query, and for a command that
    the component does not have.
    """
    id = inbound.id
    if id in COMMANDS:
        command = action_of(inbound)
        free = command is None or command.id in GIMBAL_COMMANDS or command.is_stop_of_flight
        return Need.NOTHING if free else Need.COMMAND
    if id == dialect.MAVLINK_MSG_ID_SET_MODE:
        return Need.COMMAND if stop_of(inbound, action_of) is None else Need.NOTHING
    if id in INPUT_MESSAGES or id in GIMBAL_MESSAGES or id in ACKNOWLEDGEMENTS:
        return Need.NOTHING
    return Need.NOTHING if needed_access(inbound.message) is Access.OBSERVE else Need.COMMAND


def stop_of(inbound: Inbound, action_of: Callable[[Inbound], Command | None]) -> Effect | None:
    """Return the effect of a command or SET_MODE that stops the flight; None for others.

    `action_of` as in `need_of`.
    """
    id = inbound.id
    if id in COMMANDS:
        command = action_of(inbound)
        if command is None or command.id in GIMBAL_COMMANDS or not command.is_stop_of_flight:
            return None
        return command.effect
    if id == dialect.MAVLINK_MSG_ID_SET_MODE:
        mode = flavour_of(inbound.channel).mode_of_number(inbound.message.custom_mode)
        return None if mode is None or not is_stop_of_flight(EFFECT_OF_MODE[mode], mode) else EFFECT_OF_MODE[mode]
    return None
