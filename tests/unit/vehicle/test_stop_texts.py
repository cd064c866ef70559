"""Texts about landings and returns fit one STATUSTEXT, with the longest values that they can be filled with."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from anafi_mav.drone.events import HomeReachability, ReturnReason, WarningLevel
from anafi_mav.drone.piloting import landing
from anafi_mav.services.statustext import CHUNK
from anafi_mav.vehicle.aborted_return import REPEAT_EVERY, AbortedReturn
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.vehicle import UNENDABLE


def aircraft(**state: Any) -> Any:
    """What `AbortedReturn` reads of a vehicle."""
    base = {"on_ground": False, "returning": False, "percent": 100, "icing": None, "flying_state": None}
    base |= {"reachability": HomeReachability.NOT_REACHABLE, **state}
    drone = SimpleNamespace(
        battery=SimpleNamespace(state=SimpleNamespace(percent=base["percent"])),
        home=SimpleNamespace(state=SimpleNamespace(reachability=base["reachability"])),
        alerts=SimpleNamespace(state=SimpleNamespace(icing=base["icing"])),
    )
    texts: list[str] = []
    return SimpleNamespace(drone=drone, texts=texts, text=lambda severity, text: texts.append(text), **base)


@pytest.mark.parametrize("mode", [mode for mode in FlightMode if mode is not FlightMode.TERMINATED])
def test_stop_refusals_fit_one_text(mode: FlightMode) -> None:
    assert [text for reason in UNENDABLE if len(text := f"{mode.value} refused: {reason}") > CHUNK] == []


def test_texts_about_a_continuing_landing_fit_one_statustext() -> None:
    reasons = (
        landing.ALREADY_LANDED,
        landing.STILL_LANDING,
        landing.MOTORS_CUT,
        landing.FORCED,
    )
    assert max(len(f"Landing not aborted: {reason}") for reason in reasons) <= CHUNK
    assert f"Landing not aborted: {landing.ALREADY_LANDED}" == "Landing not aborted: already landed"


@pytest.mark.parametrize("reason", [*ReturnReason, None])
@pytest.mark.parametrize("system", [255, None])
def test_texts_about_an_aborted_return_fit_one_text_each(system: int | None, reason: ReturnReason | None) -> None:
    texts = AbortedReturn(system, reason).reports(aircraft())
    assert [text for text in texts if len(text) > CHUNK] == []
    assert texts[-1].endswith("land now")


def test_aborted_return_names_system_reason_and_battery() -> None:
    vehicle = aircraft(reachability=HomeReachability.REACHABLE, percent=23)
    assert AbortedReturn(7, ReturnReason.LOW_BATTERY).reports(vehicle) == [
        "Return aborted by system 7: low battery",
        "No automatic return: battery 23 %",
    ]
    assert AbortedReturn(7, ReturnReason.ICING).reports(vehicle) == ["Return aborted by system 7: icing"]


def test_aborted_return_is_due_every_15_s_while_unresolved() -> None:
    aborted, vehicle = AbortedReturn(1, ReturnReason.LOW_BATTERY), aircraft()
    aborted.report(vehicle, 100.0)
    assert len(vehicle.texts) == 3
    assert not aborted.due(vehicle, 100.0 + REPEAT_EVERY - 0.1)
    assert aborted.due(vehicle, 100.0 + REPEAT_EVERY)
    assert not aborted.due(aircraft(returning=True), 100.0 + REPEAT_EVERY)


@pytest.mark.parametrize(
    ("reason", "state", "lasts"),
    [
        (ReturnReason.LOW_BATTERY, {}, True),
        (ReturnReason.LOW_BATTERY, {"on_ground": True}, False),
        (ReturnReason.CONNECTION_LOST, {}, False),
        (ReturnReason.ICING, {"icing": WarningLevel.WARNING}, True),
        (ReturnReason.ICING, {"icing": WarningLevel.OK}, False),
    ],
)
def test_reason_of_an_aborted_return_lasts(reason: ReturnReason, state: dict[str, Any], lasts: bool) -> None:
    assert AbortedReturn(1, reason).lasts(aircraft(**state)) is lasts
