"""backuplink: of it what stands in `pointnfly` and `devicemanager`."""

from __future__ import annotations

from anafi_mav.arsdk.codec.wire import OpenEnum


class EnabledLinks(OpenEnum):
    ALL = 0
    BACKUP_ONLY = 1
    NONE = 2


class LinkState(OpenEnum):
    OFF = 0
    ESTABLISHED = 1
    ACTIVE = 2
