"""Addresses of what the gateway serves beside MAVLink, as one client can reach them. No I/O."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from anafi_mav.texts import OperatorText

Uri = Callable[[str | None, str], str | None]
"""(our address as that client's link sees it, path from the root) → URI; None: that client cannot reach it."""


def no_uri(local_host: str | None, path: str) -> str | None:
    """Return None: nothing is served."""
    return None


@dataclass(frozen=True)
class GatewayUris:
    """The gateway's servers, as the services of a system see them."""

    rtsp: Uri = no_uri
    rtsp_hint: OperatorText | None = None
    """Text for a client that gets no URI; None: the server is off."""

    @property
    def has_video(self) -> bool:
        """True when the video server runs."""
        return self.rtsp_hint is not None
