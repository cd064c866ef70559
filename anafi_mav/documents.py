"""Reads files, and YAML written by hand; an error is one line that names the place."""

from __future__ import annotations

import errno
import os
import reprlib
import stat
from pathlib import Path
from typing import Any, BinaryIO

import yaml

from anafi_mav.errors import ConfigError

MAX_FILE_BYTES = 1 << 20
"""A fleet of 250 drones with every key written out is a tenth of this, and so is a scenario of a thousand steps."""

MAX_LINE = 300
"""Characters of a parser's sentence that are passed on."""


def expected(what: str) -> dict[str, Any]:
    """Return the `extra` of a key: the required value, as it reads after the word "expected"."""
    return {"expected": what}


def open_file(path: Path) -> BinaryIO:
    """Open a file for reading.

    Raises `OSError`, also for what is no file: a pipe would be waited for.
    """
    file = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    mode = os.fstat(file).st_mode
    if not stat.S_ISREG(mode):
        os.close(file)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        kind = next((what for is_kind, what in _KINDS if is_kind(mode)), "something else")
        raise OSError(errno.EINVAL, f"expected a file, got {kind}", str(path))
    return os.fdopen(file, "rb")


_KINDS = (
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


def read(path: Path) -> object:
    """The document in the file at `path`, as plain values. Raises `ConfigError`."""
    try:
        with path.open("rb") as file:
            content = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise ConfigError("", f"cannot read {path}: {error.strerror or error}") from error
    if len(content) > MAX_FILE_BYTES:
        raise ConfigError("", f"{path}: expected a file of at most {MAX_FILE_BYTES} bytes")
    return parse(content, str(path))


def parse(text: str | bytes, source: str) -> object:
    """The document in YAML `text`; `source` names it in messages. Raises `ConfigError`."""
    try:
        return yaml.load(text, _Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"{source}, line {mark.line + 1}, column {mark.column + 1}" if mark else source
        raise ConfigError("", f"{where}: {one_line(error.problem or error.context or 'not YAML')}") from error
    except yaml.YAMLError as error:  # characters that YAML does not have: no line, but an offset
        raise ConfigError("", f"{source}: {one_line(str(error))}") from error
    except RecursionError as error:
        raise ConfigError("", f"{source}: lists or mappings inside each other without end") from error


def one_line(text: str) -> str:
    """`text` without line breaks, and not too much of it."""
    return " ".join(text.split())[:MAX_LINE]


class _Loader(yaml.SafeLoader):
    """SafeLoader that refuses a repeated key, and knows the place of a value that is none.

    YAML forbids such a key, PyYAML keeps the last one silently.
    """

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Return the value of a node; a date like 2026-02-31 is none."""
        try:
            return super().construct_object(node, deep=deep)
        except (ValueError, LookupError, AttributeError) as error:  # the latter two of `!!bool x`, `!!timestamp x`
            problem = f"expected a value of type {node.tag.rpartition(':')[2]}, got {_short.repr(node.value)}"
            raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark) from error

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.composer.ComposerError(
                        None, None, f"the key {_short.repr(key.value)} stands twice in one mapping", key.start_mark
                    )
                seen.add(key.value)
        return node

    def construct_scalar(self, node: yaml.ScalarNode | yaml.MappingNode) -> Any:
        """Return the text of a node; half a character, an escape like \\ud800, is none."""
        value = super().construct_scalar(node)
        if isinstance(value, str) and not value.isascii() and any("\ud800" <= one <= "\udfff" for one in value):
            raise yaml.constructor.ConstructorError(None, None, "half a character (surrogate)", node.start_mark)
        return value


_short = reprlib.Repr()
_short.maxstring = 60
