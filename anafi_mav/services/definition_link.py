"""Address and version of the camera definition, from its maker to CAMERA_INFORMATION."""

from __future__ import annotations

from collections.abc import Callable


class DefinitionLink:
    """Address and version; empty before the first connection."""

    def __init__(self) -> None:
        self.uri = ""
        self.version = 0
        self._callbacks: tuple[Callable[[], None], ...] = ()

    def subscribe(self, callback: Callable[[], None]) -> None:
        """Call `callback` whenever the definition changes, for as long as the component exists."""
        self._callbacks = (*self._callbacks, callback)

    def update(self, uri: str, version: int) -> None:
        """Announce another definition; nothing happens when it is the same."""
        if (uri, version) != (self.uri, self.version):
            self.uri, self.version = uri, version
            for callback in self._callbacks:
                callback()
