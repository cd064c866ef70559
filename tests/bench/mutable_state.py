"""Counts the mutable state of the flight tasks and of what chooses among them: fields, and the places that change them.

    python tests/bench/mutable_state.py [--commit COMMIT] [--sites]

A field is an attribute that is assigned outside `__init__`: by its own class, by another object, or by `setattr`. So is
an attribute with a mutable value (container, set of tasks, timer, event) that is changed in place, and a `nonlocal` of
a method. A site is one such place. A dataclass has its generated `__init__`. Assignments in the `__init__` of another
class are construction, and not counted.

Counted are all classes of `vehicle/` and those of `services/` that acquire control (`ACQUIRES`), but for `EXEMPT`. The
classes that issue CONTROL names (`NAMED`) have a subtotal. Before the package had the room `vehicle`, only those are
counted.

Types are read from annotations and constructor calls. A target of unknown type counts where only one class has an
attribute of that name.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from common import ROOT, tree_of

NAMED = frozenset(
    {
        "Aircraft",
        "Vehicle",
        "Takeoff",
        "GuidedFlight",
        "ManualFlight",
        "OffboardFlight",
        "OffboardStream",
        "OffboardMoves",
        "FollowFlight",
        "OrbitService",
        "GuidedService",
        "MissionFlight",
        "Progress",
        "MissionProgress",
        "Course",
        "StoreWait",
        "ArmWait",
        "EndWatch",
    }
)
"""Classes of issue CONTROL's list; MissionProgress was Progress."""

ACQUIRES = frozenset(("take_over", "acquire", "helms"))
"""Methods and attributes that only a flight task or its service uses: what uses them decides who flies."""

EXEMPT = {
    "MotionEstimate": "estimator",
    "VelocityController": "estimator",
    "RollCheck": "estimator",
    "_Interval": "part of the estimator RollCheck",
    "HeightReference": "estimator",
    "TargetFollower": "estimator of a target's motion",
    "GcsWatch": "measures the silence of ground stations",
    "FenceWatch": "measures the place against the fence",
    "_Side": "part of FenceWatch",
    "AbortedReturn": "when a text is repeated",
    "ControllerInputs": "wheels and buttons of the Skycontroller, which do not fly",
    "FilesOnDrone": "files on the drone's card",
    "FollowSettings": "parameters",
    "LossPolicy": "parameters",
    "RallyPoints": "an uploaded plan",
    "Fence": "an uploaded plan",
}
"""Classes of the counted rooms that do not decide who flies, with the reason."""

CHANGES = frozenset(
    {
        "append",
        "appendleft",
        "add",
        "clear",
        "discard",
        "extend",
        "insert",
        "pop",
        "popitem",
        "popleft",
        "remove",
        "reverse",
        "setdefault",
        "sort",
        "update",
        "set",
        "set_in",
        "cancel",
        "set_result",
        "set_exception",
        "put",
        "put_nowait",
        "get_nowait",
    }
)
"""Methods that change a mutable value in place."""

MUTABLE = frozenset(
    {
        "list",
        "dict",
        "set",
        "deque",
        "defaultdict",
        "OrderedDict",
        "Counter",
        "bytearray",
        "WeakSet",
        "WeakKeyDictionary",
        "Alarm",
        "Event",
        "Condition",
        "Queue",
        "Future",
        "MutableMapping",
        "MutableSequence",
        "MutableSet",
    }
)
"""Types of values that are changed in place. Package classes are counted by themselves."""

INITIAL = ("__init__", "__post_init__", "__new__")

GOAL = 35
"""Fields at most, after issue CONTROL."""


@dataclass
class Class:
    """A class of the package, as far as its source says."""

    name: str
    path: str
    bases: list[str]
    node: ast.ClassDef
    types: dict[str, str] = field(default_factory=dict)
    """Class of each attribute, property and method's result, as far as known."""
    attributes: set[str] = field(default_factory=set)
    """Attributes that it assigns or declares."""


