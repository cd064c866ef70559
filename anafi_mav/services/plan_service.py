"""Missions, fences and rally points: the lists are empty, and say so (`plan_lists`)."""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services import plan_lists
from anafi_mav.services.guided import fly_item, is_guided_item
from anafi_mav.services.service import MessageHandler, Service

_ITEMS = (dialect.MAVLINK_MSG_ID_MISSION_ITEM, dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT)


class PlanService(Service):
    """The mission protocol, without a mission."""

    def messages(self) -> Mapping[int, MessageHandler]:
        return dict.fromkeys(
            (
                dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
                dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL,
                dialect.MAVLINK_MSG_ID_MISSION_COUNT,
                dialect.MAVLINK_MSG_ID_MISSION_REQUEST,
                dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
                dialect.MAVLINK_MSG_ID_MISSION_ITEM,
                dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT,
                dialect.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST,
            ),
            self._plan_list,
        )

    def _plan_list(self, inbound: Inbound) -> None:
        if inbound.message.get_msgId() in _ITEMS and is_guided_item(inbound.message):
            fly_item(self.host, inbound)
            return
        for message in plan_lists.answer(inbound.message, inbound.sysid, inbound.compid):
            self.host.send(message, inbound.channel)
