"""No command forgets what is covered unless it says so: the refusal says how much."""

import pytest

from fasaco_edge.errors import WouldForget
from fasaco_edge.mission.events import MapReceived
from tests.mission.world import building, idle, rectangle, started

ROOM = ("........",) * 6
EAST = {"zones": [{"name": "east", "polygon": rectangle(0, 6, 6, 8)}]}
OTHER = {"passes": 2}


def covering(cells=12):
    drive = started(*ROOM)
    while len(drive.visited) < cells:
        drive.go()
    return drive


def refused(drive, name, order=None):
    """Give a command that does not say so; return why it is refused, None if it is not."""
    state, covered, path = drive.mission.order_state, drive.visited, drive.mission.route.path
    decision = drive.command(name, order, discard=False)
    if drive.refused is None:
        return None
    assert isinstance(drive.refused, WouldForget)
    assert drive.mission.order_state == state
    assert drive.visited == covered
    assert drive.mission.route.path is path
    assert (decision.path, decision.plan, decision.forgotten) == (None, None, False)
    return str(drive.refused)


def test_another_order_says_how_much_it_would_forget():
    drive = covering(12)
    # The cell under the tool stays covered.
    said = "start forgets 11 covered cells (0.7 m2), 23 % of the floor in reach"
    assert refused(drive, "start", OTHER) == said
    assert "11 covered cells" in refused(drive, "start", {"keep_out": [rectangle(4, 4, 5, 5)]})
    drive.command("start", OTHER, discard=True)
    assert drive.refused is None
    assert drive.visited == {drive.cell}


def test_a_reset_says_how_much_it_would_forget():
    drive = covering(2)
    said = "reset forgets 1 covered cell (0.1 m2), 2 % of the floor in reach"
    assert refused(drive, "reset") == said
    drive.command("reset", discard=True)
    assert drive.visited == {drive.cell}
    assert refused(drive, "reset") is None, "there is nothing left to forget"


@pytest.mark.parametrize(
    "order", [None, {"keep_covered": True}, {**OTHER, "keep_covered": True}, EAST]
)
def test_an_order_that_forgets_nothing_needs_no_consent(order):
    drive = covering(6)
    covered = drive.visited
    assert refused(drive, "start", order) is None
    assert covered <= drive.visited


def test_coverage_of_a_cancelled_order_is_forgotten_by_consent():
    drive = covering(12)
    assert refused(drive, "cancel") is None
    assert "11 covered cells" in refused(drive, "start")
    assert refused(drive, "start", {"keep_covered": True}) is None


def test_a_finished_order_needs_no_consent():
    drive = started(*ROOM)
    drive.finish()
    assert refused(drive, "start", OTHER) is None
    assert drive.visited == {drive.cell}


def test_a_robot_that_only_stands_there_loses_nothing():
    drive = idle(*ROOM)
    assert drive.visited == {(0, 0)}
    assert refused(drive, "start") is None


def test_before_there_is_a_map_all_that_was_covered_counts():
    again = covering(12).restarted()
    again.command("start", OTHER, discard=False)
    assert str(again.refused) == "start forgets 11 covered cells (0.7 m2)"


@pytest.mark.parametrize("at", [(0, 0), (40, 40)])
def test_covered_cells_beyond_a_smaller_map_count(at):
    """A mapper that begins again shows little at first."""
    drive = covering(12)
    drive.tell(MapReceived(building("..", "..", at=at)))
    assert "reset forgets 11 covered cells (0.7 m2)" in refused(drive, "reset")
    assert "start forgets 11 covered cells (0.7 m2)" in refused(drive, "start", OTHER)


def test_covered_cells_of_a_zone_beyond_the_map_count():
    drive = covering(12)
    drive.tell(MapReceived(building("..", "..")))
    west = {"zones": [{"name": "west", "polygon": rectangle(0, 0, 6, 3)}]}
    inside = [cell for cell in drive.visited | set(drive.driven) if cell[1] < 3]
    assert 2 < len(inside) < 11
    assert drive.cell not in inside
    assert f"start forgets {len(inside)} covered cells" in refused(drive, "start", west)


def test_a_small_share_is_never_reported_as_nothing():
    """A share never rounds to nothing."""
    drive = started(*("." * 20,) * 20)
    drive.go(times=2)
    assert "2 covered cells (0.1 m2), less than 1 % of the floor" in refused(drive, "reset")