def words(annotation: ast.expr | None) -> list[str]:
    """Return the names in an annotation, outermost first, without None."""
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        with contextlib.suppress(SyntaxError):
            return words(ast.parse(annotation.value, mode="eval").body)
    if isinstance(annotation, ast.Subscript):
        return words(annotation.value)
    if isinstance(annotation, ast.BinOp):
        return [*words(annotation.left), *words(annotation.right)]
    if isinstance(annotation, ast.Attribute):
        return [annotation.attr]
    return [annotation.id] if isinstance(annotation, ast.Name) else []


def named_by(annotation: ast.expr | None) -> str | None:
    """Return the one class that an annotation names."""
    found = [word for word in words(annotation) if word != "None"]
    return found[0] if len(found) == 1 else None


class Package:
    """All classes of a source tree."""

    def __init__(self, root: Path) -> None:
        self.classes: dict[str, Class] = {}
        self.trees: list[tuple[str, ast.Module]] = []
        for path in sorted((root / "anafi_mav").rglob("*.py")):
            name = str(path.relative_to(root / "anafi_mav"))
            if name.startswith("sim/") or name == "mavlink/dialect.py":
                continue
            tree = ast.parse(path.read_text())
            self.trees.append((name, tree))
            for node in ast.walk(tree):
                if isinstance(node, ast.ClassDef) and rank(name) >= self._rank(node.name):
                    bases = [word for base in node.bases for word in words(base)]
                    self.classes[node.name] = Class(node.name, name, bases, node)
        for one in self.classes.values():
            self._declare(one)

    def _rank(self, name: str) -> int:
        return rank(self.classes[name].path) if name in self.classes else 0

    def _declare(self, one: Class) -> None:
        for node in one.node.body:
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                one.attributes.add(node.target.id)
                self._type(one, node.target.id, named_by(node.annotation))
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                self._type(one, node.name, named_by(node.returns))
                scope = Scope(self, one, node)
                for inner in ast.walk(node):
                    for target, value, annotation in assigned(inner):
                        if is_self(target):
                            one.attributes.add(target.attr)
                            kind = named_by(annotation) or (None if value is None else scope.type_of(value))
                            self._type(one, target.attr, kind)

    def _type(self, one: Class, attribute: str, kind: str | None) -> None:
        if kind is not None:
            one.types.setdefault(attribute, kind)

    def mro(self, name: str) -> Iterator[Class]:
        """Yield a class and its bases in the package."""
        if (one := self.classes.get(name)) is not None:
            yield one
            for base in one.bases:
                yield from self.mro(base)

    def type_of(self, owner: str, attribute: str) -> str | None:
        """Return the class of an attribute of a class, or None."""
        return next((one.types[attribute] for one in self.mro(owner) if attribute in one.types), None)

    def owner(self, name: str, attribute: str) -> str | None:
        """Return the class that declares an attribute of a class: the last of its bases."""
        found = [one.name for one in self.mro(name) if attribute in one.attributes]
        return found[-1] if found else None


