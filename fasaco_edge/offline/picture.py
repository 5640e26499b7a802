"""The picture of a plan: the line over the map, the floor that it leaves, and the figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PIL import Image

from fasaco_edge.drawing.pictures import draw_walk
from fasaco_edge.drawing.plot import MapLayer
from fasaco_edge.offline.figures import velocities_of
from fasaco_edge.offline.settings import CELLS
from fasaco_edge.planners.path import walk_figures

if TYPE_CHECKING:
    from fasaco_edge.offline.plan import Plan


def picture_of(plan: Plan) -> Image.Image:
    """Return a picture, RGB, of a plan."""
    path, ground, judged = plan.path, plan.ground, plan.judged
    ants = path.work.ants
    counted = "1 ant" if ants == 1 else f"{ants} ants"
    colony = f" {velocities_of(plan)}, {counted}, seed {path.seed}" if ants else ""
    has_search = plan.search.has_local_search
    search = f", {path.work.perturbations} perturbations" if has_search else ""
    walk = walk_figures(ground.lattice, path.cells)
    deg = round(ground.lattice_deg, 3)
    askew = f" at {deg:g} degrees" if deg else ""
    lines = [
        f"{plan.map.name}: {plan.problem.cells} cells of {ground.lattice.cell_m:g} m{askew}, "
        f"{walk.steps} steps, {walk.revisits} revisits, {walk.turns_90} quarter-turns; "
        f"at most {path.gap or 0.0:.1%} above the least time there can be",
    ]
    if judged is not None:
        lines.append(f"reachable floor: {plan.floor}")
    shows_floor = judged is not None and plan.line != CELLS
    return draw_walk(
        ground.lattice,
        path.cells,
        grid=ground.grid,
        title=path.planner + colony + search,
        lines=lines,
        line_xy=plan.xy,
        swept=MapLayer(judged.geometry, judged.swept) if judged and shows_floor else None,
        unswept=MapLayer(judged.geometry, judged.unswept) if judged else None,
    )
