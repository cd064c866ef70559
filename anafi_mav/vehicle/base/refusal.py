"""Refusals with their reason: the error of a request that was understood."""

from __future__ import annotations

from anafi_mav import texts
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, Disconnected
from anafi_mav.texts import OperatorText, Template


class Refused(AnafiMavError):
    """The gateway refuses a request.

    `lasting`: the request is wrong in itself, not only at this moment.

    The text is `{what} refused: {reason}`, unless `form` is another one of these two fields.
    """

    def __init__(
        self,
        what: OperatorText,
        reason: OperatorText,
        *,
        form: Template = texts.REFUSED,
        lasting: bool = False,
        critical: bool = False,
    ) -> None:
        self.text = form.fill(what=what, reason=reason)
        super().__init__(self.text)
        self.what = what
        self.reason = reason
        self.lasting = lasting
        self.critical = critical


class Unfinished(AnafiMavError):
    """A command was accepted for later, and what it waited for has failed: MAV_RESULT_FAILED."""

    def __init__(self, what: OperatorText, reason: OperatorText) -> None:
        super().__init__(texts.FAILED.fill(what=what, reason=reason))


class Unsupported(Refused):
    """The vehicle has no such command, or not with these parameters: MAV_RESULT_UNSUPPORTED."""

    def __init__(self, what: OperatorText, reason: OperatorText) -> None:
        super().__init__(what, reason, lasting=True)


class NotInControl(Refused):
    """Another station is the operator of the aircraft: MAV_RESULT_NOT_IN_CONTROL."""


class Rejected(CommandRejected):
    """A flight task of the gateway cannot continue; the reason is one of the table."""

    def __init__(self, reason: OperatorText) -> None:
        super().__init__(reason)


class DroneRefused(CommandRejected):
    """The drone does not start the mission that it was commanded to fly."""

    def __init__(self, text: OperatorText) -> None:
        super().__init__(text)


def reason_of(error: AnafiMavError) -> OperatorText:
    """Return the reason of an error, without the subject that a refusal has."""
    return error.reason if isinstance(error, Refused) else texts.from_below(error)


def text_of(error: AnafiMavError) -> OperatorText:
    """Return the whole text of an error."""
    if isinstance(error, CommandTimeout | Disconnected):
        return texts.FAILED.fill(what=texts.FLIGHT_COMMAND, reason=error)
    return error.text if isinstance(error, Refused) else texts.from_below(error)