class Scope:
    """Names of one function, with their classes."""

    def __init__(
        self, package: Package, inside: Class | None, function: ast.FunctionDef | ast.AsyncFunctionDef
    ) -> None:
        self._package = package
        self._names: dict[str, str] = {}
        arguments = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
        if inside is not None and arguments and arguments[0].arg == "self":
            self._names["self"] = inside.name
        for argument in arguments:
            if (kind := named_by(argument.annotation)) is not None:
                self._names[argument.arg] = kind
        for node in ast.walk(function):
            for target, value, annotation in assigned(node):
                if isinstance(target, ast.Name):
                    kind = named_by(annotation) or (None if value is None else self.type_of(value))
                    if kind is not None:
                        self._names.setdefault(target.id, kind)

    def type_of(self, value: ast.expr) -> str | None:
        """Return the class of an expression, or None when unknown."""
        match value:
            case ast.Name(id=name):
                return self._names.get(name)
            case ast.Attribute(value=inner, attr=attribute):
                owner = self.type_of(inner)
                return None if owner is None else self._package.type_of(owner, attribute)
            case ast.Call(func=ast.Name(id=name)) if name in self._package.classes or name in MUTABLE:
                return name
            case ast.Call(func=ast.Attribute(attr=name)) if name in MUTABLE:
                return name
            case ast.Call(func=function):
                return self.type_of(function)
            case ast.Await(value=inner) | ast.NamedExpr(value=inner):
                return self.type_of(inner)
            case ast.IfExp(body=first, orelse=second) | ast.BoolOp(values=[first, second]):
                return self.type_of(first) or self.type_of(second)
            case ast.List() | ast.ListComp():
                return "list"
            case ast.Dict() | ast.DictComp():
                return "dict"
            case ast.Set() | ast.SetComp():
                return "set"
        return None


Target = tuple[ast.expr, ast.expr | None, ast.expr | None]


def assigned(node: ast.AST) -> Iterator[Target]:
    """Yield what a node assigns or deletes, with the value and the annotation if it has them."""
    match node:
        case ast.Assign(targets=targets, value=value):
            for target in targets:
                yield from _parts(target, value)
        case ast.AnnAssign(target=target, value=value, annotation=annotation):
            yield target, value, annotation
        case ast.AugAssign(target=target) | ast.For(target=target) | ast.AsyncFor(target=target):
            yield from _parts(target, None)
        case ast.NamedExpr(target=target, value=value):
            yield target, value, None
        case ast.Delete(targets=targets):
            for target in targets:
                yield from _parts(target, None)
        case ast.With(items=items) | ast.AsyncWith(items=items):
            for item in items:
                if item.optional_vars is not None:
                    yield from _parts(item.optional_vars, None)


def _parts(target: ast.expr, value: ast.expr | None) -> Iterator[Target]:
    if isinstance(target, ast.Tuple | ast.List):
        values = value.elts if isinstance(value, ast.Tuple | ast.List) else []
        for index, part in enumerate(target.elts):
            yield from _parts(part, values[index] if len(values) == len(target.elts) else None)
    else:
        yield target, value, None


def is_self(target: ast.expr) -> bool:
    """Return True for `self.attribute`."""
    return isinstance(target, ast.Attribute) and isinstance(target.value, ast.Name) and target.value.id == "self"


def rank(path: str) -> int:
    """Return how near a file is to who flies: of classes with one name the nearest is meant."""
    return 2 if path.startswith("vehicle/") else 1 if path.startswith("services/") else 0


def counted(package: Package) -> dict[str, Class]:
    """Return the classes that are counted."""
    has_room = any(rank(path) == 2 for path, _ in package.trees)

    def decides(one: Class) -> bool:
        if one.name in EXEMPT:
            return False
        if one.name in NAMED or not has_room:
            return one.name in NAMED and rank(one.path) > 0
        used = {node.attr for node in ast.walk(one.node) if isinstance(node, ast.Attribute)}
        return rank(one.path) == 2 or (rank(one.path) == 1 and bool(used & ACQUIRES))

    return {name: one for name, one in package.classes.items() if decides(one)}


@dataclass(frozen=True)
class Site:
    """A place that changes a field."""

    owner: str
    attribute: str
    path: str
    line: int


