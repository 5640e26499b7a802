"""Of all that a robot's daemons send, the follower takes what the one that plans sends."""

import math

import pytest

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.follow.daemons import MOST_CLAIMS, MOST_DAEMONS, Daemons
from fasaco_edge.wire.keys import Keys
from tests.support.driven_base import named, status_of

A, B = "0a", "0b"


@pytest.fixture
def daemons():
    daemons = Daemons()
    claim(daemons, A)
    return daemons


def claim(daemons, own, stand="plans", is_there=True):
    daemons.take_claim(Keys().claim(own, stand), is_there)


def path(own, payload=b"path"):
    return Sample("path", payload, attachment=named(own) if own else b"")


@pytest.mark.parametrize(
    "status",
    [
        status_of(B),
        status_of(A, stand="waits"),
        status_of(A, stand="looks"),
        b"{}",
        b"[]",
        b"\xff",
        b'{"claim":7}',
        b'{"claim":{"id":["0a"],"stand":"plans"}}',
        b'{"claim":{"id":"0a","stand":["plans"]}}',
        b"[" * 100_000,
    ],
)
def test_no_other_status_is_a_sign_of_life(daemons, status):
    daemons.take_status(status, 1.0)
    assert daemons.news().status_at is None
    daemons.take_status(status_of(A), 2.0)
    daemons.take_status(status, 3.0)
    assert daemons.news().status_at == 2.0


def test_each_sample_is_news_once(daemons):
    daemons.take_status(status_of(A), 1.0)
    daemons.take_path(path(A))
    news = daemons.news()
    assert (news.planner, news.status_at, news.path) == (A, 1.0, path(A))
    news = daemons.news()
    assert (news.planner, news.status_at, news.path) == (A, None, None)


def test_a_path_that_comes_before_its_claim_waits_for_it(daemons):
    daemons.take_path(path(B))
    assert daemons.news().path is None
    claim(daemons, A, is_there=False)
    assert daemons.news().planner == ""
    claim(daemons, B)
    assert daemons.news().path == path(B)


def test_of_two_planners_the_smaller_id_counts(daemons):
    claim(daemons, B)
    daemons.take_path(path(B))
    assert (daemons.news().planner, daemons.news().path) == (A, None)


def test_a_flood_of_daemons_is_bounded_and_keeps_the_planner(daemons):
    daemons.take_path(path(A))
    for number in range(100 * MOST_DAEMONS):
        own = f"1{number:08x}"
        claim(daemons, own)
        daemons.take_path(path(own))
        daemons.take_status(status_of(own), 1.0)
    assert daemons.news().path == path(A)
    assert len(daemons._daemons) <= 2 * MOST_DAEMONS
    assert len(daemons._planners) <= MOST_CLAIMS
    # Some planned for a while.
    for is_there in (True, False):
        for number in range(3 * MOST_DAEMONS):
            claim(daemons, f"00{number:04x}", is_there=is_there)
    daemons.take_status(status_of(A), 1.0)
    news = daemons.news()
    assert (news.planner, news.status_at) == (A, 1.0)


@pytest.mark.parametrize("own", ["!x", "", "0A", "0a" * 17, "0a" * 100_000])
def test_an_invalid_id_takes_no_memory_and_not_the_planners_place(daemons, own):
    """The daemons ignore it, too: the one that plans goes on."""
    daemons.take_claim(f"fasaco/@v1/robot/claim/{own}/plans", True)
    daemons.take_status(status_of(own), 1.0)
    daemons.take_path(path(own))
    assert daemons._daemons == {}
    daemons.take_status(status_of(A), 1.0)
    news = daemons.news()
    assert (news.planner, news.status_at) == (A, 1.0)


@pytest.mark.parametrize(
    ("said", "speed_m_s"),
    [
        *(("0.15", 0.15), ("1", 1), ("null", math.inf), ("0", math.inf), ("-1", math.inf)),
        *(("true", math.inf), ('"fast"', math.inf), ("1e999", math.inf)),
    ],
)
def test_the_speed_of_a_path_is_a_number_above_zero_or_none(daemons, said, speed_m_s):
    attachment = f'{{"daemon":"{A}","revision":1,"speed_m_s":{said}}}'.encode()
    daemons.take_path(Sample("path", b"path", attachment=attachment))
    assert daemons.news().speed_m_s == speed_m_s
    daemons.take_path(path(A))
    assert daemons.news().speed_m_s == math.inf
