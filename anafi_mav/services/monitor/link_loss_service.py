"""Runs the configured action when all ground stations are lost: see `link_loss`."""

from __future__ import annotations

from typing import NamedTuple

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import Host, Service
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import reason_of
from anafi_mav.vehicle.base.requester import Source
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.link_loss import GcsWatch, LossAction
from anafi_mav.vehicle.vehicle import Landed

RETRY = 10.0
"""s until an action that has failed is tried again: a bad link, or a lost GPS fix, may be better by then."""

LOOK_EVERY = 1.0
"""s between two looks at a drone whose stations were lost while it was not in the air."""


class LaterAction(NamedTuple):
    """An action for a loss that is to be tried later.

    It has failed, a return precedes it, or the drone was not in the air.
    """

    at: float
    """When it is tried next."""
    epoch: int | None
    """Of the vehicle's control: what was commanded since has priority. None: the drone was not in the air."""


class LinkLossService(Service):
    """Watches the heartbeats of ground stations on all channels."""

    is_watch = True

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._later: LaterAction | None = None

    @property
    def _watch(self) -> GcsWatch:
        return self.host.vehicle.stations

    def link_up(self) -> None:
        self._watch.restart(self.host.clock.monotonic())
        self._later = None

    def host_stalled(self, seconds: float) -> None:
        self._watch.stalled(seconds)

    def tick(self, now: float) -> float:
        policy = self.host.vehicle.gcs_loss
        if policy.action is not LossAction.NOTHING and self._watch.expire(now, policy.after):
            self._lost(policy.after)
        elif self._later is not None and now >= self._later.at:
            later, self._later = self._later, None
            is_newest = later.epoch in (None, self.host.vehicle.control.epoch)
            if is_newest and self._watch.lost and policy.action is not LossAction.NOTHING:
                if later.epoch is None and not self._is_in_air:
                    self._later = later._replace(at=now + LOOK_EVERY)
                elif later.epoch is not None and self.host.vehicle.mode is FlightMode.RETURN:
                    self._later = later._replace(at=now + RETRY)
                else:
                    self._lost(policy.after)
        later_at = NEVER if self._later is None else self._later.at
        return later_at if policy.action is LossAction.NOTHING else min(later_at, self._watch.expires_at(policy.after))

    def heartbeat(self, inbound: Inbound) -> None:
        if inbound.message.type == dialect.MAV_TYPE_GCS and self._watch.heard(inbound.now, inbound.channel):
            self.host.text(Severity.NOTICE, texts.STATION_BACK)

    def channel_closed(self, channel: Channel) -> None:
        policy, now = self.host.vehicle.gcs_loss, self.host.clock.monotonic()
        is_certain = channel.ends_with_station and policy.action is not LossAction.NOTHING
        silence = self._watch.closed(channel, now, policy.after, is_certain=is_certain)
        if silence is not None:
            self._lost(round(silence, 1))

    @property
    def _is_in_air(self) -> bool:
        return self.host.vehicle.landed in (Landed.IN_AIR, Landed.TAKEOFF)

    def _lost(self, seconds: float) -> None:
        vehicle, policy = self.host.vehicle, self.host.vehicle.gcs_loss
        if not self._is_in_air:
            self.host.text(Severity.WARNING, texts.STATION_LOST.fill(seconds=seconds))
            # A take-off may be on its way to the drone, or a landing be ended.
            self._later = LaterAction(self.host.clock.monotonic() + LOOK_EVERY, None)
        elif vehicle.mode is FlightMode.RETURN:
            self.host.text(Severity.WARNING, texts.STATION_LOST_STATE.fill(seconds=seconds, state=texts.RETURNS))
            if policy.action is LossAction.LAND:  # the return may end in a hover
                self._later = LaterAction(self.host.clock.monotonic() + RETRY, vehicle.control.epoch)
        elif vehicle.control.leaves_to_pilot(Source.LOST_LINK):
            self.host.text(Severity.WARNING, texts.STATION_LOST_STATE.fill(seconds=seconds, state=texts.MISSION_PILOT))
        else:
            self.host.text(
                Severity.CRITICAL, texts.STATION_LOST_STATE.fill(seconds=seconds, state=policy.action.name.lower())
            )
            self.host.run_action(LinkLossService, self._act(policy.action), is_order=False)

    async def _act(self, action: LossAction) -> None:
        """Carry an action out; one that fails is tried again, unless something newer is commanded."""
        try:
            await self._perform(action)
        except AnafiMavError as error:
            self._report(action, error)
            if action is LossAction.RETURN:  # without a way home, what is left is not to fly on
                try:
                    await self._perform(LossAction.HOLD)
                except AnafiMavError as further:
                    self._report(LossAction.HOLD, further)
            self._later = LaterAction(self.host.clock.monotonic() + RETRY, self.host.vehicle.control.epoch)

    async def _perform(self, action: LossAction) -> None:
        vehicle = self.host.vehicle
        if action is LossAction.HOLD:
            await vehicle.hold(FlightMode.HOLD, Source.LOST_LINK)
        elif action is LossAction.LAND:
            await vehicle.land(Source.LOST_LINK)
        else:
            await vehicle.return_home(Source.LOST_LINK)

    def _report(self, action: LossAction, error: AnafiMavError) -> None:
        text = texts.STATION_LOST_FAILED.fill(action=action.name.lower(), error=reason_of(error))
        self.host.text(Severity.CRITICAL, text)
