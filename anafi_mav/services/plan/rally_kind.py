"""The list of rally points that clients send: which of its items are good. No I/O."""

from __future__ import annotations

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.services.plan.plan_transfer import PlanKind
from anafi_mav.vehicle.fence.plan_items import PlanFault, PlanItem, place_fault


class RallyKind(PlanKind):
    """The list of rally points."""

    mission_type = dialect.MAV_MISSION_TYPE_RALLY
    name = "rally points"

    def check_item(self, item: PlanItem) -> PlanFault | None:
        if item.command != dialect.MAV_CMD_NAV_RALLY_POINT:
            return PlanFault(dialect.MAV_MISSION_UNSUPPORTED, texts.COMMAND_UNSUPPORTED.fill(command=item.command))
        if not abs(item.z) <= 10_000.0:
            return PlanFault(dialect.MAV_MISSION_INVALID_PARAM7, texts.NOT_HEIGHT.fill(value=item.z))
        return place_fault(item)
