"""Who of the daemons of one name plans: the decision, with times as plain numbers."""

from __future__ import annotations

import random

import pytest

from fasaco_edge.bus.claim import (
    LEASE_S,
    PATIENCE_S,
    REJOIN_S,
    SETTLE_S,
    Claim,
    ClaimState,
    claims_in,
)

A, B, C = "0a", "0b", "0c"
# So long is enough to have settled.
CALM_S = SETTLE_S + 0.01


def planning(own):
    claim = Claim(own)
    claim.decide({}, 0.0)
    assert claim.state is ClaimState.LOOKS
    claim.decide({}, CALM_S)
    assert claim.state is ClaimState.PLANS
    return claim


def test_a_daemon_alone_plans_after_its_check():
    assert not planning(A).rival


@pytest.mark.parametrize("own", [A, C])
def test_a_new_daemon_waits_for_the_one_that_plans(own):
    """Whoever has the smaller id: who plans goes on."""
    claim = Claim(own)
    for now in (0.0, 1.0, 2.0, 100.0):
        claim.decide({B: ClaimState.PLANS}, now)
        assert (claim.state, claim.rival) == (ClaimState.WAITS, B)
    before = planning(B)
    before.decide({own: ClaimState.WAITS}, 1.0)
    assert before.state is ClaimState.PLANS


def test_two_daemons_that_start_together_leave_one_planning():
    first, second = Claim(A), Claim(B)
    for now in (0.0, CALM_S):
        first.decide({B: ClaimState.WAITS}, now)
        second.decide({A: ClaimState.WAITS}, now)
    assert (first.state, second.state) == (ClaimState.PLANS, ClaimState.WAITS)
    assert second.rival == A


def test_a_waiting_daemon_takes_over_from_a_gone_one():
    claim = Claim(B)
    for now in range(50):
        claim.decide({A: ClaimState.PLANS}, float(now))
    claim.decide({}, 50.0)
    assert claim.state is ClaimState.WAITS
    claim.decide({}, 50.0 + CALM_S)
    assert claim.state is ClaimState.PLANS


def test_the_waiting_daemon_with_the_smaller_id_takes_over():
    claims = {B: Claim(B), C: Claim(C)}
    for own, other in ((B, C), (C, B)):
        claims[own].decide({A: ClaimState.PLANS, other: ClaimState.WAITS}, 0.0)
        claims[own].decide({other: ClaimState.WAITS}, 1.0)
        claims[own].decide({other: ClaimState.WAITS}, 1.0 + CALM_S)
    assert (claims[B].state, claims[C].state) == (ClaimState.PLANS, ClaimState.WAITS)


def test_a_daemon_that_could_plan_but_does_not_is_not_waited_for():
    claim, now = Claim(B), 0.0
    claim.decide({A: ClaimState.WAITS}, now)
    while now < SETTLE_S + PATIENCE_S:
        assert claim.state is not ClaimState.PLANS
        now += 1.0
        claim.decide({A: ClaimState.WAITS}, now)
    claim.decide({A: ClaimState.WAITS}, now + 1.0)
    assert claim.state is ClaimState.PLANS


def test_after_a_partition_one_of_two_planners_yields():
    """A network partition left each half with a planner of its own."""
    first, second = planning(A), planning(B)
    first.decide({B: ClaimState.PLANS}, 5.0)
    second.decide({A: ClaimState.PLANS}, 5.0)
    assert (first.state, second.state) == (ClaimState.PLANS, ClaimState.YIELDS)
    assert not first.rival_yielded
    first.decide({B: ClaimState.YIELDS}, 5.1)
    assert first.rival_yielded
    first.decide({B: ClaimState.YIELDS}, 5.2)
    assert not first.rival_yielded
    # It may have yielded unseen.
    first.decide({}, 6.0, in_touch=False)
    first.decide({}, 7.0)
    first.decide({B: ClaimState.YIELDS}, 7.1)
    assert first.rival_yielded


def test_a_daemon_without_a_router_does_not_take_over():
    """The router is gone, and with it the other's token."""
    claim = Claim(B)
    claim.decide({A: ClaimState.PLANS}, 0.0)
    for now in range(1, 60):
        claim.decide({}, float(now), in_touch=False)
        assert (claim.state, claim.rival) == (ClaimState.WAITS, A)
    # It is back, and the other needs a moment longer to find it.
    claim.decide({}, 60.0)
    claim.decide({}, 60.0 + SETTLE_S)
    assert claim.state is ClaimState.WAITS
    claim.decide({A: ClaimState.PLANS}, 61.0)
    claim.decide({A: ClaimState.PLANS}, 61.0 + REJOIN_S)
    assert (claim.state, claim.rival) == (ClaimState.WAITS, A)
    # Who planned goes on, but for a moment in which it looks.
    claim = planning(A)
    claim.decide({}, 1.0, in_touch=False)
    assert not claim.is_uncertain(1.0)
    claim.decide({}, 6.0)
    assert claim.state is ClaimState.PLANS
    assert claim.is_uncertain(6.0)
    assert not claim.is_uncertain(6.0 + SETTLE_S)


def test_a_resumed_planner_is_silent_until_it_knows_who_plans():
    claim = planning(B)
    claim.decide({}, LEASE_S / 2)
    assert not claim.is_uncertain(LEASE_S / 2)
    woken = 3 * LEASE_S
    claim.decide({}, woken)
    assert claim.is_uncertain(woken)
    claim.decide({A: ClaimState.PLANS}, woken + 1.0)
    assert claim.state is ClaimState.YIELDS


def test_a_pause_shorter_than_the_lease_may_have_been_too_long():
    """The others count from the last sign of life, which may be a quarter of the lease older."""
    claim = planning(A)
    woken = CALM_S + 0.8 * LEASE_S
    claim.decide({}, woken)
    assert claim.is_uncertain(woken)


def test_the_word_for_the_active_one_is_the_roles_own():
    keys = ["x/driver/0a/drives", "x/driver/0b/waits", "x/driver/0c/yields"]
    stands = (ClaimState.PLANS, ClaimState.WAITS, ClaimState.YIELDS)
    assert claims_in(keys, "drives") == dict(zip((A, B, C), stands, strict=True))
    assert A not in claims_in(keys)


def test_only_what_is_a_claim_counts():
    keys = ["x/claim/0a/plans", "x/claim/0a/waits", "x/claim/0b/waits", "x/claim/0c/sleeps"]
    keys += ["x/claim/ZZ/plans", f"x/claim/{'a' * 33}/plans", "x/claim/\x1b[2J/plans"]
    assert claims_in(keys) == {A: ClaimState.PLANS, B: ClaimState.WAITS}


@pytest.mark.parametrize("seed", range(50))
def test_any_course_of_events_ends_with_one_planner(seed):
    """Daemons come, go, are cut off from each other and freeze; tokens come late."""
    rng = random.Random(seed)
    claims = {f"{number:x}": Claim(f"{number:x}") for number in range(1, 5)}
    seen = {own: {} for own in claims}
    now = 0.0
    for turn in range(400):
        now += 0.1
        settled = turn >= 150
        for own, claim in claims.items():
            for other, its in claims.items():
                if own != other and (settled or rng.random() < 0.1):
                    seen[own][other] = its.state
                if not settled and rng.random() < 0.01:
                    seen[own].pop(other, None)
            if settled or rng.random() < 0.9:
                claim.decide(dict(seen[own]), now, in_touch=settled or rng.random() < 0.95)
    assert [claim.state for claim in claims.values()].count(ClaimState.PLANS) == 1
