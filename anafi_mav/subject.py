"""The drone that the running code is about, for its log lines.

A gateway sets it in the task that looks after a drone. What that task starts, and what arrives on the sockets that it
opens, inherits it (contextvars), so that code that knows no name of a drone writes log lines with one all the same.
"""

from __future__ import annotations

from contextvars import ContextVar

DRONE: ContextVar[str] = ContextVar("DRONE", default="")
"""Name of the drone; empty where the code is about none in particular."""
