"""Parrot's protobuf features: the Ai's and the Skycontroller 4's, one module per feature.

Importing this package declares all of them. A message of a service is named as its class: `Command.Configure` of
camera2 is `camera2.Configure`. A message in a message is the path to it: `Event.State.Photo` is `StatePhoto`. Enum
values go without the prefix that repeats the name of their enum. Numbers, types and values are compared with Parrot's
descriptors by ``tests/unit/arsdk/messages/test_protobuf_tables.py``.
"""

from anafi_mav.arsdk.messages.proto import (
    antiflicker,
    backuplink,
    camera2,
    connectivity,
    controller_network,
    developer,
    device_manager,
    logsync,
    microhard,
    network,
    piloting,
    pointnfly,
    privacy,
    storage,
    thermal_rendering,
)

__all__ = [
    "antiflicker",
    "backuplink",
    "camera2",
    "connectivity",
    "controller_network",
    "developer",
    "device_manager",
    "logsync",
    "microhard",
    "network",
    "piloting",
    "pointnfly",
    "privacy",
    "storage",
    "thermal_rendering",
]
