"""Foreign coverage planners (peers): their installation, and their lines over a building's floor.

pip installs each peer into its own folder. It plans in its own process, so that it can crash or
search without end. Its input is the area for the robot's centre as a polygon with holes: the free
floor reduced by the robot's radius, with a simplified outline. Only the call of the peer is timed.
"""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.floor import RADIUS_M, TOOL_M

if TYPE_CHECKING:
    from fasaco_edge.grid.occupancy import OccupancyGrid

ROOT = Path(__file__).parents[2]
# Corners of the polygon are left out if it stays this near to them [m].
SIMPLIFIED_M = 0.05
# Time of Fields2Cover to search for an order of its swaths [s].
ORDER_S = 5
# Angle of the swaths to the walls [rad]: it finds none if a swath runs exactly along a side.
TILT = 1e-3
# Limits of an installation, which may compile, and of one line [s].
INSTALL_S, LINE_S = 1800, 300
SHAPELY = "shapely==2.2.0"

Points = NDArray[np.float64]
Ring = list[tuple[float, float]]


class Ground(NamedTuple):
    """What a peer is given.

    Attributes:
        rings: corners (x, y) [m] of the outline of the robot's places, then of its holes.
        start: x, y [m].
        walls_deg: direction of the walls.
    """

    rings: list[Ring]
    start: tuple[float, float]
    walls_deg: float


class Peer(NamedTuple):
    """A foreign planner.

    Attributes:
        requirement: what pip installs.
        line: returns a line (x, y) [m]; called in the peer's process.
        needs: what its installation needs beside pip.
    """

    requirement: str
    line: Callable[[Ground], Ring]
    needs: str = ""

    def folder(self, root: Path) -> Path:
        """Return where it is installed."""
        return root / self.requirement.replace("==", "-")


def _straight_lines(ground: Ground) -> Ring:
    """Return laps of ``coverage-path-planner`` along all borders, then lines at tool width."""
    planner = import_module("coverage_path_planner")
    outline, *holes = (
        planner.Polygon([planner.Point(x, y) for x, y in ring]) for ring in ground.rings
    )
    environment = planner.Environment(outline)
    for hole in holes:
        environment.addObstacle(hole)
    settings = planner.PathSettings()
    settings.pattern, settings.offset = "lines", TOOL_M
    settings.angle, settings.distanceToBorder = math.radians(ground.walls_deg), 0.0
    settings.mowArea = settings.mowBorder = settings.mowExclusionsBorder = True
    settings.borderLaps = settings.exclusionsBorderLaps = 1
    task = planner.PathService().computeFullTask(
        environment, settings, planner.Point(*ground.start)
    )
    return [(point.x, point.y) for point in task.path.getPoints()]


def _swaths(ground: Ground) -> Ring:
    """Return Fields2Cover's swaths along the walls, in the order that its router finds.

    Its rings along borders are no part of its routes; swaths therefore begin at the border.
    """
    f2c = import_module("fields2cover")
    cell = f2c.Cell()
    for ring in ground.rings:
        closed = [f2c.Point(x, y) for x, y in (*ring, ring[0])]
        cell.addRing(f2c.LinearRing(f2c.VectorPoint(closed)))
    cells = f2c.Cells(cell)
    angle = math.radians(ground.walls_deg) + TILT
    swaths = f2c.SG_BruteForce().generateSwaths(angle, TOOL_M, cells)
    router = f2c.RP_RoutePlannerBase()
    line = router.genRoute(cells, swaths, False, 1e-4, True, ORDER_S, True).asLineString()
    return [(line.getX(at), line.getY(at)) for at in range(line.size())]


OTHERS = {
    "coverage-path-planner": Peer("coverage-path-planner==1.4.0", _straight_lines),
    "fields2cover": Peer(
        "fields2cover==2.1.0",
        _swaths,
        "it is compiled from its sources, with GDAL, GEOS, TinyXML2, Eigen, TBB and Boost of the "
        "system, and fetches OR-tools and more from GitHub",
    ),
}


