"""Landings, take-offs and the PCMD flag: the simulated firmware by default, and with the quirk that differs from it."""

from __future__ import annotations

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.rth import RthState
from anafi_mav.sim.world.quirks import Quirk

GAZ = ardrone3.PCMD(0, 0, 0, 0, 100, 0)


def landing(model: str = "4k", *quirks: Quirk) -> Bench:
    """A drone that lands from 5 m."""
    bench = Bench(model)
    bench.take_off()
    bench.climb(5.0)
    bench.faults.quirks = frozenset(quirks)
    bench.send(ardrone3.Landing())
    bench.run(0.5)
    assert bench.state is FlyingState.LANDING
    return bench


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ("4k", ardrone3.TakeOff()),
        ("ai", ardrone3.TakeOff()),
        ("ai", ardrone3.SmartTakeOffLand()),
        ("4k", GAZ),
    ],
)
def test_landing_is_ended_by_take_off_and_gaz(model: str, message: ardrone3.Message) -> None:
    bench = landing(model)
    bench.send(message)
    assert bench.state is FlyingState.FLYING
    bench.rest()
    assert bench.pose.up > 3.0


def test_landing_of_4k_continues_after_smart_takeoff_land() -> None:
    bench = landing("4k")
    bench.send(ardrone3.SmartTakeOffLand())
    assert bench.state is FlyingState.LANDING


@pytest.mark.parametrize(
    ("quirk", "message"),
    [(Quirk.LANDING_IGNORES_TAKEOFF, ardrone3.TakeOff()), (Quirk.LANDING_IGNORES_GAZ, GAZ)],
)
def test_landing_with_its_quirk_continues(quirk: Quirk, message: ardrone3.Message) -> None:
    bench = landing("4k", quirk)
    bench.send(message)
    assert bench.state is FlyingState.LANDING


def test_late_takeoff_quirk_starts_motors_after_landing() -> None:
    bench = landing("4k", Quirk.TAKEOFF_FROM_GROUND_LATE)
    bench.run_until(lambda: bench.pose.up < 0.3)
    bench.send(ardrone3.TakeOff())
    bench.run_until(lambda: bench.state is FlyingState.LANDED, 1.0)
    bench.run_until(lambda: bench.state is FlyingState.MOTOR_RAMPING, 1.0)


@pytest.mark.parametrize("message", [ardrone3.Landing(), ardrone3.UserTakeOff(0)])
def test_ramping_motors_stop_by_landing_unless_quirk(message: ardrone3.Message) -> None:
    for quirks, state in ((frozenset[Quirk](), None), (frozenset({Quirk.RAMPING_IGNORES_LANDING}), True)):
        bench = Bench()
        bench.faults.quirks = quirks
        bench.send(ardrone3.TakeOff())
        bench.run(0.3)
        bench.send(message)
        assert (bench.state is FlyingState.MOTOR_RAMPING) is (state is True)


def test_gaz_on_the_ground_starts_nothing() -> None:
    bench = Bench()
    bench.sticks(1.0, gaz=100, flag=0)
    assert bench.state is FlyingState.LANDED


@pytest.mark.parametrize(("flag", "state"), [(0, RthState.IN_PROGRESS), (1, RthState.PENDING)])
def test_return_with_remembered_flag_waits_for_flag_zero(flag: int, state: RthState) -> None:
    bench = Bench()
    bench.take_off()
    bench.climb(5.0)
    bench.faults.quirks = frozenset({Quirk.FLAG_REMEMBERED})
    bench.sticks(2.0, pitch=40)
    bench.sticks(2.0, flag=flag)  # let go of, which Parrot's programs say with flag 0
    bench.run(4.0)
    bench.send(rth.ReturnToHome())
    bench.run(4.0)
    assert bench.of(rth.State)[-1].state is state
