"""What a stranger sees of a fleet on the screen."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from fasaco_edge.fleet.observer.observed import GONE_NS
from fasaco_edge.fleet.watch.screen import FleetPage
from fasaco_edge.fleet.watch.view import FleetView
from fasaco_edge.wire.limits import MAX_COORDINATE_M
from tests.fleet.watch.fleets import PARTS, say, tell, two_in_a_hall
from tests.watch.grids import NOW, console, plain, status
from tests.watch.test_page import SIZES


def page_of(view: FleetView, width: int = 100, height: int = 30, now: float = NOW) -> str:
    lines = FleetPage(console(width, colours=None)).lines(view, now, width, height)
    return "\n".join(plain(line) for line in lines)


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("colours", ["truecolor", "standard", None])
def test_a_page_fills_the_terminal_and_no_more(width, height, colours):
    crowd = two_in_a_hall()
    for number in range(40):
        say(crowd, f"robot-with-a-long-name-{number}", waits_for="robot-with-a-long-name-0")
    for view in (two_in_a_hall(), FleetView("house"), crowd):
        lines = FleetPage(console(width, colours=colours)).lines(view, NOW, width, height)
        assert len(lines) == height
        assert {cell_len(plain(line)) for line in lines} == {width}


def test_it_says_who_does_what():
    page = page_of(two_in_a_hall())
    for said in (
        " house   2 of 2 robots at work  1.0 % of cells",
        "swept m2 left m2",
        "a     covering",
        "b     waits for a",
        "1.0 % swept: 0.5 of 54.0 m2",
        "0.1 m2 swept by two or more",
        "division 7 by b",
        "division 7 by b, 2 parts",
        "a joined: covering",
    ):
        assert said in page, page


def test_robots_that_take_no_part_are_shown():
    view = two_in_a_hall()
    for away, words in (("stands", "(stands)"), ("gone", "(not received by others)")):
        others = [{"name": "a", "away": away}]
        tell(view, "b", "status", status(fleet={"name": "house", "members": others}))
        assert words in page_of(view)
    for name in ("a", "b"):
        say(view, name, NOW + 1, state="done")
    assert "DONE  0 of 2 robots at work" in page_of(view, now=NOW + 1)
    others = [{"name": "b", "away": "gone"}, {"name": "c", "away": "gone", "heard_s": 20.0}]
    later = NOW + 1 + 1e-9 * GONE_NS + 7.0
    say(view, "a", later)
    tell(view, "a", "status", status(fleet={"name": "house", "members": others}), later)
    view.tick(later)
    page = page_of(view, now=later)
    for said in ("1 of 2 robots at work", "b     gone for 12 s", "no messages: c"):
        assert said in page, page
    assert "all robots are gone" in page_of(view, now=later + 60.0)


def test_before_there_is_a_robot_other_fleets_are_named():
    view = FleetView("hous")
    say(view, "r1", fleet="house")
    assert "waiting for robots of this fleet; on this bus: house" in page_of(view)
    view.trouble = "tcp/127.0.0.1:7447: nobody listens"
    assert "waiting for the bus at tcp/127.0.0.1:7447" in page_of(view)


NUMBER = st.floats(-MAX_COORDINATE_M, MAX_COORDINATE_M)
PLACE = st.tuples(NUMBER, NUMBER)


@given(
    origin=st.tuples(NUMBER, NUMBER, st.floats(-360, 360)),
    at=PLACE,
    ahead=st.lists(PLACE, max_size=5),
    cells=st.lists(st.tuples(st.integers(-500, 500), st.integers(-500, 500)), max_size=5),
    cell_m=st.floats(1e-4, 100.0),
    lattice_deg=st.floats(-90, 90),
)
def test_a_robot_may_be_anywhere(origin, at, ahead, cells, cell_m, lattice_deg):
    view = two_in_a_hall()
    for robot in ("z", "a"):
        say(
            view, robot, NOW + 1, origin=origin, x=at[0], y=at[1], ahead=tuple(ahead), cells=cells,
            cell_m=cell_m, lattice_deg=lattice_deg, division=9, by="z", parts=PARTS,
        )  # fmt: skip
    view.tick(NOW + 1)
    assert len(page_of(view, 60, 20, NOW + 1).splitlines()) == 20