def default_folder() -> Path:
    """Return the folder for installed peers: in the user's cache."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(given) if os.path.isabs(given) else Path.home() / ".cache") / "fasaco-edge/peers"


def install(peer: Peer, root: Path) -> str:
    """Install a peer unless it is there; return why that is not possible, else ""."""
    folder = peer.folder(root)
    if folder.is_dir():
        return ""
    root.mkdir(parents=True, exist_ok=True)
    new, log = root / f"{folder.name}.new", root / f"{folder.name}.log"
    shutil.rmtree(new, ignore_errors=True)
    words = [sys.executable, "-I", "-m", "pip", "install", "--disable-pip-version-check"]
    # NumPy, which Shapely needs, is that of this environment.
    words += ["--no-input", "--no-deps", "--retries", "1", "--target", str(new)]
    try:
        done = subprocess.run(
            [*words, peer.requirement, SHAPELY],
            capture_output=True,
            text=True,
            timeout=INSTALL_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"pip is not done after {INSTALL_S} s"
    if done.returncode:
        log.write_text(done.stdout + done.stderr, encoding="utf-8")
        # Of a build the first thing that it could not find or fetch, else pip's own last word.
        found = re.findall(r"^\s*(could not .*)", done.stderr, re.IGNORECASE | re.MULTILINE)
        found += re.findall(r"error: .*", done.stderr, re.IGNORECASE)[-1:]
        return "; ".join([*found[:1], *([peer.needs] if peer.needs else []), f"see {log}"])
    new.rename(folder)
    return ""


class NoLineError(Exception):
    """A peer crashed, returned no line, or was not done in time."""


def line_of(name: str, root: Path, problem: dict[str, Any], limit_s: float) -> tuple[Points, float]:
    """Let a peer plan in a process of its own.

    Returns:
        The line, float64 (n, 2), and the processor time of planning [s].

    Raises:
        NoLineError: it did not.
    """
    paths = [str(OTHERS[name].folder(root)), str(ROOT)]
    try:
        done = subprocess.run(
            [sys.executable, "-m", "tests.benchmarks.peer_planners", name],
            input=json.dumps(problem),
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            capture_output=True,
            text=True,
            timeout=limit_s,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise NoLineError(f"no line within {limit_s:g} s") from error
    if done.returncode:
        said = done.stderr.strip().splitlines()[-1:] or ["nothing said"]
        raise NoLineError(f"exit code {done.returncode}: {said[0]}")
    # Libraries may print, too: the answer is the last line.
    answer = json.loads(done.stdout.splitlines()[-1])
    xy = np.array(answer["line"], np.float64).reshape(-1, 2)
    if len(xy) < 2:
        raise NoLineError("a line without a way")
    return xy, answer["seconds"]


def plan_as(name: str) -> None:
    """Plan as a peer, in its process: a problem of ``problem_of`` on standard input, to a line."""
    problem = json.load(sys.stdin)
    shapely = import_module("shapely")
    runs = np.array(problem["runs"], float)
    rows, firsts, ends = runs.T
    pixels = shapely.union_all(shapely.box(firsts, rows, ends, rows + 1))
    turned = import_module("shapely.affinity").affine_transform(pixels, problem["to_map"])
    area = turned.simplify(SIMPLIFIED_M)
    # Where places hang together by a corner alone, simplifying may part them.
    area = max(getattr(area, "geoms", [area]), key=lambda part: part.area)
    rings = [list(ring.coords)[:-1] for ring in (area.exterior, *area.interiors)]
    ground = Ground(rings, tuple(problem["start"]), problem["walls_deg"])
    began = time.process_time()
    line = OTHERS[name].line(ground)
    print("\n" + json.dumps({"line": line, "seconds": time.process_time() - began}))


def problem_of(
    truth: OccupancyGrid, start: tuple[float, float], walls_deg: float
) -> dict[str, Any]:
    """Return where the robot can be, as runs of pixels, and the rest of a peer's problem."""
    from fasaco_edge.grid.fine_raster import RobotDiscs
    from fasaco_edge.grid.floor import Floor
    from fasaco_edge.kernels.floor.bits import unpacked

    floor = Floor.around(truth, RobotDiscs(RADIUS_M, TOOL_M), start)
    places = unpacked(floor.places, floor.geometry.cols).astype(np.int8)
    edges = np.diff(places, axis=1, prepend=0, append=0)
    rows, firsts = np.nonzero(edges == 1)
    ends = np.nonzero(edges == -1)[1]
    geometry = floor.geometry
    (x, y), unit, yaw = geometry.to_map(0.0, 0.0), geometry.resolution, geometry.origin.yaw
    cos, sin = unit * math.cos(yaw), unit * math.sin(yaw)
    return {
        "runs": np.stack([rows, firsts, ends], axis=1).tolist(),
        "to_map": [cos, -sin, sin, cos, x, y],
        "start": start,
        "walls_deg": walls_deg,
    }


if __name__ == "__main__":
    plan_as(sys.argv[1])
