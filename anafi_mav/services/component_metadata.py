"""Component metadata: files that describe parameters and events. No I/O.

Clients load them over MAVLink FTP. general.json names the others with the CRC of each, so that a client that has them
in its cache does not load them again (MAVLink component_metadata.md; schemas in mavlink/mavlink component_metadata).
"""

from __future__ import annotations

import json
import lzma
import re
from collections.abc import Mapping
from typing import Any

from anafi_mav.drone import Identity
from anafi_mav.services.checksum import crc32

GENERAL = "/general.json"
COMPRESSED = ".xz"

XZ_PRESET = 1
"""Effort of the compression, 0 to 9."""


def to_json(document: Mapping[str, Any]) -> bytes:
    """The document as small as JSON can be."""
    return json.dumps(document, separators=(",", ":"), allow_nan=False).encode()


def compress(content: bytes) -> bytes:
    """The content as an .xz file.

    Small decoders, QGroundControl's and MAVSDK's among them, know this checksum only. The preset is quick, because it
    runs while drones are flown: 1 ms for a definition of 45 kB, where the default takes 30 ms to save a tenth.
    """
    return lzma.compress(content, check=lzma.CHECK_CRC32, preset=XZ_PRESET)


def general_file(identity: Identity, others: Mapping[str, tuple[int, bytes]]) -> dict[str, Any]:
    """Return general.json: identity of this component, and the addresses of the other files.

    `others`: path -> (COMP_METADATA_TYPE, content).
    """
    general: dict[str, Any] = {"version": 1, "vendorName": "Parrot", "modelName": identity.model.title}
    for key, text in (("firmwareVersion", identity.firmware), ("hardwareVersion", identity.hardware)):
        if (number := plain_version(text)) is not None:
            general[key] = number
    general["metadataTypes"] = [
        {"type": kind, "uri": uri(path), "fileCrc": crc32(content)} for path, (kind, content) in others.items()
    ]
    return general


def plain_version(text: str | None) -> str | None:
    """Return "1.8.2-rc4" as "1.8.2"; None without three numbers.

    The schema has no room for more.
    """
    found = re.match(r"\d+\.\d+\.\d+(\.\d+)?", text or "")
    return None if found is None else found[0]


def uri(path: str) -> str:
    """Return the address of a file of this component (MAVLink ftp.md §mavlink-ftp-url-scheme)."""
    return f"mftp://{path}"
