"""Pictures of a plan: the line over the map with the floor that it leaves, and the pheromone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from fasaco_edge.drawing.pictures import draw_walk
from fasaco_edge.drawing.plot import MapLayer
from fasaco_edge.drawing.trail import draw_trail
from fasaco_edge.offline.figures import velocities_of
from fasaco_edge.offline.settings import CELLS
from fasaco_edge.planners.living_trail import Tau, branching
from fasaco_edge.planners.path import walk_figures

if TYPE_CHECKING:
    from fasaco_edge.offline.plan import Plan


def picture_of(plan: Plan) -> Image.Image:
    """Return a picture, RGB, of a plan."""
    path, ground, judged = plan.path, plan.ground, plan.judged
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
        title=path.planner + _colony(plan) + search,
        lines=lines,
        line_xy=plan.xy,
        swept=MapLayer(judged.geometry, judged.swept) if judged and shows_floor else None,
        unswept=MapLayer(judged.geometry, judged.unswept) if judged else None,
    )


def pheromone_picture_of(plan: Plan, tau: Tau) -> Image.Image:
    """Return a picture, RGB, of the trail that a plan's colony left."""
    ground = plan.ground
    # Ants come nowhere else.
    tau = np.where(plan.problem.to_cover[..., np.newaxis], tau, np.float32(0))
    # Cells askew are drawn upright, without the map that they lie askew on.
    deg = round(ground.lattice_deg, 3)
    askew = f", along rows at {deg:g} degrees to the map, which is not drawn" if deg else ""
    lines = [
        f"{plan.map.name}: where the pheromone on a cell's steps points to{askew}. The stronger "
        "the colour and the larger the arrow, the more of it lies on that one step, beside "
        "the cell where it is most.",
        f"On average {branching(tau):.2f} of a cell's directions have much pheromone (1: the trail "
        "leads one way everywhere).",
    ]
    return draw_trail(
        ground.lattice,
        tau,
        grid=None if deg else ground.grid,
        title=f"pheromone of {plan.path.planner}{_colony(plan)}",
        lines=lines,
    )


def _colony(plan: Plan) -> str:
    """Return which ants walked; "" for none."""
    ants = plan.path.work.ants
    counted = "1 ant" if ants == 1 else f"{ants} ants"
    return f" {velocities_of(plan)}, {counted}, seed {plan.path.seed}" if ants else ""
