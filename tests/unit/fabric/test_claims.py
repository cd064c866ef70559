"""Claims of system ids: who keeps one."""

from __future__ import annotations

from anafi_mav.fabric.claims import ClaimChange, ClaimStep, SystemClaims

LOW, MINE, HIGH = "1111111111111111", "5555555555555555", "9999999999999999"


def decide(claims: SystemClaims, *, listed: bool = True, on_ground: bool = True) -> list[ClaimChange]:
    return claims.decide(is_listed=listed, can_claim=lambda sysid: on_ground)


def test_free_ids_are_held_once_all_tokens_are_known() -> None:
    claims = SystemClaims(MINE, [2, 1])
    assert decide(claims, listed=False) == []
    assert not claims.is_settled
    assert decide(claims) == [ClaimChange(ClaimStep.HOLD, 1), ClaimChange(ClaimStep.HOLD, 2)]
    assert decide(claims) == []
    assert claims.held == {1, 2}
    assert claims.is_settled


def test_id_of_another_gateway_is_left_to_it_whatever_its_session() -> None:
    for other in (LOW, HIGH):
        claims = SystemClaims(MINE, [1, 2])
        claims.token(1, other, is_alive=True)
        assert decide(claims) == [ClaimChange(ClaimStep.KEEP_OFF, 1, other), ClaimChange(ClaimStep.HOLD, 2)]
        assert decide(claims) == []
        assert claims.refused == {1: other}


def test_simultaneous_claim_is_kept_by_the_lower_session() -> None:
    claims = SystemClaims(MINE, [1])
    decide(claims)
    claims.token(1, HIGH, is_alive=True)
    assert decide(claims) == []
    claims.token(1, LOW, is_alive=True)
    assert decide(claims) == [ClaimChange(ClaimStep.RELEASE, 1, LOW)]
    assert claims.held == set()


def test_id_is_not_released_in_flight() -> None:
    claims = SystemClaims(MINE, [1])
    decide(claims)
    claims.token(1, LOW, is_alive=True)
    assert decide(claims, on_ground=False) == []
    assert claims.held == {1}
    assert decide(claims) == [ClaimChange(ClaimStep.RELEASE, 1, LOW)]


def test_id_that_becomes_free_is_not_claimed_in_flight() -> None:
    claims = SystemClaims(MINE, [1])
    claims.token(1, HIGH, is_alive=True)
    decide(claims)
    claims.token(1, HIGH, is_alive=False)
    assert decide(claims, on_ground=False) == []
    assert decide(claims) == [ClaimChange(ClaimStep.HOLD, 1)]


def test_own_token_is_no_other() -> None:
    claims = SystemClaims(MINE, [1])
    claims.token(1, MINE, is_alive=True)
    assert decide(claims) == [ClaimChange(ClaimStep.HOLD, 1)]
