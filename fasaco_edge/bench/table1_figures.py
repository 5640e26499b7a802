"""The paper's figures: the walks of four planners on a grid, and the pheromone."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from fasaco_edge.bench.grids import NamedGrid, read_grid
from fasaco_edge.bench.table1_runs import VARIANTS, grid_name, pose
from fasaco_edge.drawing import LabelledWalk, draw_pheromone, draw_walks
from fasaco_edge.planners.observation import ColonySnapshot
from fasaco_edge.planners.path import walk_figures
from fasaco_edge.planners.problem import CoverageProblem

DRAWN = {
    "falling": "FaSACO, 8 -> 1",
    "velocity-1": "ACO",
    "spiral-stc": "Spiral-STC",
    "zigzag": "ZigZag",
}
# Of the runs that are drawn, the first; a walk is known by its seed and its ants.
SEED = 0
# More colours than the eye tells apart in these, at a third of the size.
COLOURS = 256


@dataclass(frozen=True, slots=True)
class GridPictures:
    """The files of one grid's pictures."""

    grid: str
    walks: Path
    pheromone: Path


def draw(
    folder: Path,
    grids: Sequence[str],
    wanted: Collection[str],
    measured: Collection[str],
    ants: int,
) -> tuple[GridPictures, ...]:
    """Draw the grids that were measured and, if any are named, ``wanted``; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    names = {grid_name(grid): grid for grid in grids}
    return tuple(
        _draw(folder, name, read_grid(grid), ants)
        for name, grid in names.items()
        if name in measured and (not wanted or name in wanted)
    )


def _draw(folder: Path, name: str, grid: NamedGrid, ants: int) -> GridPictures:
    problem = pose(grid)
    snapshots: list[ColonySnapshot] = []
    walks = [_walk(problem, variant, ants, snapshots) for variant in DRAWN]
    files = GridPictures(name, folder / f"{name}.png", folder / f"{name}_pheromone.png")
    start_to_start = f"{problem.cells} cells, start to start, {ants} ants, seed {SEED}"
    _save(draw_walks(grid.lattice, walks, title=name, lines=[start_to_start]), files.walks)
    last = snapshots[len(VARIANTS["falling"].velocities) - 1]
    picture = draw_pheromone(
        grid.lattice,
        last,
        title=f"{name}: pheromone after the last cohort",
        lines=[
            f"FaSACO, 8 -> 1, {ants} ants, seed {SEED}",
            "mean over the moves into a cell",
        ],
    )
    _save(picture, files.pheromone)
    return files


def _walk(
    problem: CoverageProblem, variant: str, ants: int, snapshots: list[ColonySnapshot]
) -> LabelledWalk:
    path = VARIANTS[variant].plan(problem, ants, SEED, snapshots.append)
    figures = walk_figures(problem.lattice, path.cells)
    caption = (
        f"{figures.steps} steps, {figures.revisits} revisits, {figures.turns_90} quarter-turns"
    )
    return LabelledWalk(DRAWN[variant], caption, path.cells)


def _save(picture: Image.Image, file: Path) -> None:
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
