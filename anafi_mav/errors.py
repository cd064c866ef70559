"""The error tree. Every error this package raises on purpose is an `AnafiMavError`.

A leaf says whose fault it is and keeps the facts in attributes, so that a caller can react without
parsing text. Bytes of a peer never raise: they are dropped and counted where they arrive.
"""

from __future__ import annotations


class AnafiMavError(Exception):
    """Root of the tree; catch this to catch everything of ours."""


class LocalProtocolError(AnafiMavError, ValueError):
    """The program asked for what the protocol cannot express: value out of range, wrong state."""


class RemoteProtocolError(AnafiMavError):
    """The peer broke the protocol in a way that ends the exchange.

    An unreadable handshake reply, for example.
    """


class LinkLost(AnafiMavError, ConnectionError):
    """The link to a drone is gone, or could not be made.

    `reason` is one readable clause: "nothing received for 2.5 s", "connection refused by 192.168.42.1:44444".
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Disconnected(LinkLost):
    """A command needs the link to the drone, which is absent or was lost meanwhile."""


class HandshakeRefused(LinkLost):
    """The device refuses the connection.

    `status` is its number for the reason, which Parrot does not explain.
    """

    def __init__(self, where: str, status: int) -> None:
        super().__init__(f"{where} refused the connection (status {status})")
        self.status = status


class WrongAircraft(AnafiMavError):
    """Another aircraft than the wanted one is at an address.

    `serial` is its serial number, empty when it reports none.
    """

    def __init__(self, serial: str, wanted: str) -> None:
        super().__init__(f"the aircraft has serial number {serial or 'unknown'}, expected {wanted}")
        self.serial = serial


class CommandTimeout(AnafiMavError, TimeoutError):
    """The drone did not confirm a command in time.

    ARSDK has no refusal: silence is how a drone says no.

    `command` is Parrot's name of the command, `seconds` how long we waited.
    """

    def __init__(self, command: str, seconds: float) -> None:
        super().__init__(f"the drone did not confirm {command} within {seconds:g} s")
        self.command = command
        self.seconds = seconds


class CommandRejected(AnafiMavError):
    """The drone, or its present state as it reported it, refuses the command.

    `reason` is shown to users.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class NotSupported(AnafiMavError):
    """This drone has no such feature: it did not announce it when it connected.

    `feature` names it.
    """

    def __init__(self, feature: str) -> None:
        super().__init__(f"this drone has no {feature}")
        self.feature = feature


class PlanError(AnafiMavError, ValueError):
    """A flight plan is unusable.

    `source` names the file, `item` the wrong item, counted from 0 (None: no particular item), `problem` is a clause.
    """

    def __init__(self, source: str, problem: str, item: int | None = None) -> None:
        where = f"{source}: " if item is None else f"{source}: item {item}: "
        super().__init__(where + problem)
        self.source = source
        self.item = item
        self.problem = problem


class ConfigError(AnafiMavError, ValueError):
    """The configuration is unusable at `key_path` ("drones[0].sysid") of the file `source`.

    The text names what was expected there.
    """

    def __init__(self, key_path: str, problem: str, source: str = "") -> None:
        super().__init__(": ".join(part for part in (source, key_path, problem) if part))
        self.key_path = key_path
        self.problem = problem
        self.source = source
