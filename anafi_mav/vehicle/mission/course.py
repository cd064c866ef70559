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
        if not self.parts:
            return None if self.rest is None else self.rest.item
        head = self.parts[0]
        return head.item if isinstance(head, GatewayStep) else head.origins[0]

    @property
    def following(self) -> int | None:
        """The item behind the part that is flown; None: nothing follows."""
        item = self.without_first().first
        return self.later if item is None else item

    def without_first(self) -> Course:
        """Return the course once its first part is flown."""
        return replace(self, parts=self.parts[1:])

    def ending_with_this_part(self) -> Course:
        """Return the course of a drone without a link: its file. The parts behind it do not start."""
        return Course(self.parts[:1], later=self.following)
