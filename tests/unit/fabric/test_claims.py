"""Claims of system ids: who keeps one."""

from __future__ import annotations

from anafi_mav.fabric.claims import FREE_FOR, SETTLE, SIMULTANEOUS, SPREAD, ClaimChange, ClaimStep, SystemClaims

LOW, MINE, HIGH = "1111111111111111", "5555555555555555", "9999999999999999"
SOON, LATER = 1.0, FREE_FOR + SPREAD


class Gateway:
    """The claims of one gateway to system 1, and its clock."""

    def __init__(self, session: str = MINE, *wanted: int) -> None:
        self.claims = SystemClaims(session, wanted or [1])
        self.now = 100.0
        self.on_ground = True

    def decide(self, after: float = 0.0, *, listed: bool = True) -> list[ClaimChange]:
        self.now += after
        return self.claims.decide(self.now, is_listed=listed, can_claim=lambda sysid: self.on_ground)

    def sees(self, other: str, *, alive: bool = True) -> None:
        self.claims.token(1, other, is_alive=alive)


def holding(session: str = MINE) -> Gateway:
    """A gateway that has held the id for long."""
    gateway = Gateway(session)
    assert gateway.decide() == [ClaimChange(ClaimStep.HOLD, 1)]
    gateway.now += 1000.0
    return gateway


def refused(session: str, holder: str) -> Gateway:
    """A gateway whose id another one has."""
    gateway = Gateway(session)
    gateway.sees(holder)
    assert gateway.decide() == [ClaimChange(ClaimStep.KEEP_OFF, 1, holder)]
    return gateway


def test_free_ids_are_held_once_all_tokens_are_known() -> None:
    gateway = Gateway(MINE, 2, 1)
    assert gateway.decide(listed=False) == []
    assert not gateway.claims.is_settled
    assert gateway.decide() == [ClaimChange(ClaimStep.HOLD, 1), ClaimChange(ClaimStep.HOLD, 2)]
    assert gateway.decide() == []
    assert gateway.claims.held == {1, 2}
    assert gateway.claims.is_settled


def test_id_of_another_gateway_is_left_to_it_whatever_its_session() -> None:
    for other in (LOW, HIGH):
        gateway = Gateway(MINE, 1, 2)
        gateway.sees(other)
        assert gateway.decide() == [ClaimChange(ClaimStep.KEEP_OFF, 1, other), ClaimChange(ClaimStep.HOLD, 2)]
        assert gateway.decide() == []
        assert gateway.claims.refused == {1: other}


def test_simultaneous_claim_is_kept_by_the_lower_session() -> None:
    gateway = Gateway()
    gateway.decide()
    gateway.sees(HIGH)
    assert gateway.decide(SIMULTANEOUS) == [ClaimChange(ClaimStep.CLASH, 1, HIGH)]
    assert gateway.decide(LATER) == []
    gateway.sees(LOW)
    assert gateway.decide() == [ClaimChange(ClaimStep.RELEASE, 1, LOW)]
    assert gateway.claims.held == set()


def test_id_is_not_released_in_flight() -> None:
    gateway = Gateway()
    gateway.decide()
    gateway.sees(LOW)
    gateway.on_ground = False
    assert gateway.decide() == [ClaimChange(ClaimStep.CLASH, 1, LOW)]
    assert gateway.decide(LATER) == []
    assert (gateway.claims.held, gateway.claims.taken) == ({1}, {1})
    gateway.on_ground = True
    assert gateway.decide() == [ClaimChange(ClaimStep.RELEASE, 1, LOW)]


def test_id_of_a_lost_link_or_a_restarted_router_is_not_claimed_at_once() -> None:
    gateway = refused(LOW, MINE)
    gateway.sees(MINE, alive=False)
    assert gateway.decide() == []
    assert gateway.decide(FREE_FOR - 1.0, listed=False) == []  # this link was lost, too
    assert gateway.decide() == []
    assert gateway.decide(FREE_FOR - 1.0) == []
    gateway.sees(MINE)
    assert gateway.decide() == []
    assert gateway.claims.refused == {1: MINE}


def test_id_that_stays_free_is_claimed_on_the_ground() -> None:
    gateway = refused(MINE, HIGH)
    gateway.sees(HIGH, alive=False)
    gateway.on_ground = False
    assert gateway.decide() == []
    assert gateway.decide(LATER) == []
    gateway.on_ground = True
    assert gateway.decide() == [ClaimChange(ClaimStep.HOLD, 1)]


def test_id_goes_back_to_the_gateway_that_had_it_before() -> None:
    """Both know who came first: one was refused the id, the other has held it for long."""
    elder, heir = holding(HIGH), refused(LOW, HIGH)
    heir.sees(HIGH, alive=False)
    heir.decide()
    assert heir.decide(LATER) == [ClaimChange(ClaimStep.HOLD, 1)]
    heir.now += 1000.0
    for gateway, other in ((elder, LOW), (heir, HIGH)):
        gateway.sees(other)
    assert heir.decide() == [ClaimChange(ClaimStep.RELEASE, 1, HIGH)]
    assert elder.decide() == [ClaimChange(ClaimStep.CLASH, 1, LOW)]
    elder.sees(LOW, alive=False)
    assert elder.decide(SETTLE) == []
    assert (elder.claims.held, elder.claims.taken) == ({1}, set())


def test_id_of_both_sides_of_a_parted_network_is_kept_by_the_lower_session() -> None:
    low, high = holding(LOW), holding(HIGH)
    low.sees(HIGH)
    high.sees(LOW)
    assert low.decide() == [ClaimChange(ClaimStep.CLASH, 1, HIGH)]
    assert high.decide() == [ClaimChange(ClaimStep.CLASH, 1, LOW)]
    assert low.decide(SETTLE) == []
    assert high.decide(SETTLE) == [ClaimChange(ClaimStep.RELEASE, 1, LOW)]


def test_gateways_that_wait_for_one_id_do_not_claim_it_at_the_same_moment() -> None:
    moments = set()
    for number in range(10):
        gateway = refused(f"{number:016x}", MINE)
        gateway.sees(MINE, alive=False)
        gateway.decide()
        steps = 0
        while not gateway.decide(0.001):
            steps += 1
        moments.add(steps)
    assert len(moments) == 10


def test_own_token_is_no_other() -> None:
    gateway = Gateway()
    gateway.sees(MINE)
    assert gateway.decide() == [ClaimChange(ClaimStep.HOLD, 1)]
