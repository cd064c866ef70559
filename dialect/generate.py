"""Generate anafi_mav/mav_enums.py and anafi_mav/mavlink/dialect.py from pymavlink's definitions and our overlay.

pymavlink carries its definitions as XML inside the package and a generator, mavgen, that turns them into a Python
module. mavgen refuses a second definition of a message, so the overlay is merged into copies of the XML files first.
The enums of that module become a module of their own, without mavgen's descriptions, which are most of their size:
`plans` needs the numbers but not the messages, and neither module needs pymavlink at run time. What is the same in all
messages of a class becomes attributes of that class: the gateway makes thousands of messages a second.
Run ``python dialect/generate.py`` to make both modules in place; the build hook does the same for wheels. With
``--c FOLDER`` it writes a set of C headers instead; ``FOLDER/anafi/mavlink.h`` is the one to include.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
import io
import re
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import pymavlink
from pymavlink.generator import mavgen, mavparse

HERE = Path(__file__).resolve().parent
ROOT = "anafi.xml"
"""The dialect itself; it includes pymavlink's files by name."""
OVERLAY = HERE / "overlay.xml"
HOST = "common.xml"
"""The file of pymavlink's that new messages and enums are put into: everything else includes it."""
PACKAGE = HERE.parent / "anafi_mav"
ENUMS = Path("mav_enums.py")
DIALECT = Path("mavlink", "dialect.py")
"""Both modules, in the package."""

BEGIN, END = "\n# enums\n", "\n# message IDs\n"
"""mavgen's comments before and after its enums."""

SENDERS = re.compile(r"\n    def \w+_encode\(")
"""Begin of mavgen's methods that make and send each message, the rest of its module. They are not used, and take more
memory than the messages."""

BASE = """    instance_offset = -1

    def __init__(self, msgId: int, name: str) -> None:
"""
"""In mavgen's class of all messages: what the classes of single messages inherit goes before the constructor."""

SHARED = """    instance_offset = -1

    _payload: Optional[Union[bytes, bytearray]] = None
    _msgbuf = bytearray(b"")
    _crc: Optional[int] = None
    _signed = False
    _link_id: Optional[int] = None
    _instances: Optional[Dict[str, str]] = None

    def __init_subclass__(cls) -> None:
        cls._header = MAVLink_header(cls.id)
        cls._fieldnames = cls.fieldnames
        cls._type = cls.msgname
        cls._instance_field = cls.instance_field
        cls._instance_offset = cls.instance_offset

    def __init__(self, msgId: int, name: str) -> None:
"""

CONSTRUCTOR = re.compile(
    r"        MAVLink_message\.__init__\(self, (MAVLink_\w+_message)\.id, \1\.msgname\)\n"
    r"        self\._fieldnames = \1\.fieldnames\n"
    r"        self\._instance_field = \1\.instance_field\n"
    r"        self\._instance_offset = \1\.instance_offset\n"
)
"""What mavgen sets in each message although it is the same for all messages of the class."""

FOR_READERS = re.compile(
    r'(?<=_message\(MAVLink_message\):\n)    """\n(?:.*\n)*?    """\n\n'
    r"|    (?:fielddisplays|fieldenums|fieldunits)_by_name: Dict\[str, str\] = \{.*\}\n"
    r"|    native_format = .*\n"
    r'|# Define name on the class .*\n# Done .*\nsetattr\(MAVLink_\w+, "name", .*\)\n'
)
"""Description, units, display hints and older name of each message. They are not used, and take a seventh of the memory
of the module. The class of all messages has empty ones."""

ENUMS_HEAD = '''"""MAVLink's enums: numbers, names, and the commands that have a location. Generated, do not edit.

A constant for each entry, and `enums`: {name of the enum: {number: entry}}, as in pymavlink.
"""


class EnumEntry:
    """One entry of an enum."""

    __slots__ = ("has_location", "name")

    def __init__(self, name: str, has_location: bool = False) -> None:
        self.name = name
        self.has_location = has_location


_E = EnumEntry
'''


class OverlayError(Exception):
    """The overlay contradicts pymavlink's definitions, or mavgen refuses the result."""


def generate(package: Path = PACKAGE) -> list[Path]:
    """Write both modules into `package` and return their paths. Raises `OverlayError` and then writes neither."""
    with tempfile.TemporaryDirectory() as name:
        module = Path(name) / "dialect.py"
        _run_mavgen(module, "Python3")
        text = module.read_text(encoding="utf-8")
    enums, dialect = split(text)
    outputs = {package / ENUMS: enums, package / DIALECT: dialect}
    for output, content in outputs.items():
        output.write_text(content, encoding="utf-8")
    return list(outputs)


