"""Floor left at the end of a path: what of it is worth coming back for."""

from __future__ import annotations

from fasaco_edge.mission.line.missed_floor import MissedFloor

# A cell takes a second to drive through, as much as 0.01 m2 are worth.
MISSED = MissedFloor(speed_m_s=0.25, price_s_m2=100.0, least_s=4.0)
CELL_M = 0.25


def taken(areas_m2, here=(0, 0), may_take=lambda cell: True):
    return MISSED.worth_the_way(areas_m2, here, CELL_M, may_take)


def test_floor_is_worth_a_way_that_takes_less_than_its_price():
    assert taken({(0, 5): 0.11}) == [(0, 5)]
    assert taken({(0, 5): 0.09}) == []
    assert taken({(0, 15): 0.11}) == []


def test_a_strip_over_many_cells_is_worth_the_sum_of_its_floor():
    strip = {(0, col): 0.03 for col in range(5, 10)}
    assert taken(strip) == sorted(strip)
    assert taken({(0, 5): 0.03}) == []
    assert taken(strip | {(0, 10): 0.005}) == sorted(strip), "less than driving through takes"


def test_from_what_is_come_back_for_the_next_piece_is_nearer():
    near, far = {(0, 10): 0.2}, {(0, 20): 0.16}
    assert taken(far) == []
    assert taken(near | far) == [(0, 10), (0, 20)]


def test_what_may_not_be_taken_any_more_is_left():
    assert taken({(0, 5): 0.2, (0, 6): 0.2}, may_take=lambda cell: cell != (0, 5)) == [(0, 6)]
