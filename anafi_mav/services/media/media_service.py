"""The drone's media as folders of the camera component's FTP."""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav.services.files import Folder
from anafi_mav.services.media.media_folder import MediaFolder
from anafi_mav.services.media.thumbnail_folder import ThumbnailFolder
from anafi_mav.services.service import Host, Service


class MediaService(Service):
    """Shows `/media/<day>/<file>` and `/thumb/<day>/<file>.jpg`."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._media = MediaFolder(host.drone)
        self._thumbnails = ThumbnailFolder(host.drone)

    def folders(self) -> Mapping[str, Folder]:
        return {"/media": self._media, "/thumb": self._thumbnails}

    def link_down(self) -> None:
        self._thumbnails.clear()
