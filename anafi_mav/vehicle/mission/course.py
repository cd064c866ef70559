"""The part of a mission that is flown now, and the remaining parts. No I/O."""

from __future__ import annotations

from dataclasses import dataclass, replace

from anafi_mav.plans.translation.translate import Cursor, FlightPlanFile, GatewayStep


@dataclass(frozen=True)
class Course:
    """The remaining parts of a mission, beginning with the one that is flown."""

    parts: tuple[FlightPlanFile | GatewayStep, ...] = ()
    rest: Cursor | None = None
    """Where the mission continues behind the parts, when it was too long to be laid out at once."""
    later: int | None = None
    """The item behind all this, which is not flown without a client's command."""

    @property
    def over(self) -> bool:
        """True when no remaining part starts by itself."""
        return not self.parts and self.rest is None

    @property
    def stepped(self) -> bool:
        """The gateway flies some of it, or begins the next file."""
        return len(self.parts) > 1 or self.rest is not None or any(isinstance(part, GatewayStep) for part in self.parts)

    @property
    def first(self) -> int | None:
        """The item that the first part begins with; None when no part starts by itself."""
        if self.parts:
            return _item_of(self.parts[0])
        return None if self.rest is None else self.rest.item

    @property
    def following(self) -> int | None:
        """The item behind the part that is flown; None: nothing follows."""
        if len(self.parts) > 1:
            return _item_of(self.parts[1])
        return self.later if self.rest is None else self.rest.item

    def without_first(self) -> Course:
        """Return the course once its first part is flown."""
        return replace(self, parts=self.parts[1:])

    def ending_with_this_part(self) -> Course:
        """Return the course of a drone without a link: its file. The parts behind it do not start."""
        return Course(self.parts[:1], later=self.following)


def _item_of(part: FlightPlanFile | GatewayStep) -> int:
    """Return the item that a part begins with."""
    return part.item if isinstance(part, GatewayStep) else part.origins[0]
