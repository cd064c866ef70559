"""Description of the parameters as a file of the component metadata. No I/O."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from anafi_mav.services.parameter.parameter import Parameter, limits_of
from anafi_mav.services.parameter.parameter_codec import ParamType
from anafi_mav.services.service import Host

PARAMETER_VERSION = 1
"""Of the file's format. The schema says 3, QGroundControl reads 1 and nothing else (CompInfoParam.cc)."""

_TYPES = {ParamType.INT8: "Int8", ParamType.INT16: "Int16", ParamType.INT32: "Int32", ParamType.REAL32: "Float"}


def parameter_file(parameters: Sequence[Parameter], host: Host) -> dict[str, Any]:
    """Return parameter.json: every parameter with its meaning; ranges as reported by the drone."""
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
