"""Passes: what their texts mean, how they lie on lattices, and which cells they cover."""

import numpy as np
import pytest

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.cost import ANY_LANES, COLUMNS, ROWS
from fasaco_edge.planners.passes import (
    Laid,
    Pass,
    edge_cells,
    laid,
    read_pass,
    read_passes,
    wanted_by,
)


@pytest.mark.parametrize(
    ("text", "read", "name"),
    [
        ("auto", Pass(), ""),
        ("all", Pass(), ""),
        ("cross", Pass(lanes="cross"), "cross"),
        ("edge", Pass("edge"), "edge"),
        ("rest", Pass("rest"), "rest"),
        ("rest:cross", Pass("rest", "cross"), "rest cross"),
        ("-30deg", Pass(angle_deg=-30.0), "-30 degrees"),
        ("rest:22.5deg@0.2", Pass("rest", "auto", 22.5, 0.2), "rest 22.5 degrees"),
        ("edge@0.1", Pass("edge", speed_m_s=0.1), "edge"),
        ("cross%30@0.2", Pass("all", "cross", None, 0.2, 0.3), "cross 30 % overlap"),
    ],
)
def test_a_text_is_a_pass(text, read, name):
    assert read_pass(text) == read
    assert read_pass(text).name == name


NO_PASSES = ":cross 30 auto% nandeg deg cross@fast cross@nan walls:30 corner"


@pytest.mark.parametrize("text", ["", *NO_PASSES.split()])
def test_other_texts_are_refused_by_name(text):
    with pytest.raises(BadConfiguration, match="a pass is edge, rest, auto"):
        read_pass(text)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("361deg", "an angle is up to 360 deg, got '361deg'"),
        ("auto%51", "an overlap is 0 to 50 percent, got 'auto%51'"),
        ("cross@0", "a speed is above 0 and at most 10 m/s, got 'cross@0'"),
        ("auto@inf", "a speed is above 0 and at most 10 m/s, got 'auto@inf'"),
        ("101", "at most 100 passes, got 101"),
    ],
)
def test_a_number_out_of_range_is_refused_by_its_name(text, said):
    with pytest.raises(BadConfiguration, match=said):
        read_passes(text)


@pytest.mark.parametrize(
    ("passes", "lie"),
    [
        ("auto", [Laid()]),
        ("auto,auto", [Laid(), Laid()]),
        ("auto,cross", [Laid("all", ROWS), Laid("all", COLUMNS)]),
        ("edge,rest,cross", [Laid("edge"), Laid("rest", ROWS), Laid("all", COLUMNS)]),
        ("auto,edge,cross", [Laid("all", ROWS), Laid("edge"), Laid("all", COLUMNS)]),
        ("auto,cross,cross", [Laid("all", ROWS), Laid("all", COLUMNS), Laid("all", ROWS)]),
        ("auto%20,cross", [Laid("all", ROWS, None, 0.2), Laid("all", COLUMNS)]),
        ("30deg,cross,auto", [Laid("all", ROWS, 30.0), Laid("all", COLUMNS, 30.0), Laid()]),
    ],
)
def test_a_cross_pass_lies_across_the_last_lanes(passes, lie):
    assert laid([read_pass(each) for each in passes.split(",")]) == lie
    assert laid([Pass()])[0].lanes == ANY_LANES


@pytest.mark.parametrize(
    ("passes", "said"),
    [
        ([], "passes: must be 1 to 100, got 0"),
        ([Pass()] * 101, "passes: must be 1 to 100, got 101"),
        ([Pass(lanes="cross")], r"passes\[0\]: cross goes after a pass with lanes"),
        ([Pass("edge"), Pass(lanes="cross")], r"passes\[1\]: cross goes after a pass with lanes"),
        ([Pass("rest")], r"passes\[0\]: rest goes after an edge"),
        ([Pass(), Pass("rest"), Pass("edge")], r"passes\[1\]: rest goes after an edge"),
        ([Pass(), Pass("all", "cross", 9.0)], r"passes\[1\]: cross is an angle"),
        ([Pass("edge")], "edge alone leaves most of the floor"),
        ([Pass(), Pass("edge", angle_deg=30.0)], r"passes\[1\]: edge follows the walls"),
        ([Pass(), Pass("edge", overlap=0.3)], r"passes\[1\]: edge has no lanes that could overlap"),
    ],
)
def test_passes_that_do_not_go_together_are_refused(passes, said):
    with pytest.raises(BadConfiguration, match=said):
        laid(passes)


def test_edge_and_rest_are_all_reachable_cells():
    free = np.ones((7, 9), bool)
    free[3, 4] = False
    free[:, 8] = False
    free[6, 8] = True
    steps = CoverageLattice.from_free(free).steps
    reachable = free.copy()
    reachable[0, 0] = False
    edge, rest = (wanted_by(covers, steps, reachable) for covers in ("edge", "rest"))
    assert not (edge & rest).any()
    assert np.array_equal(edge | rest, wanted_by("all", steps, reachable))
    assert np.array_equal(edge, edge_cells(steps, reachable))
    # Inside the rim, all but the cells beside the pillar.
    inside = np.zeros(free.shape, bool)
    inside[1:6, 1:7] = True
    inside[[2, 4, 3, 3, 3], [4, 4, 3, 5, 4]] = False
    assert np.array_equal(rest, inside)
