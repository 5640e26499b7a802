"""The lab's judge, on tracks and paths whose figures are known."""

import math

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.core.path_exit import PublishedPath

pytest.importorskip("karto_scanmatcher", reason="needs the extra 'lab'")
pytestmark = pytest.mark.filterwarnings("default")


@pytest.fixture(scope="module", autouse=True)
def _simulator():
    pytest.importorskip("irsim", reason="needs the extra 'lab'")


def hall():
    from tests.campaigns.lab.halls import hall

    return hall()


def run_of(rows, paths=(), state="covering", left_m2=0.0, floor=None, people=None):
    """A run with these ticks (x, yaw, speed, turn rate, touches, done).

    In the ticks of ``people`` one is touched: 2 ahead of the robot, 1 not.
    """
    from tests.campaigns.lab.mission import LabRun, Trace
    from tests.campaigns.lab.product import ProductReport
    from tests.campaigns.lab.settings import TICK_S, LabSettings

    people = people or {}
    full = [
        (
            (i + 1) * TICK_S,
            x,
            0.5,
            yaw,
            speed,
            turn,
            1.0,
            touches,
            x + 0.03,
            0.54,
            yaw,
            done,
            people.get(i, 0),
        )
        for i, (x, yaw, speed, turn, touches, done) in enumerate(rows)
    ]
    reply = {"state": state, "reason": "", "coverage": {"fraction": 0.5}}
    reply["floor"] = {"reachable_m2": 4.0, "left": [{"m2": left_m2, "reason": ""}]}
    return LabRun(
        hall(), LabSettings(), Trace(full, list(paths)), ProductReport(reply, floor, None, 0, {})
    )


def drive(ticks, x=0.5, speed=0.2):
    return [(x + i * 0.05 * speed, 0.0, speed, 0.0, False, False) for i in range(1, ticks + 1)]


def stand(ticks, x, done=False, wheels=0.0):
    return [(x, 0.0, wheels, 0.0, False, done)] * ticks


def figures_of(run):
    from tests.campaigns.lab.judge import judge, truth_of

    return judge(run, truth_of(run))


def test_reachable_and_swept_floor_are_those_of_the_discs():
    from tests.campaigns.lab.truth import Truth

    xy = np.stack([np.linspace(0.5, 3.5, 301), np.full(301, 0.5)], axis=1)
    half = OccupancyGrid(GridGeometry(1, 2, 2.0, Pose2D(0.0, 0.0)), np.array([[100, 0]], np.int8))
    truth = Truth.of(hall(), 0.18, 0.3, xy, half)
    # The tool comes no nearer to the walls than 0.03 m, and not into the corners.
    corners = (4.0 - math.pi) * 0.15**2
    assert truth.m2(truth.reachable) == pytest.approx(3.94 * 0.94 - corners, rel=0.02)
    assert truth.m2(truth.swept) == pytest.approx(3.0 * 0.3 + math.pi * 0.15**2, rel=0.01)
    assert truth.m2(truth.claimed & truth.free) == pytest.approx(2.0, rel=0.01)
    assert truth.m2(truth.clear) == pytest.approx(3.84 * 0.84 - corners, rel=0.02)
    assert truth.share(truth.reachable) == pytest.approx(0.97 / 3.68, rel=0.03)


def test_figures_of_driving_turning_and_contacts():
    rows = drive(200)
    rows += [(2.5, 0.05 * i, 0.0, 1.0, False, False) for i in range(100)]
    rows += [(x, 5.0, speed, 0.0, 20 <= i < 40 or i >= 80, False)
             for i, (x, _, speed, *_) in enumerate(drive(100, x=2.5))]  # fmt: skip
    figures = figures_of(run_of(rows, left_m2=1.0))
    assert figures.driven_m == pytest.approx(3.0, abs=0.02)
    assert figures.turning_share == pytest.approx(0.25, abs=0.01)
    assert figures.speed_share == pytest.approx(3.0 / 20.0 / 0.35, rel=0.02)
    assert figures.stops_per_m == pytest.approx(1 / 3, rel=0.02)
    assert (figures.contacts, figures.contact_s) == (2, pytest.approx(2.0))
    assert figures.pose_error_median_m == pytest.approx(0.05)
    assert figures.claimed_share == pytest.approx(0.75)
    assert figures.ending == "at the limit"


def test_spinning_wheels_are_a_deadlock_unlike_a_done_mission():
    spins = figures_of(run_of([*drive(100), *stand(1400, 1.5, wheels=0.3)]))
    assert spins.ending == "deadlock"
    assert spins.longest_stand_s == pytest.approx(70.0, abs=1.0)
    rests = figures_of(run_of([*drive(100), *stand(1400, 1.5, done=True)], state="done"))
    assert rests.ending == "false done"
    assert rests.longest_stand_s <= 1.0


def path(*points):
    return PublishedPath("map", "", 1, np.array(points, float).reshape(-1, 2))


@pytest.mark.parametrize(
    ("before", "after", "changes"),
    [
        ([(0, 0), (4, 0)], [(1, 0), (4, 0)], False),
        ([(0, 0), (4, 0)], [(1, 0.02), (4, 0.02)], False),
        ([(0, 0), (4, 0)], [(1, 0), (3.2, 0), (3.2, 2)], False),
        ([(0, 0), (4, 0)], [(1, 0), (2.5, 0), (2.5, 2)], True),
        ([(0, 0), (4, 0)], [(1, 0), (2, 0)], True),
        ([(0, 0), (1.5, 0)], [(1, 0), (4, 0)], False),
        ([(0, 0), (4, 0)], [], True),
        ([], [(1, 0), (4, 0)], True),
        ([], [], False),
        ([(0, 0), (3, 0), (3, 0.3), (0, 0.3)], [(1, 0), (3, 0), (3, 0.3), (0, 0.3)], False),
    ],
)
def test_a_path_changes_what_lies_ahead_of_the_robot(before, after, changes):
    from tests.campaigns.lab.path_changes import changes_ahead

    x = np.linspace(0.0, 1.0, 101)
    paths = [(0, path(*before)), (100, path(*after))]
    assert list(changes_ahead(paths, x, np.zeros(101))) == [changes]


def test_people_who_hit_a_standing_robot_are_not_driven_into():
    rows = [*drive(100), *stand(100, 1.5), *drive(100, 1.5)]
    ahead, behind = [*range(20, 25), *range(120, 125), *range(150, 180)], range(260, 262)
    people = dict.fromkeys(ahead, 2) | dict.fromkeys(behind, 1)
    found = figures_of(run_of(rows, people=people))
    assert (found.people_touched, found.driven_into) == (4, 1)
