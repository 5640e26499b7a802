"""Who is shown to sweep what: the division in force among the robots of a fleet that are there."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.fleet.observer.observed import GONE_NS, ObservedFleet
from fasaco_edge.fleet.observer.survey import NOBODY, owners_of, survey_of
from fasaco_edge.grid.geometry import Window
from fasaco_edge.wire.documents.fleet import FleetPart
from tests.fleet.told import member

SECOND = 1_000_000_000
HALL = 20 * 30
PARTS = tuple(FleetPart(name, *cell, 0.0, 1.2) for name, cell in (("a", (0, 0)), ("b", (19, 29))))


@pytest.fixture
def halved():
    members = ObservedFleet()
    assert survey_of(members, 0).geometry is None
    for name in ("a", "b"):
        members.receive(name, member(division=7, by="a", parts=PARTS), SECOND)
    return members


def test_the_last_robot_has_all_remaining_cells(halved):
    swept = [(0, col) for col in range(30)]
    now = SECOND + GONE_NS + 1
    halved.receive("b", member(cells=swept, division=8, by="b"), now)
    assert (+survey_of(halved, now).left) == {"b": HALL - 30}


def test_a_new_robot_without_a_division_changes_nothing(halved):
    halved.receive("c", member(division=0), SECOND)
    assert (+survey_of(halved, SECOND).left).keys() == {"a", "b"}


def test_a_division_of_a_gone_robot_is_not_valid(halved):
    halved.receive("c", member(division=9, by="c", parts=(FleetPart("c", 0, 0, 0.0, 1.2),)), SECOND)
    now = SECOND + GONE_NS
    for name in ("a", "b"):
        halved.receive(name, member(division=8, by="b", parts=PARTS), now)
    assert (+survey_of(halved, now).left) == {"c": HALL}
    assert (+survey_of(halved, now + 1).left).keys() == {"a", "b"}
    # Once all are gone the last division stays drawn.
    assert (+survey_of(halved, now + GONE_NS + 1).left) == {"c": HALL}


def test_cells_beyond_the_search_limit_have_no_owner(halved):
    telling = halved.dividing(SECOND)
    window = Window(0, 0, 20, 30)
    known = np.ones((20, 30), np.bool_)
    owners = owners_of(telling, halved, known, window, 10)
    # Both together: the second one has what the first one leaves.
    assert np.count_nonzero(owners == 0) == 11 * 12 // 2
    assert np.count_nonzero(owners == 1) <= 3
    assert (owners_of(telling, halved, known, window) != NOBODY).all()
