"""Parrot's file of a whole plan: what a drone flies of it by itself, from its planned home."""

from __future__ import annotations

from dataclasses import replace

from anafi_mav.errors import PlanError
from anafi_mav.plans.formats import parrot
from anafi_mav.plans.formats.parrot import Version
from anafi_mav.plans.path import place_of
from anafi_mav.plans.plan import Loss, Plan
from anafi_mav.plans.translation.translate import FlightPlanFile, GatewayStep, Start, examine, translate


def start_of(plan: Plan) -> Start:
    """Return the start of a plan: on the ground at the planned home.

    Without home it is the first place, whose height above the sea is not known.
    """
    if plan.home is not None:
        return Start(plan.home.latitude, plan.home.longitude, 0.0, False, plan.home.height)
    first = next((place for item in plan.items if (place := place_of(item)) is not None), (0.0, 0.0))
    return Start(*first, 0.0, False, None)


def export_parrot(plan: Plan, version: Version, source: str) -> tuple[bytes, list[Loss]]:
    """The file, and what of the plan it does not hold or has otherwise.

    Raises `PlanError` for what no drone of this version flies, or none without a gateway; `source` names the plan.
    """
    faults = examine(plan.items, version).faults
    if faults:
        raise PlanError(source, faults[0].reason, faults[0].item)
    try:
        flight = translate(plan.items, version, start_of(plan))
    except PlanError as error:
        raise PlanError(source, error.problem, error.item) from error
    step = next((part for part in flight.parts if isinstance(part, GatewayStep)), None)
    if step is not None:
        raise PlanError(source, "a gateway has to fly it: no file for the drone alone", step.item)
    if flight.rest is not None:
        raise PlanError(source, "it is too long for one file", flight.rest.item)
    content = b"".join(part.content for part in flight.parts if isinstance(part, FlightPlanFile))
    _, lost = parrot.write(replace(plan, items=()), version)
    return content, [*flight.notes, *lost]
