"""Page of results in Markdown: measurements, what they show about the paper, and its figures.

The figures show the walks of four planners on a grid, and the pheromone.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from fasaco_edge.bench.benchmark import MeasuredGoal, Report, ResultTable, machine
from fasaco_edge.planners.grids import NamedGrid, read_grid
from fasaco_edge.planners.path import walk_figures
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.harness import grid_name
from tests.benchmarks.pictures import LabelledWalk, draw_pheromone, draw_walks
from tests.benchmarks.table1.runs import VARIANTS, pose

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
    _save(draw_walks(walks, title=name, lines=[start_to_start]), files.walks)
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
    return LabelledWalk(DRAWN[variant], caption, problem.lattice, path.cells)


def _save(picture: Image.Image, file: Path) -> None:
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)


PHEROMONE = "pheromone after the last cohort"

COUNTS = """\
## What is counted

Every walk ends where it begins, but for the row that says otherwise. Three counts, each with a
name of its own:

- `revisits`: steps + 1 - distinct cells, that is visits beyond each cell's first.
- `recovered_cells`: distinct cells visited twice or more, which is what the paper's text defines.
- `n_r_paper`: entries of the path - distinct cells, as the authors' code counts. Our walks have
  no entry twice in succession, so from start to start `n_r_paper` is `revisits`.

Table I's figures for Spiral-STC and ZigZag, 109 and 487, 113 and 407 on the simulated map and the
basement, are larger than what the robot of the authors' own code has to drive, 80 and 249, 84 and
271 revisits: at each dead end that code walks to the nearest of the open cells and the start and
then searches again, every search adds its first cell to the path a second time, and cells that
cannot be reached steer the search (without them 487 becomes 420). Our two baselines follow the same
rules, but go from a dead end straight to the nearest open cell, so they need fewer. Part of
FaSACO's gain over them in Table I comes from this count; here all planners are counted alike. The
authors' ants add such entries at dead ends too, so that our FaSACO and ACO count less than theirs
is no proof of better ants. The `proven optimum` is that of a closed walk, by branch and cut.
"""

GRIDS = """\
`paper_simulated` and `paper_basement` are the paper's simulated map and basement, made of the maps
`grid` and `basement` of the authors' code (github.com/jynxmagic/FCPP-Survey, Apache-2.0): robot and
tool of 0.3 m radius, so cells of 0.6 m, start at the map's origin, unknown pixels free, a cell
occupied if one of its pixels is. On them that code gives the four baseline figures of Table I
exactly. They are made from the published maps, which are not in this repository: fetch `grid.yaml`,
`grid.png` (300 x 300 pixels), `basement.yaml` and `basement.png` (600 x 600) from the folder `maps`
of github.com/nobleo/full_coverage_path_planner, on which that code builds; then

```sh
python -m tests.benchmarks.table1.grids grid.yaml basement.yaml
```

compares their pixels with the SHA-256 it knows, and says which grid of the paper each is. No
setting tried gives the table's figures for the office, so the paper's office is missing here; its
map, `maps/full_148a_map.yaml` of the authors' code, can be tried with `--cell` and `--start-xy`.
The other grids are [this repository's maps](../../maps/README.md); they have nothing to do with the
paper's maps of the same names.
"""


def write_page(
    file: Path, command: str, report: Report, pictures: Sequence[GridPictures], missing: int
) -> None:
    """Write the page.

    Args:
        file: where to.
        command: what made it.
        report: what came out.
        pictures: to be shown, by links relative to ``file``.
        missing: how many runs were not made.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join(_parts(file, command, report, pictures, missing)), encoding="utf-8")


def _parts(
    file: Path, command: str, report: Report, pictures: Sequence[GridPictures], missing: int
) -> Iterator[str]:
    summary, *tables = report.tables
    grids, claims = tables[: len(report.rows)], tables[len(report.rows) :]
    yield "# FaSACO: Table I of the paper, measured\n"
    yield (
        "Carr and Wang, *Fast-Spanning Ant Colony Optimisation (FaSACO) for Mobile Robot Coverage "
        "Path Planning*, 2022. Made by\n"
    )
    yield f"```sh\n{command}\n```\n"
    yield _where()
    if missing:
        yield f"**Interrupted: {missing} runs are missing.**\n"
    yield f"## In short\n\n{summary.title}; medians.\n"
    yield _table(summary)
    yield from _verdicts(report)
    yield COUNTS
    yield f"## The grids\n\n{GRIDS}"
    yield "## Grid by grid\n"
    for remark in report.remarks[1:]:
        yield f"{remark}\n"
    for table in grids:
        yield f"### {table.title}\n\n{_table(table)}"
    if claims:
        yield "## Claims, grid by grid\n"
    for table in claims:
        yield f"{_heading(table.title)}\n\n{_table(table)}"
    yield from _bars(report.goals)
    yield from _figures(file, pictures)


def _where() -> str:
    made = machine()
    return (
        f"on {made['processor']}, {made['cores']} cores, load {made['load_1min']} over a minute, "
        f"Python {made['python']}, fasaco-edge {made['version']}. Counts are the same on every "
        "machine; times are not.\n"
    )


def _verdicts(report: Report) -> Iterator[str]:
    yield (
        f"## The paper's claims\n\n{report.remarks[0]} The first four are the paper's; the others "
        "say how much of them is left against an ACO with as many global updates as FaSACO.\n"
    )
    for number, (claim, verdict) in enumerate(report.figures["verdicts"].items(), start=1):
        yield f"{number}. **{claim}.** {verdict}"
    yield ""


def _bars(goals: Sequence[MeasuredGoal]) -> Iterator[str]:
    if not goals:
        return
    verdicts = {True: "met", False: "missed", None: "not measured"}
    rows = [
        (
            goal.what,
            "-" if goal.measured is None else f"{goal.measured:g}",
            f"{goal.limit:g}",
            verdicts[goal.met],
        )
        for goal in goals
    ]
    yield (
        "## Bars\n\n"
        "FaSACO's is Table I's own figure; those of Spiral-STC and ZigZag are what the robot of "
        "the authors' code drives.\n"
    )
    yield _table(ResultTable("", ("", "measured", "at most", ""), tuple(rows)))


def _figures(file: Path, pictures: Sequence[GridPictures]) -> Iterator[str]:
    if not pictures:
        return
    yield (
        "## Figures\n\n"
        "Walks keep to the right, so that there and back are two lines; arrow heads show the "
        "robot's orientation.\n"
    )
    for drawn in pictures:
        for picture, what in (
            (drawn.walks, "walks of four planners"),
            (drawn.pheromone, PHEROMONE),
        ):
            link = os.path.relpath(picture.absolute(), file.absolute().parent)
            yield f"![{drawn.grid}: {what}]({Path(link).as_posix()})\n"


def _heading(text: str) -> str:
    return text[:1].upper() + text[1:]


def _table(table: ResultTable) -> str:
    """Return a table in Markdown; its second and further columns to the right."""
    rules = ("---", *("---:" for _ in table.header[1:]))
    header = tuple(" ".join(name.split()) for name in table.header)
    rows = (header, rules, *map(_emphasised, table.rows))
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _emphasised(row: tuple[str, ...]) -> tuple[str, ...]:
    """Return a row that heads others, with nothing beside its first cell, in bold."""
    return (f"**{row[0]}**", *row[1:]) if not any(row[1:]) else row
