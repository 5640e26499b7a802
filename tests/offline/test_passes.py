"""Plans of several passes: where they run, from where to where, and what is wrong with others."""

import json
import re

import numpy as np
import pytest
from PIL import Image

import fasaco_edge as fe
from fasaco_edge.cli import main
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.passes import Pass
from fasaco_edge.planners.planner import WorkLimit
from tests.support.lanes import along_share

ENOUGH = WorkLimit(SearchWork(proposals=600_000))
ROBOT = fe.Robot()


def planned(map, *passes, **options):
    """Passes whose walks no clock ends; of the line there is the first stage."""
    search = fe.Search(budget_s=1e3)
    return fe.plan_passes(map, ROBOT, passes, stop=ENOUGH, search=search, **options)


@pytest.fixture(scope="module")
def flat():
    return planned(fe.load_map("flat"), "edge", "auto", "cross", line="quick", end="home")


def test_a_cross_pass_runs_across_the_lanes_before(flat):
    _, auto, cross = flat.plans
    for plan, angle_deg in ((auto, 0.0), (cross, 90.0)):
        assert plan.ground.lattice_deg == pytest.approx(0.0, abs=1.0)
        along = along_share(plan.xy, angle_deg)
        # Furniture and narrow rooms leave no longer lanes; without a direction it is 0.45.
        assert along > 0.55
        assert along > 2.2 * along_share(plan.xy, angle_deg + 90.0)


def test_an_edge_pass_keeps_to_the_walls(flat):
    edge, auto, _ = flat.plans
    assert 0.3 * auto.problem.cells < edge.problem.cells < 0.6 * auto.problem.cells
    assert np.array_equal(edge.problem.to_cover, edge.problem.to_cover & auto.problem.to_cover)
    assert edge.swept_share < 0.75 < auto.swept_share


def test_passes_are_joined_and_the_last_ends_at_home(flat):
    for before, after in zip(flat.plans, flat.plans[1:], strict=False):
        assert np.hypot(*(before.xy[-1] - after.xy[0])) < ROBOT.tool_width_m
    assert np.hypot(*(flat.xy[0] - flat.xy[-1])) < ROBOT.tool_width_m
    assert len(flat.xy) == sum(len(plan.xy) for plan in flat.plans)
    assert flat.floor.illegal_share == 0.0
    assert flat.floor.swept_share >= max(plan.swept_share for plan in flat.plans)


def test_figures_are_sums_and_those_of_each_pass(flat, tmp_path):
    told = json.loads(json.dumps(flat.figures))
    assert [each["pass"] for each in told["passes"]] == ["edge", "auto", "cross"]
    for name in ("steps", "cost_s", "length_m"):
        assert told[name] == pytest.approx(sum(each[name] for each in told["passes"]))
    seconds = sum(each["floor"]["seconds"] for each in told["passes"])
    assert told["floor"]["seconds"] == pytest.approx(seconds, abs=0.2)
    assert repr(flat).endswith(f" {told['floor']['seconds_per_m2']:.1f} s/m2, {flat.drive.time}>")
    swept_m2 = told["floor"]["swept_share"] * told["floor"]["reachable_m2"]
    assert told["floor"]["seconds_per_m2"] == pytest.approx(seconds / swept_m2, rel=1e-3)
    for plan in flat.plans:
        # Seconds alone, without the price of a step across.
        assert plan.cost_s == plan.problem.cost.without_prices.of_walk(plan.cells)
        assert plan.path.lower_bound_cost_s <= plan.cost_s
    flat.plot(tmp_path / "passes.png")
    with Image.open(tmp_path / "passes.png") as picture:
        assert picture.width > 2 * picture.height


def test_lanes_run_at_an_angle_of_the_map_frame_and_across_it():
    plans = planned(fe.load_map("office"), "30deg", "cross", line="quick").plans
    for plan, angle_deg in zip(plans, (30.0, 120.0), strict=True):
        assert plan.ground.lattice_deg == 30.0
        assert along_share(plan.xy, angle_deg) > 0.5


def test_lanes_overlap_as_a_pass_says():
    wide, narrow = planned(fe.load_map("office"), "auto%0", "auto%40", line="quick").plans
    assert narrow.problem.cells > 2 * wide.problem.cells
    with pytest.raises(BadConfiguration, match="pass 1 is a walk from cell to cell"):
        planned(fe.load_map(np.ones((6, 6), bool)), "auto%40")


def test_a_line_through_cells_has_passes_too():
    free = np.ones((12, 12), bool)
    plans = planned(fe.load_map(free), "edge", "rest", "cross", end="home").plans
    edge, rest, cross = (plan.problem.to_cover for plan in plans)
    assert (np.count_nonzero(edge), np.count_nonzero(rest), cross.all()) == (44, 100, True)
    assert plans[1].cells[0].tolist() == plans[0].cells[-1].tolist()
    assert plans[2].cells[-1].tolist() == plans[0].cells[0].tolist()
    assert np.count_nonzero(np.diff(plans[2].cells[:, 0])) > 0.8 * plans[2].steps


def test_lanes_need_the_search():
    with pytest.raises(BadConfiguration, match="only colony-search has a direction"):
        fe.plan(fe.load_map("office"), lanes="rows", search=fe.Search(planner="fasaco"))
    for options in ({"lanes": "up"}, {"covers": "half"}):
        with pytest.raises(BadConfiguration, match=next(iter(options))):
            fe.plan(fe.load_map("office"), **options)


@pytest.mark.parametrize(
    ("passes", "such"),
    [
        ("edge", "['edge'], got 'edge'"),
        ("rest,cross", "['rest', 'cross'], got 'rest,cross'"),
        # As --passes 2 of the command line.
        (2, "['edge', 'auto'], got 2"),
        ([1], "['edge', 'auto'], got [1]"),
        ([], "['edge', 'auto'], got []"),
    ],
)
def test_what_is_no_list_of_passes_is_named(passes, such):
    with pytest.raises(BadConfiguration, match=re.escape(f"must be a list such as {such}")):
        fe.plan_passes(fe.load_map("office"), passes=passes)


def test_a_slow_pass_takes_longer():
    usual, slow = planned(fe.load_map(np.ones((6, 6), bool)), "auto", Pass(speed_m_s=0.1)).plans
    assert slow.robot.speed_m_s == 0.1
    assert slow.cost_s > 1.5 * usual.cost_s


def test_the_command_writes_each_pass_with_its_number(tmp_path, capsys):
    walk, line = tmp_path / "walk.csv", tmp_path / "line.csv"
    words = ["--passes", "edge,auto", "--budget", "0.05", "--line", "quick"]
    files = ["--path-out", str(walk), "--xy-out", str(line), "--png", str(tmp_path / "p.png")]
    assert main(["plan", "office", *words, *files]) == 0
    told = capsys.readouterr().out
    assert "pass 1, edge: " in told
    assert "pass 2, auto: " in told
    assert walk.read_text().startswith("pass,row,col\n1,")
    rows = np.loadtxt(line, delimiter=",", skiprows=1)
    assert set(rows[:, 0].tolist()) == {1.0, 2.0}
    assert (tmp_path / "p.png").stat().st_size > 10_000
