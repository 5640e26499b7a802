"""Warming up compiles all that a mission needs: nothing is compiled while a robot waits."""

import importlib
import pickle
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.kernels.folder import KERNEL_SOURCES, kernel_module
from fasaco_edge.kernels.manifest import chosen_folder
from fasaco_edge.mission.config import Sweeping
from fasaco_edge.mission.core.mission import Mission, MissionConfig
from fasaco_edge.mission.events import (
    CommandReceived,
    MapReceived,
    PatchReceived,
    PlanReady,
    PoseReceived,
    State,
)
from fasaco_edge.mission.line.laying import lay
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.planners.compiling import compile_missing, warm_up
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.line import LINES
from fasaco_edge.planners.paper.fasaco import Fasaco
from fasaco_edge.planners.path import walk_figures
from fasaco_edge.planners.planner import WorkLimit
from fasaco_edge.planners.search.near_optimal import NearOptimal
from fasaco_edge.planners.stages import STAGES, stages_of_plan
from fasaco_edge.wire.messages.maps import (
    decode_map_update,
    decode_occupancy_grid,
    encode_map_update,
    encode_occupancy_grid,
)
from tests.mission.line_robot import LineRobot
from tests.support.processes import ENVIRONMENT

# Kernels that take less than half a second to compile for a constant, too.
SMALL = {
    *("baselines._add", "holes._has", "line.prepare_edges", "nearest._quarters"),
    *("reorder._square", "repair._begin"),
}


def compiled_signatures() -> set[str]:
    modules = [
        importlib.import_module(f"fasaco_edge.kernels.{kernel_module(source)}")
        for source in KERNEL_SOURCES
    ]
    return {
        f"{name}{signature}"
        for module in modules
        for name, kernel in vars(module).items()
        for signature in getattr(kernel, "signatures", ())
    }


def changes(grid: OccupancyGrid) -> Iterator[MapReceived | PatchReceived]:
    """An update, a map with another pixel, one that has grown, and one that has moved."""
    update = MapPatch(Window(30, 30, 32, 32), np.full((2, 2), 100, np.int8))
    yield PatchReceived(decode_map_update(encode_map_update(update)))
    cells = grid.cells.copy()
    cells[-5, 3] = 100
    wider = np.pad(cells, ((0, 9), (0, 7)), constant_values=-1)
    for pixels, x in ((cells, 0.0), (wider, 0.0), (wider, 0.02)):
        placed = GridGeometry(*pixels.shape, 0.05, Pose2D(x, 0.0))
        payload = encode_occupancy_grid(OccupancyGrid(placed, pixels))
        yield MapReceived(decode_occupancy_grid(payload))


@pytest.mark.parametrize(
    ("turn_s", "sweeping"),
    [(0.0, None), (1.5, None), (1.5, Sweeping(0.3, 1_000_000, LINES["thorough"]))],
)
def test_a_mission_with_decoded_maps_compiles_nothing_new(turn_s, sweeping):
    heard = []
    warm_up(heard.append)
    assert heard == list(STAGES)
    before = compiled_signatures()

    # A room in which no bound proves the first walk: the search has to go on.
    pixels = np.zeros((80, 80), np.int8)
    for row, col in ((18, 20), (22, 50), (47, 8), (50, 33), (44, 62), (68, 46)):
        pixels[row : row + 5, col : col + 9] = 100
    grid = OccupancyGrid(GridGeometry(80, 80, 0.05, Pose2D(0, 0)), pixels)
    off_the_bus = decode_occupancy_grid(encode_occupancy_grid(grid))
    cost = CoverageCost.for_robot(0.3, 0.25, turn_s)
    mission = Mission(MissionConfig(Footprint(0.3, 0.18), cost=cost, sweeping=sweeping))
    pose = PoseReceived(StampedPose(Pose2D(1.0, 1.0)))
    asked = mission.step([MapReceived(off_the_bus), pose], 0.0).plan
    assert asked is not None
    path = NearOptimal().plan(asked.problem, WorkLimit(SearchWork(perturbations=5)))
    assert path.work.perturbations >= 5 or not turn_s  # steps alone are soon proven
    answer = mission.step([PlanReady(asked.number, path, 0.0)], 0.0)
    assert answer.path is not None
    assert mission.coverage() is not None
    walk_figures(asked.problem.lattice, path.cells)
    again = replace(asked.problem, before=path.cells[::-1].copy())
    assert NearOptimal().plan(again, WorkLimit(SearchWork(perturbations=5))).steps
    assert Fasaco().plan(asked.problem).steps
    if (ahead := mission.line._ahead) is not None:
        walk = mission.route.path.ahead
        better = np.concatenate((walk, walk[-2:-1]))
        better.flags.writeable = False  # as a plan's cells
        lay(ahead, better, pose.pose.pose)
        lay(ahead, walk, pose.pose.pose)
    for event in changes(off_the_bus):
        assert mission.step([event, pose], 1.0).faults == ()
        assert mission.coverage() is not None

    assert compiled_signatures() == before


def test_an_order_of_a_zone_compiles_nothing_new_up_to_its_end():
    """The masks of zones are read-only, which is another type of array to numba."""
    warm_up(lambda stage: None)
    before = compiled_signatures()
    pixels = np.zeros((40, 60), np.int8)
    pixels[[0, -1]], pixels[:, [0, -1]] = 100, 100
    robot = LineRobot(pixels, (1.0, 1.0))
    corners = [[0.5, 0.5], [1.6, 0.5], [1.6, 1.6], [0.5, 1.6]]
    order = read_order({"zones": [{"name": "rug", "polygon": corners, "passes": ["edge", "rest"]}]})
    robot.step(CommandReceived(1, "start", order, discard=True))
    assert robot.wait(300.0, lambda robot: robot.mission.state is State.DONE)
    assert "of the zones is covered" in robot.mission.reason
    assert compiled_signatures() == before


def test_no_kernel_is_compiled_for_a_constant_and_its_type_too():
    """``f(0)`` and ``f(n)`` are two kernels to numba: ``as_value(0)`` saves one."""
    compile_missing()
    folder, _ = chosen_folder(STAGES)
    twice = set()
    for index in folder.glob("*.nbi"):
        with index.open("rb") as file:
            pickle.load(file)  # numba's version
            _, overloads = pickle.loads(file.read())
        signatures = [str(signature) for signature, *_ in overloads]
        plain = {re.sub(r"Literal\[int\]\(-?\d+\)", "int64", each) for each in signatures}
        if len(plain) < len(signatures):
            twice.add(index.name.partition("-")[0])
    assert twice <= SMALL


PLAN = """
import fasaco_edge as fe
from fasaco_edge.planners.stages import stages_of_plan
from fasaco_edge.planners.warmup import TinyRoom, run_stage
from tests.planners.test_warmup import compiled_signatures
room = TinyRoom()
for stage in stages_of_plan("colony-search"):
    run_stage(stage, room)
before = compiled_signatures()
fe.plan(fe.load_map("flat"))
print(*sorted(compiled_signatures() - before))
"""


def test_a_plan_needs_no_more_than_its_stages():
    """They are compiled first, so that the first plan comes soon."""
    assert set(stages_of_plan("colony-search")) < set(STAGES)
    words = [sys.executable, "-c", PLAN]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("\n", "")


@pytest.mark.parametrize(("kernel", "most"), [("line.gain_above", 2), ("search.solve_windows", 1)])
def test_a_large_kernel_is_not_compiled_for_each_constant(kernel, most):
    compile_missing()
    folder, _ = chosen_folder(STAGES)
    assert 1 <= len(list(folder.glob(f"{kernel}-*.nbc"))) <= most
