"""Readers of a camera definition with the rules of ground stations, from their sources.

QGroundControl VehicleCameraControl.cc, MAVSDK camera_definition.cpp. They read the file alone, as those do.
"""

from __future__ import annotations

import struct
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field

TYPES = {"int32": "i", "uint32": "I", "float": "f"}
"""struct code of the types that are used: QGroundControl, MAVSDK and MAVProxy all know them."""

Value = float


def typed(kind: str, text: str) -> Value:
    """The value as the wire has it. Raises `ValueError` or `struct.error` for a text that the type does not accept."""
    number = float(text) if kind == "float" else int(text)
    (value,) = struct.unpack("<" + TYPES[kind], struct.pack("<" + TYPES[kind], number))
    return float(value)


@dataclass
class Limited:
    """A <parameterrange>."""

    target: str
    condition: str
    options: list[Value]


@dataclass
class Choice:
    """An <option>."""

    text: str
    value: Value
    exclusions: list[str]
    ranges: list[Limited]


@dataclass
class Described:
    """A <parameter>."""

    name: str
    kind: str
    description: str
    default: Value
    is_listed: bool
    options: list[Choice] = field(default_factory=list)
    low: Value | None = None
    high: Value | None = None
    step: Value | None = None


@dataclass
class ReadDefinition:
    """A definition as a ground station holds it."""

    version: int
    vendor: str
    model: str
    parameters: dict[str, Described]

    def hidden(self, values: dict[str, Value]) -> set[str]:
        """Parameters that are excluded by the values (QGroundControl _updateActiveList)."""
        return {
            name
            for one in self.parameters.values()
            for option in one.options
            if option.value == values[one.name]
            for name in option.exclusions
        }

    def options(self, target: str, values: dict[str, Value]) -> list[Value]:
        """Options that QGroundControl and MAVProxy show: those of the first true range, otherwise all."""
        for one in self.parameters.values():
            for option in one.options:
                for limited in option.ranges:
                    if (
                        limited.target == target
                        and option.value == values[one.name]
                        and self._holds(limited.condition, values)
                    ):
                        return limited.options
        return [option.value for option in self.parameters[target].options]

    def options_of_mavsdk(self, target: str, values: dict[str, Value]) -> list[Value]:
        """Options that MAVSDK shows: conditions are unknown, the last range of an option for a target counts.

        Parameters that are excluded or have no control limit nothing (get_possible_options).
        """
        hidden = self.hidden(values)
        allowed: list[Value] = []
        for one in self.parameters.values():
            if not one.is_listed or one.name in hidden:
                continue
            for option in one.options:
                if option.value == values[one.name]:
                    last = {limited.target: limited.options for limited in option.ranges}
                    allowed += last.get(target, [])
        every = [option.value for option in self.parameters[target].options]
        return [value for value in every if value in allowed] if allowed else every

    def _holds(self, condition: str, values: dict[str, Value]) -> bool:
        """QGroundControl _processCondition, for the only operator that is used."""
        for test in condition.split(" AND ") if condition else ():
            name, _, text = test.partition("=")
            if values[name] != typed(self.parameters[name].kind, text):
                return False
        return True


def read_definition(content: bytes) -> ReadDefinition:
    """Read a file. Fails where QGroundControl or MAVSDK would not load it, or would drop a part."""
    root = ET.fromstring(content)
    assert root.tag == "mavlinkcamera"
    head = root.find("definition")
    assert head is not None
    parameters = [_parameter(element) for element in root.findall("parameters/parameter")]
    found = {one.name: one for one in parameters}
    assert len(found) == len(parameters) > 0
    read = ReadDefinition(
        int(head.attrib["version"]), head.findtext("vendor") or "", head.findtext("model") or "", found
    )
    for one in parameters:
        _check(one, read)
    return read


def _parameter(element: ET.Element) -> Described:
    attributes, kind = element.attrib, element.attrib["type"]
    description = element.findtext("description")
    assert description
    assert element.find("updates") is None  # MAVSDK loses the values of the settings in it
    one = Described(
        attributes["name"],
        kind,
        description,
        typed(kind, attributes["default"]),
        attributes.get("control") != "0",
        [_choice(option, kind) for option in element.findall("options/option")],
        *(typed(kind, attributes[name]) if name in attributes else None for name in ("min", "max", "step")),
    )
    assert attributes.keys() <= {*("name", "type", "default", "control", "min", "max", "step", "decimalPlaces", "unit")}
    return one


def _choice(option: ET.Element, kind: str) -> Choice:
    ranges = [
        Limited(
            limited.attrib["parameter"],
            limited.get("condition", ""),
            # The type of the target is known later; its texts are numbers in any case.
            [struct.unpack("<f", struct.pack("<f", float(item.attrib["value"])))[0] for item in limited],
        )
        for limited in option.findall("parameterranges/parameterrange")
    ]
    exclusions = [exclude.text or "" for exclude in option.findall("exclusions/exclude")]
    return Choice(option.attrib["name"], typed(kind, option.attrib["value"]), exclusions, ranges)


def _check(one: Described, read: ReadDefinition) -> None:
    assert 0 < len(one.name) <= 16
    values, texts = [option.value for option in one.options], [option.text for option in one.options]
    if values:
        assert len(set(values)) == len(values)  # MAVSDK find_default: only one may be equal
        assert len(set(texts)) == len(texts)
        assert one.default in values
        assert one.low is None
        assert one.high is None
    else:
        assert one.low is not None
        assert one.high is not None
        assert one.low <= one.default <= one.high
    for option in one.options:
        for name in option.exclusions:
            assert name in read.parameters
            assert name != one.name
        for limited in option.ranges:
            target = read.parameters[limited.target]
            assert limited.options
            assert set(limited.options) <= {other.value for other in target.options}
            for test in limited.condition.split(" AND ") if limited.condition else ():
                name, _, text = test.partition("=")
                assert typed(read.parameters[name].kind, text) in [
                    other.value for other in read.parameters[name].options
                ]
        # What decides over others is a whole number: QGroundControl compares its text (rawValueString).
        if option.exclusions or option.ranges:
            assert one.kind == "int32"
