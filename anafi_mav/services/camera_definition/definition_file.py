"""The camera definition as a file: MAVLink's XML format. No I/O.

MAVLink camera_def.md. What the readers of the format require beyond it: a default for each parameter, which must be one
of its options (MAVSDK camera_definition.cpp); one option at least (QGroundControl VehicleCameraControl.cc).

It has no <updates>: every changed value is sent to all clients. MAVSDK drops the named values when it reads the setting
and requests them after the next write only (camera_definition.cpp set_setting).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import NamedTuple

from anafi_mav.services.camera_definition.camera_setting import Option
from anafi_mav.services.camera_definition.catalogue import Catalogue, CatalogueEntry, Offers, Restriction
from anafi_mav.services.camera_definition.param_ext_codec import ExtType
from anafi_mav.services.checksum import crc32

VENDOR = "Parrot"


class DefinitionFile(NamedTuple):
    """A definition file and the version by which clients know it."""

    content: bytes
    version: int


MAX_KEPT = 16
"""Definitions that are kept."""

_kept: dict[tuple[str, Offers], DefinitionFile] = {}
"""Definitions of all drones, by model and offers: a fleet of one model needs one, also after each reconnection."""

_NO_VERSION = b'<definition version="0">'


def definition_file(catalogue: Catalogue, model: str) -> DefinitionFile:
    """Return the definition of a drone's camera.

    `model` is the camera's name in CAMERA_INFORMATION. The version is a hash of the content: QGroundControl and MAVSDK
    keep a file for each name and version for good.
    """
    key = model, catalogue.offers
    found = _kept.get(key)
    if found is None:
        if len(_kept) >= MAX_KEPT:
            _kept.clear()
        found = _kept[key] = _made(catalogue, model)
    return found


def _made(catalogue: Catalogue, model: str) -> DefinitionFile:
    content = _content(catalogue, model)
    version = crc32(content)
    folded = (version ^ version >> 16) & 0xFFFF or 1  # 0 means that there is no definition
    return DefinitionFile(content.replace(_NO_VERSION, b'<definition version="%d">' % folded, 1), folded)


def _content(catalogue: Catalogue, model: str) -> bytes:
    """Return the file with version 0."""
    root = ET.Element("mavlinkcamera")
    head = ET.SubElement(root, "definition", version="0")
    ET.SubElement(head, "model").text = model
    ET.SubElement(head, "vendor").text = VENDOR
    parameters = ET.SubElement(root, "parameters")
    exclusions, restrictions = catalogue.exclusions(), catalogue.restrictions()
    for entry in catalogue.entries:
        element = _parameter(parameters, entry)
        if not entry.options:
            continue
        options = ET.SubElement(element, "options")
        for option in entry.options:
            item = _option(options, "option", option, entry.setting.kind)
            key = (entry.setting.name, option.value)
            if hidden := exclusions.get(key):
                block = ET.SubElement(item, "exclusions")
                for name in hidden:
                    ET.SubElement(block, "exclude").text = name
            _ranges(item, [one for one in restrictions if (one.setting, one.value) == key], catalogue)
    ET.indent(root, " ")
    content: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return content + b"\n"


def _parameter(parent: ET.Element, entry: CatalogueEntry) -> ET.Element:
    setting, kind = entry.setting, entry.setting.kind
    attributes = {"name": setting.name, "type": kind.xml, "default": kind.text(entry.default)}
    if not setting.is_listed:
        attributes["control"] = "0"
    if entry.limits is not None:
        attributes["min"], attributes["max"] = kind.text(entry.limits.low), kind.text(entry.limits.high)
        if entry.limits.step is not None:
            attributes["step"] = kind.text(entry.limits.step)
    if setting.decimals is not None:
        attributes["decimalPlaces"] = str(setting.decimals)
    if setting.unit:
        attributes["unit"] = setting.unit
    element = ET.SubElement(parent, "parameter", attributes)
    ET.SubElement(element, "description").text = setting.title
    return element


def _option(parent: ET.Element, tag: str, option: Option, kind: ExtType) -> ET.Element:
    return ET.SubElement(parent, tag, name=option.text, value=kind.text(option.value))


def _ranges(item: ET.Element, restrictions: list[Restriction], catalogue: Catalogue) -> None:
    if not restrictions:
        return
    block = ET.SubElement(item, "parameterranges")
    for one in restrictions:
        attributes = {"parameter": one.target}
        if one.conditions:
            attributes["condition"] = " AND ".join(
                f"{name}={catalogue[name].setting.kind.text(value)}" for name, value in one.conditions
            )
        limited = ET.SubElement(block, "parameterrange", attributes)
        for option in one.options:
            _option(limited, "roption", option, catalogue[one.target].setting.kind)