def split(text: str) -> tuple[str, str]:
    """Return the enums of mavgen's module as a module of their own, and the rest, which imports that one.

    Raises `OverlayError` when mavgen's module is not as expected.
    """
    before, begin, rest = text.partition(BEGIN)
    section, end, after = rest.partition(END)
    if not begin or not end:
        raise OverlayError("mavgen's module has no enums")
    star = "\nfrom anafi_mav.mav_enums import *  # the numbers and names of all enums\n"
    return _enums_module(ast.parse(section)), f"{_with_shared_attributes(before)}{star}{end}{_lightened(after)}"


def _with_shared_attributes(base: str) -> str:
    """Return mavgen's part with the class of all messages, which gives its subclasses what their messages share."""
    before, constructor, after = base.partition(BASE)
    if not constructor:
        raise OverlayError("mavgen writes the class of all messages in another way")
    return f"{before}{SHARED}{after}"


def _lightened(messages: str) -> str:
    """Return mavgen's part with the messages without what each of them sets, without descriptions and senders."""
    messages, count = CONSTRUCTOR.subn("", messages)
    messages, hints = FOR_READERS.subn("", messages)
    begin = SENDERS.search(messages)
    kinds = messages.count("_message(MAVLink_message):")
    if begin is None or count != kinds or hints != 6 * kinds:
        raise OverlayError("mavgen writes its messages in another way")
    return messages[: begin.start()]


def _enums_module(section: ast.Module) -> str:
    """`section` assigns constants (NAME = 3), entries (enums["E"][3] = EnumEntry(...)) and their attributes."""
    constants: list[str] = []
    entries: dict[str, dict[int, str]] = {}
    locations: set[tuple[str, int]] = set()
    for node in section.body:
        if not isinstance(node, ast.Assign):
            continue  # the two classes and the empty table
        match node.targets[0], node.value:
            case ast.Name(id=name), ast.Constant(value=number):
                constants.append(f"{name} = {number}\n")
            case ast.Subscript(value=ast.Name(id="enums"), slice=ast.Constant(value=enum)), _:
                entries[enum] = {}
            case (
                ast.Subscript(value=ast.Subscript(slice=ast.Constant(value=enum)), slice=ast.Constant(value=number)),
                ast.Call(func=ast.Name(id="EnumEntry"), args=[ast.Constant(value=name), *_]),
            ):
                entries[enum][number] = name
            case (
                ast.Attribute(
                    value=ast.Subscript(
                        value=ast.Subscript(slice=ast.Constant(value=enum)), slice=ast.Constant(value=number)
                    ),
                    attr="has_location",
                ),
                ast.Constant(value=True),
            ):
                locations.add((enum, number))
    if not constants or not locations:
        raise OverlayError("mavgen writes its enums in another way")
    lines = [ENUMS_HEAD, *constants, "\nenums: dict[str, dict[int, EnumEntry]] = {\n"]
    for enum, names in entries.items():
        lines.append(f'    "{enum}": {{\n')
        for number, name in names.items():
            location = ", True" if (enum, number) in locations else ""
            lines.append(f'        {number}: _E("{name}"{location}),\n')
        lines.append("    },\n")
    lines.append("}\n")
    return "".join(lines)


def generate_c(folder: Path) -> Path:
    """Write MAVLink's C headers into `folder`, which need not exist; returns the one to include.

    Raises `OverlayError`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _run_mavgen(folder, "C")
    return folder / Path(ROOT).stem / "mavlink.h"


def _run_mavgen(output: Path, language: str) -> None:
    """`output` is a file or a folder, as the language wants it."""
    chatter = io.StringIO()
    with (
        tempfile.TemporaryDirectory() as name,
        contextlib.redirect_stdout(chatter),
        contextlib.redirect_stderr(chatter),
    ):
        root = write_definitions(Path(name))
        options = mavgen.Opts(str(output), wire_protocol=mavparse.PROTOCOL_2_0, language=language, validate=True)
        try:
            done = mavgen.mavgen(options, [str(root)])
        except SystemExit as refusal:  # its argument is the reason
            done = False
            chatter.write(str(refusal))
    if not done or not output.exists():
        raise OverlayError(f"mavgen refused the definitions:\n{chatter.getvalue()}")


def write_definitions(folder: Path) -> Path:
    """Write the root dialect and all it includes, overlaid, into `folder`; returns the root's path."""
    trees = read_definitions()
    merge(trees, ET.parse(OVERLAY))
    for name, tree in trees.items():
        tree.write(folder / name, encoding="utf-8", xml_declaration=True)
    return folder / ROOT


