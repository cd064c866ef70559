"""Who began a landing or a return: a client, the drone, or the pilot at the Skycontroller."""

from __future__ import annotations

import pytest

from anafi_mav.vehicle.initiator import Initiator, Initiators

CLIENT, DRONE, PILOT, UNSEEN = Initiator.CLIENT, Initiator.DRONE, Initiator.PILOT, Initiator.UNSEEN


def lands(who: Initiators, now: float = 100.0, *, plan: bool = False, skycontroller: bool = False) -> Initiator | None:
    who.on_landing(now, plan_lands=plan, pilot_may_land=skycontroller)
    return who.landing


def returns(who: Initiators, now: float = 100.0, *, own: bool = False, plan: bool = False, sc: bool = False) -> None:
    who.on_return(now, by_itself=own, by_plan=plan, skycontroller=sc)


@pytest.mark.parametrize("skycontroller", [False, True])
def test_commanded_landing_is_the_clients(skycontroller: bool) -> None:
    who = Initiators()
    who.land_commanded(99.0)
    assert lands(who, skycontroller=skycontroller) is CLIENT


def test_landing_ending_a_plan_is_the_clients() -> None:
    assert lands(Initiators(), plan=True, skycontroller=True) is CLIENT


def test_landing_just_after_a_plan_that_lands_is_not_the_pilots() -> None:
    who = Initiators()
    who.plan_ended(99.0)
    assert lands(who, skycontroller=True) is DRONE
    who.on_landing_over(unsent=True)
    assert lands(who, 103.0, skycontroller=True) is PILOT  # another landing


def test_end_of_a_plan_that_lands_is_no_end_of_a_return() -> None:
    who = Initiators()
    who.return_commanded(99.0)
    returns(who)
    who.on_return_over(100.0, stopped=False)
    who.plan_ended(101.0)
    assert who.last_return is CLIENT


@pytest.mark.parametrize(("skycontroller", "expected"), [(False, DRONE), (True, PILOT)])
def test_unexplained_landing_is_the_drones_or_the_pilots(skycontroller: bool, expected: Initiator) -> None:
    assert lands(Initiators(), skycontroller=skycontroller) is expected


def test_landing_long_after_a_command_is_not_the_clients() -> None:
    who = Initiators()
    who.land_commanded(80.0)
    assert lands(who, skycontroller=True) is PILOT


def test_landing_of_the_pilot_stays_the_pilots() -> None:
    who = Initiators()
    assert lands(who, skycontroller=True) is PILOT
    who.land_commanded(101.0)
    assert who.landing is PILOT


def test_landing_after_a_return_keeps_the_returns_initiator() -> None:
    who = Initiators()
    returns(who, own=True)
    assert lands(who) is DRONE  # reported before the return's end
    who = Initiators()
    returns(who, own=True, sc=True)
    who.on_return_over(120.0, stopped=False)
    assert lands(who, 121.0, skycontroller=True) is DRONE
    who = Initiators()
    who.return_commanded(99.0)
    returns(who, sc=True)
    who.on_return_over(120.0, stopped=False)
    assert lands(who, 121.0, skycontroller=True) is CLIENT
    who = Initiators()
    returns(who, own=True)
    who.on_return_over(120.0, stopped=False)
    who.on_landing_over(unsent=True)
    assert lands(who, 140.0, skycontroller=True) is PILOT  # another landing


@pytest.mark.parametrize(
    ("own", "plan", "sc", "commanded", "expected"),
    [
        (True, False, False, False, DRONE),
        (True, False, True, True, DRONE),
        (False, True, True, False, CLIENT),
        (False, False, False, False, CLIENT),
        (False, False, True, True, CLIENT),
        (False, False, True, False, PILOT),
    ],
)
def test_return(own: bool, plan: bool, sc: bool, commanded: bool, expected: Initiator) -> None:
    who = Initiators()
    if commanded:
        who.return_commanded(99.0)
    returns(who, own=own, plan=plan, sc=sc)
    assert who.returning is expected


def test_return_of_a_client_stays_the_clients() -> None:
    who = Initiators()
    who.return_commanded(99.0)
    returns(who, 100.0, sc=True)
    returns(who, 160.0, sc=True)
    assert who.returning is CLIENT
    who.on_return_over(170.0, stopped=False)
    assert who.returning is None
    returns(who, 180.0, sc=True)
    assert who.returning is PILOT


def test_landing_found_under_way_is_the_drones_once_a_plan_lands_there() -> None:
    who = Initiators()
    who.on_landing(100.0, plan_lands=False, pilot_may_land=True, unseen=True)
    assert who.landing is UNSEEN
    who.plan_ended(100.0)
    assert who.landing is DRONE


def test_landing_of_the_pilot_stays_the_pilots_as_a_plan_ends() -> None:
    who = Initiators()
    assert lands(who, skycontroller=True) is PILOT
    who.plan_ended(100.0)
    assert who.landing is PILOT


@pytest.mark.parametrize("stored", [CLIENT, DRONE, PILOT])
def test_stored_initiator_counts_for_the_landing_or_return_under_way(stored: Initiator) -> None:
    who = Initiators()
    who.recall(stored, None)
    assert (who.landing, who.returning) == (stored, None)
    who.recall(None, stored)
    assert (who.landing, who.returning) == (None, stored)
    assert lands(who, skycontroller=True) is stored
    who.recall(None, None)
    assert (who.landing, who.returning) == (None, None)


@pytest.mark.parametrize("stops_first", [True, False])
@pytest.mark.parametrize(("skycontroller", "expected"), [(True, PILOT), (False, DRONE)])
def test_landing_that_stops_a_return_is_not_the_returns(
    stops_first: bool, skycontroller: bool, expected: Initiator
) -> None:
    """The two reports may arrive in either order."""
    who = Initiators()
    who.return_commanded(99.0)
    returns(who, sc=skycontroller)
    if stops_first:
        who.on_return_over(110.0, stopped=True)
        assert lands(who, 110.4, skycontroller=skycontroller) is expected
    else:
        assert lands(who, 110.0, skycontroller=skycontroller) is CLIENT
        who.on_return_over(110.4, stopped=True)
        assert who.landing is expected
    assert who.last_return is None


def test_landing_of_a_client_that_stops_a_return_is_the_clients() -> None:
    who = Initiators()
    returns(who, sc=True)
    who.land_commanded(109.9)
    assert lands(who, 110.0, skycontroller=True) is CLIENT
    who.on_return_over(110.4, stopped=True)
    assert who.landing is CLIENT
