"""The reference of the Python API as Markdown, from signatures, docstrings and the strings behind fields."""

from __future__ import annotations

import ast
import enum
import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import Any

import msgspec
from support.python_api import classes, members

from anafi_mav import drone
from anafi_mav.drone.element import Element

_NAME = re.compile(r"[A-Za-z_][\w.]*")


def _public() -> dict[int, str]:
    """By identity, the exported name of each class; those of `anafi_mav.drone` before those of its `events`."""
    found = {id(getattr(drone.events, name)): name for name in drone.events.__all__}
    found.update({id(getattr(drone, name)): name for name in drone.__all__})
    return found


_PUBLIC = _public()


def _renamed(text: str, scope: dict[str, Any]) -> str:
    """An annotation with the exported names of its classes, which may have others where it is written."""

    def exported(match: re.Match[str]) -> str:
        first, *rest = match[0].split(".")
        value = scope.get(first)
        for part in rest:
            value = getattr(value, part, None)
        return _PUBLIC.get(id(value), match[0]) if value is not None else match[0]

    return _NAME.sub(exported, text)


def _value(value: Any) -> str:
    if isinstance(value, enum.Enum):
        return f"{_PUBLIC.get(id(type(value)), type(value).__name__)}.{value.name}"
    return repr(value)


def _parameters(signature: inspect.Signature, scope: dict[str, Any]) -> Iterator[str]:
    keyword_only = False
    for parameter in signature.parameters.values():
        if parameter.name == "self":
            continue
        if parameter.kind is parameter.VAR_POSITIONAL:
            keyword_only = True
            yield f"*{parameter.name}: {_renamed(parameter.annotation, scope)}"
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not keyword_only:
            keyword_only = True
            yield "*"
        default = "" if parameter.default is parameter.empty else f" = {_value(parameter.default)}"
        yield f"{parameter.name}: {_renamed(parameter.annotation, scope)}{default}"


def function(name: str, member: Any) -> tuple[str, str]:
    """(signature, docstring) of a function, method or property."""
    if isinstance(member, property):
        assert member.fget is not None
        result = _renamed(inspect.signature(member.fget).return_annotation, member.fget.__globals__)
        return f"{name}: {result}", _text(member.fget)
    inner = inspect.unwrap(member)
    signature, scope = inspect.signature(inner), inner.__globals__
    manager = inner is not member  # of all decorators only `asynccontextmanager` is used on public functions
    result = _renamed(signature.return_annotation, scope)
    head = "async with " if manager else "async " if inspect.iscoroutinefunction(inner) else ""
    if manager:
        yielded = result.removeprefix("AsyncIterator[").removesuffix("]")
        result = f" as {yielded}" if yielded != "None" else ""
    else:
        result = f" -> {result}"
    line = f"{head}{name}({', '.join(_parameters(signature, scope))}){result}"
    if len(line) > 100:
        arguments = "".join(f"    {one},\n" for one in _parameters(signature, scope))
        line = f"{head}{name}(\n{arguments}){result}"
    return line, _text(member)


def _text(thing: Any) -> str:
    """Its own docstring, not that of a base class."""
    return (
        inspect.cleandoc(thing.__dict__.get("__doc__") or "")
        if isinstance(thing, type)
        else inspect.getdoc(thing) or ""
    )


def _fields(owner: type) -> Iterator[tuple[str, str, str]]:
    """(name, type or value, meaning) of the annotated fields or the members of a class, from its source."""
    scope = vars(inspect.getmodule(owner))
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
    assert isinstance(tree, ast.ClassDef)
    for statement, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        meaning = ""
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str):
            meaning = " ".join(inspect.cleandoc(after.value.value).split())
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            if "ClassVar" not in ast.unparse(statement.annotation) and not statement.target.id.startswith("_"):
                yield statement.target.id, _renamed(ast.unparse(statement.annotation), scope), meaning
        elif isinstance(statement, ast.Assign) and issubclass(owner, enum.Enum):
            (target,) = statement.targets
            assert isinstance(target, ast.Name)
            yield target.id, ast.unparse(statement.value), meaning


def _table(owner: type) -> str:
    rows = [(name, kind.replace("|", "\\|"), meaning or "–") for name, kind, meaning in _fields(owner)]
    if not rows:
        return ""
    head = "| name | value | meaning |" if issubclass(owner, enum.Enum) else "| field | type | meaning |"
    return f"\n{head}\n|---|---|---|\n" + "".join(f"| `{n}` | `{k}` | {m} |\n" for n, k, m in rows)


def _attribute(owner: type) -> str:
    """`drone.flight_plan` for FlightPlan."""
    return "drone." + re.sub(r"(?<=[a-z])(?=[A-Z])", "_", owner.__name__).lower()


def _section(owner: type) -> str:
    place = f" (`{_attribute(owner)}`)" if issubclass(owner, Element) else ""
    part = f"\n### {owner.__name__}{place}\n\n{_text(owner)}\n"
    data = issubclass(owner, msgspec.Struct | enum.Enum) or owner is drone.Picture or hasattr(owner, "_fields")
    if data:
        part += _table(owner)
    for name, member in members(owner):
        line, text = function(name, member)
        part += f"\n```python\n{line}\n```\n\n{text}\n"
    return part


def body() -> str:
    """The sections: the drone, its elements with their states, other records, enums, errors."""
    everything = sorted(classes(), key=lambda owner: owner.__name__)
    elements = [owner for owner in everything if issubclass(owner, Element)]
    errors = [owner for owner in everything if issubclass(owner, Exception)]
    enums = [owner for owner in everything if issubclass(owner, enum.Enum)]
    states = {owner: getattr(drone, f"{owner.__name__}State", None) for owner in elements}
    named = {drone.Drone, *elements, *errors, *enums, *states.values()}
    parts = ["\n## Drone\n", _section(drone.Drone).replace("\n### Drone\n", "", 1), "\n## Elements\n"]
    for owner, state in states.items():
        parts += [_section(owner), _section(state) if state is not None else ""]
    parts += ["\n## Records\n", *(_section(owner) for owner in everything if owner not in named)]
    models = "".join(f"| 0x{one.id:04x} | `{one.key}` | {one.title} |\n" for one in drone.MODELS.values())
    parts.append(f"\n### MODELS\n\nThe models by their number.\n\n| id | key | title |\n|---|---|---|\n{models}")
    parts += ["\n## Enums\n", *(_section(owner) for owner in enums)]
    parts += ["\n## Errors\n", *(_section(owner) for owner in errors)]
    return "".join(parts)