def read_definitions() -> dict[str, ET.ElementTree]:
    """The root dialect and every file of pymavlink's that it includes, by file name."""
    source = Path(pymavlink.__file__).parent / "dialects" / "v20"
    trees = {ROOT: ET.parse(HERE / ROOT)}
    waiting = list(_included(trees[ROOT]))
    while waiting:
        name = waiting.pop()
        if name not in trees:
            trees[name] = ET.parse(source / name)
            waiting.extend(_included(trees[name]))
    return trees


def merge(trees: dict[str, ET.ElementTree], overlay: ET.ElementTree) -> None:
    """Add to `trees` what `overlay` has and they lack. Raises `OverlayError` where both contradict."""
    host = trees[HOST].getroot()
    known = {message.get("name"): message for tree in trees.values() for message in tree.iterfind("messages/message")}
    taken = {message.get("id"): name for name, message in known.items()}
    for message in overlay.iterfind("messages/message"):
        name, id = message.get("name"), message.get("id")
        if taken.get(id, name) != name:
            raise OverlayError(f"message id {id} of {name} belongs to {taken[id]}")
        if name in known:
            _extend_message(known[name], message)
        else:
            _child(host, "messages").append(copy.deepcopy(message))
    for enum in overlay.iterfind("enums/enum"):
        _extend_enum(trees, enum)


def _extend_message(known: ET.Element, wanted: ET.Element) -> None:
    """Append the extension fields that `wanted` has beyond `known`."""
    name = wanted.get("name")
    if known.get("id") != wanted.get("id"):
        raise OverlayError(f"{name} has id {known.get('id')}, not {wanted.get('id')}")
    had, asked = list(_fields(known)), list(_fields(wanted))
    common = min(len(had), len(asked))
    if [entry[:3] for entry in had[:common]] != [entry[:3] for entry in asked[:common]]:
        raise OverlayError(f"{name} is another message in pymavlink")
    missing = asked[len(had) :]
    if not all(extension for _, _, extension, _ in missing):
        raise OverlayError(f"{name} has too few fields in pymavlink")
    if missing and known.find("extensions") is None:
        known.append(ET.Element("extensions"))
    known.extend(copy.deepcopy(element) for _, _, _, element in missing)


def _extend_enum(trees: dict[str, ET.ElementTree], wanted: ET.Element) -> None:
    """Add the entries of `wanted` that no file has; mavgen itself merges an enum that several files declare."""
    name = wanted.get("name")
    declared = [enum for tree in trees.values() for enum in tree.iterfind("enums/enum") if enum.get("name") == name]
    if not declared:
        _child(trees[HOST].getroot(), "enums").append(copy.deepcopy(wanted))
        return
    entries = {entry.get("name"): entry.get("value") for enum in declared for entry in enum.iterfind("entry")}
    for entry in wanted.iterfind("entry"):
        if entry.get("name") not in entries:
            declared[0].append(copy.deepcopy(entry))
        elif entries[entry.get("name")] != entry.get("value"):
            raise OverlayError(f"{entry.get('name')} is {entries[entry.get('name')]} in pymavlink")


def _fields(message: ET.Element) -> Iterator[tuple[str | None, str | None, bool, ET.Element]]:
    """(type, name, whether it is an extension, the element) of each field, in order."""
    extension = False
    for element in message:
        if element.tag == "extensions":
            extension = True
        elif element.tag == "field":
            yield element.get("type"), element.get("name"), extension, element


def _included(tree: ET.ElementTree) -> Iterator[str]:
    return (include.text.strip() for include in tree.iterfind("include") if include.text)


def _child(parent: ET.Element, tag: str) -> ET.Element:
    child = parent.find(tag)
    if child is None:
        raise OverlayError(f"{HOST} has no <{tag}>")
    return child


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes the MAVLink dialect of anafi-mav.")
    parser.add_argument("--c", type=Path, metavar="FOLDER", help="write C headers there, not the Python module")
    folder = parser.parse_args().c
    for path in generate() if folder is None else [generate_c(folder)]:
        sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
