"""The part of a mission that is flown now, and the remaining parts. No I/O."""

from __future__ import annotations

from collections.abc import Iterable

from anafi_mav.plans.translation.translate import Cursor, FlightPlanFile, GatewayStep


class Course:
    """The remaining parts of a mission, beginning with the one that is flown.

    The rest that was too long to be laid out at once follows them.
    """

    def __init__(
        self, parts: Iterable[FlightPlanFile | GatewayStep] = (), rest: Cursor | None = None, later: int | None = None
    ) -> None:
        self.parts = [*parts]
        self.rest = rest
        self.later = later
        """The item behind all this, which is not flown without another word."""

    @property
    def over(self) -> bool:
        """Nothing is left that is flown without another word."""
        return not self.parts and self.rest is None

    @property
    def stepped(self) -> bool:
        """The gateway flies some of it, or begins the next file."""
        return len(self.parts) > 1 or self.rest is not None or any(isinstance(part, GatewayStep) for part in self.parts)

    @property
    def following(self) -> int | None:
        """The item behind the part that is flown; None: nothing follows."""
        item = self._first_of(self.parts[1:])
        return self.later if item is None else item

    def part_over(self) -> int | None:
        """The first part is flown. Returns the item that follows without another word."""
        del self.parts[:1]
        return self._first_of(self.parts)

    def end_with_this_part(self) -> None:
        """The drone may fly on with the file that it has; what follows is not begun."""
        self.later = self.following
        self.parts, self.rest = self.parts[:1], None

    def _first_of(self, parts: list[FlightPlanFile | GatewayStep]) -> int | None:
        if not parts:
            return None if self.rest is None else self.rest.item
        return parts[0].item if isinstance(parts[0], GatewayStep) else parts[0].origins[0]
