"""Cancellations: each second until the server confirms them, or knows the goal no more."""

import pytest

from fasaco_edge.follow.nav2_node import MOST_CANCELLED, Cancellations
from fasaco_edge.wire.messages.nav2_goals import ENDED_BEFORE, NO_SUCH_GOAL, REJECTED, TAKEN


@pytest.fixture
def cancellations():
    cancellations = Cancellations()
    cancellations.take_sent(b"a")
    return cancellations


@pytest.mark.parametrize("answer", [TAKEN, NO_SUCH_GOAL, ENDED_BEFORE, REJECTED, None])
@pytest.mark.parametrize("accepted", [True, None])
def test_a_goal_is_cancelled_each_second_until_confirmed(cancellations, answer, accepted):
    """Also one whose answer was lost."""
    cancellations.take_accepted(b"a", accepted)
    cancellations.add(b"a")
    assert [cancellations.due(now) for now in (5.0, 5.9, 6.0)] == [[b"a"], [], [b"a"]]
    cancellations.take_answer(b"a", answer)
    assert cancellations.are_open == (answer in (REJECTED, None))


def test_a_goal_unknown_to_the_server_is_cancelled_again(cancellations):
    """The server may not know it yet when the request to cancel comes."""
    cancellations.add(b"a")
    assert cancellations.due(5.0) == [b"a"]
    cancellations.take_answer(b"a", NO_SUCH_GOAL)
    cancellations.take_accepted(b"a", True)
    assert cancellations.due(5.1) == [b"a"]
    cancellations.take_answer(b"a", TAKEN)
    assert not cancellations.are_open


@pytest.mark.parametrize("ends", [lambda c: c.take_accepted(b"a", False), lambda c: c.drop(b"a")])
def test_a_goal_that_was_refused_or_has_ended_is_not_cancelled(cancellations, ends):
    cancellations.add(b"a")
    ends(cancellations)
    assert cancellations.due(9.0) == []


def test_without_answers_cancellations_are_bounded(cancellations):
    for number in range(500):
        cancellations.add(bytes([number % 250, number // 250]))
    assert len(cancellations.due(0.0)) == MOST_CANCELLED
