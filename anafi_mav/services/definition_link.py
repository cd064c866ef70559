"""The camera definition in effect: from its maker to CAMERA_INFORMATION and the web server."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class DefinitionContent:
    """One camera definition; all empty before the first connection."""

    uri: str = ""
    """Address of the compressed file in the component's MAVLink FTP."""
    version: int = 0
    """Hash of the content; 0: there is no definition."""
    plain: bytes = b""
    """XML."""
    packed: bytes = b""
    """The same, compressed (xz)."""


class DefinitionLink:
    """The definition in effect, and the callbacks for its changes."""

    def __init__(self) -> None:
        self.content = DefinitionContent()
        self._callbacks: tuple[Callable[[], None], ...] = ()

    @property
    def uri(self) -> str:
        """Address of the compressed file in MAVLink FTP; empty before the first connection."""
        return self.content.uri

    @property
    def version(self) -> int:
        """Hash of the content; 0: there is no definition."""
        return self.content.version

    def subscribe(self, callback: Callable[[], None]) -> None:
        """Call `callback` whenever the definition changes, for as long as the component exists."""
        self._callbacks = (*self._callbacks, callback)

    def update(self, content: DefinitionContent) -> None:
        """Announce another definition; nothing happens when it is the same."""
        if content != self.content:
            self.content = content
            for callback in self._callbacks:
                callback()