class Counting:
    """Finds the sites of a package."""

    def __init__(self, package: Package) -> None:
        self._package = package
        self.classes = counted(package)
        self.sites: list[Site] = []
        self._named: dict[str, set[str]] = defaultdict(set)
        for one in package.classes.values():
            for attribute in one.attributes:
                self._named[attribute].add(package.owner(one.name, attribute) or one.name)
        for path, tree in package.trees:
            self._walk(path, tree, None)

    def _walk(self, path: str, node: ast.AST, inside: Class | None) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.ClassDef):
                self._walk(path, child, self._package.classes.get(child.name))
            elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                if child.name not in INITIAL:
                    self._function(path, child, inside)
            else:
                self._walk(path, child, inside)

    def _function(self, path: str, function: ast.FunctionDef | ast.AsyncFunctionDef, inside: Class | None) -> None:
        scope = Scope(self._package, inside, function)
        for node in ast.walk(function):
            for target, _, _ in assigned(node):
                while isinstance(target, ast.Subscript):
                    target = target.value
                if isinstance(target, ast.Attribute):
                    self._found(path, scope, target)
            match node:
                case ast.Nonlocal(names=names) if inside is not None and inside.name in self.classes:
                    self.sites += [Site(inside.name, name, path, node.lineno) for name in names]
                case ast.Attribute(value=ast.Attribute() as changed, attr=name) if name in CHANGES:
                    owner = scope.type_of(changed.value)
                    kind = None if owner is None else self._package.type_of(owner, changed.attr)
                    if kind in MUTABLE:
                        self._found(path, scope, changed)
                case ast.Call(func=ast.Name(id="setattr") | ast.Attribute(attr="__setattr__"), args=[of, name, _]):
                    self._setattr(path, scope, inside, of, name)

    def _setattr(self, path: str, scope: Scope, inside: Class | None, of: ast.expr, name: ast.expr) -> None:
        """Count a setattr; a name that is no constant stands for all attributes that the class passes on by name."""
        if isinstance(name, ast.Constant):
            names = {str(name.value)}
        elif inside is not None and isinstance(of, ast.Name) and of.id == "self":
            texts = (node.value for node in ast.walk(inside.node) if isinstance(node, ast.Constant))
            names = {text for text in texts if isinstance(text, str) and text in inside.attributes}
        else:
            return
        for attribute in names:
            target = ast.Attribute(of, attribute, ast.Store(), lineno=of.lineno, col_offset=of.col_offset)
            self._found(path, scope, target)

    def _found(self, path: str, scope: Scope, target: ast.Attribute) -> None:
        kind = scope.type_of(target.value)
        if kind is not None:
            owner = self._package.owner(kind, target.attr)
        else:
            owners = self._named[target.attr]
            owner = next(iter(owners)) if len(owners) == 1 else None
        if owner in self.classes:
            self.sites.append(Site(owner, target.attr, path, target.lineno))


def table(counting: Counting, sites: bool) -> str:
    """Return the figures of each class and their sums."""
    fields: dict[str, Counter[str]] = defaultdict(Counter)
    for site in counting.sites:
        fields[site.owner][site.attribute] += 1
    lines = ["| class | fields | sites | which |", "|---|---:|---:|---|"]
    for name, found in sorted(fields.items(), key=lambda row: (row[0] not in NAMED, -len(row[1]), row[0])):
        which = ", ".join(f"{attribute} {number}" for attribute, number in found.most_common())
        lines.append(f"| {name} | {len(found)} | {found.total()} | {which} |")
    lines += [
        "",
        f"classes that issue CONTROL names: {_sum([f for name, f in fields.items() if name in NAMED])}",
        f"all flight tasks and their owners: {_sum(list(fields.values()))}; the goal is {GOAL} fields",
    ]
    if sites:
        lines += [f"{s.path}:{s.line}: {s.owner}.{s.attribute}" for s in counting.sites]
    return "\n".join(lines)


def _sum(found: list[Counter[str]]) -> str:
    return f"{sum(map(len, found))} fields at {sum(f.total() for f in found)} sites"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--commit", help="count another commit than this work tree")
    parser.add_argument("--sites", action="store_true", help="list each site")
    options = parser.parse_args()
    with contextlib.nullcontext(ROOT) if options.commit is None else tree_of(options.commit) as root:
        print(table(Counting(Package(root)), options.sites))
    return 0


if __name__ == "__main__":
    sys.exit(main())
