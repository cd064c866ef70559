"""Component metadata: what parameters and events mean, as files that a ground station loads over MAVLink FTP.

I/O-free: makes the files. general.json names the others with the CRC of each, so that a client that has them in its
cache does not load them again (MAVLink component_metadata.md; schemas in mavlink/mavlink component_metadata).
"""

from __future__ import annotations

import json
import lzma
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from anafi_mav.drone import Identity
from anafi_mav.services.parameter.parameter import Parameter, limits_of
from anafi_mav.services.parameter.parameter_codec import Kind, crc32
from anafi_mav.services.service import Host

GENERAL = "/general.json"
COMPRESSED = ".xz"

PARAMETER_VERSION = 1
"""Of the file's format. The schema says 3, QGroundControl reads 1 and nothing else (CompInfoParam.cc)."""

_TYPES = {Kind.INT8: "Int8", Kind.INT16: "Int16", Kind.INT32: "Int32", Kind.REAL32: "Float"}


def to_json(document: Mapping[str, Any]) -> bytes:
    """The document as small as JSON can be."""
    return json.dumps(document, separators=(",", ":"), allow_nan=False).encode()


def compress(content: bytes) -> bytes:
    """The content as an .xz file. Small decoders, QGroundControl's and MAVSDK's among them, know this checksum only."""
    return lzma.compress(content, check=lzma.CHECK_CRC32)


def parameter_file(parameters: Sequence[Parameter], host: Host) -> dict[str, Any]:
    """parameter.json: every parameter with its meaning; ranges as the drone has told them."""
    return {"version": PARAMETER_VERSION, "parameters": [_described(one, host) for one in parameters]}


def _described(parameter: Parameter, host: Host) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": parameter.name,
        "type": _TYPES[parameter.kind],
        "shortDesc": parameter.short,
        "longDesc": _long(parameter),
        "group": parameter.group,
        "category": "Standard" if parameter.write is not None else "System",
        "rebootRequired": False,
    }
    if parameter.unit:
        entry["units"] = parameter.unit
    if parameter.decimals is not None and not parameter.kind.whole:
        entry["decimalPlaces"] = parameter.decimals
    if parameter.step is not None:
        entry["increment"] = parameter.step
    if parameter.default is not None:
        entry["default"] = parameter.default
    if parameter.values:
        entry["values"] = [{"value": value, "description": what} for value, what in parameter.values.items()]
    elif (limits := limits_of(parameter, host)) is not None:
        for key, limit in zip(("min", "max"), limits, strict=True):
            if math.isfinite(limit):
                entry[key] = limit
    if parameter.volatile:
        entry["volatile"] = True
    if parameter.write is None:
        entry["readOnly"] = True
    return entry


def _long(parameter: Parameter) -> str:
    sentences = [parameter.long] if parameter.long else []
    if parameter.native:
        sentences.append(f"The same as {parameter.native}.")
    return " ".join(sentences)


def general_file(identity: Identity, others: Mapping[str, tuple[int, bytes]]) -> dict[str, Any]:
    """general.json: who this is, and where the other files are. `others`: path -> (COMP_METADATA_TYPE, content)."""
    general: dict[str, Any] = {"version": 1, "vendorName": "Parrot", "modelName": identity.model.title}
    for key, text in (("firmwareVersion", identity.firmware), ("hardwareVersion", identity.hardware)):
        if (number := plain_version(text)) is not None:
            general[key] = number
    general["metadataTypes"] = [
        {"type": kind, "uri": uri(path), "fileCrc": crc32(content)} for path, (kind, content) in others.items()
    ]
    return general


def plain_version(text: str | None) -> str | None:
    """ "1.8.2-rc4" as "1.8.2", which is what the schema has room for; None when there are no three numbers."""
    found = re.match(r"\d+\.\d+\.\d+(\.\d+)?", text or "")
    return None if found is None else found[0]


def uri(path: str) -> str:
    """Where a client finds a file of this component (MAVLink ftp.md §mavlink-ftp-url-scheme)."""
    return f"mftp://{path}"
