"""Summary of a plan in words: a few rows for a screen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fasaco_edge.judge.floor import FloorFigures
from fasaco_edge.offline.figures import above_bound, gap_words, patches_left
from fasaco_edge.offline.settings import CELLS
from fasaco_edge.text import percent

if TYPE_CHECKING:
    from fasaco_edge.offline.passes import PassPlans
    from fasaco_edge.offline.result import Drive, Plan

# Ratio of a search's duration and its budget above which a reader wonders.
LATE = 1.5

Rows = list[tuple[str, str]]


def rows_of(plan: Plan) -> Rows:
    """Return the main figures of a plan, as names and words."""
    drive, path, floor = plan.drive, plan.path, plan.floor
    rows = [("map", f"{_map_words(plan)} of {_metres(plan)}")]
    line = "centres of cells" if plan.line == CELLS else plan.line
    rows.append(("line", f"driven: {line_words(drive)} ({line})"))
    if floor is not None:
        rows.append(("swept", _swept(floor)))
        if floor.gap is not None:
            rows.append(("gap", f"line: {gap_words(floor.seconds, floor.gap)}"))
    if plan.curve_words:
        rows.append(("curve", plan.curve_words))
    if floor is not None and floor.illegal_share:
        rows.append(
            ("caution", f"{100 * floor.illegal_share:.1f} % of the line is too close to obstacles")
        )
    walk = f"before the line: {path.steps} steps by {path.planner}, seed {path.seed}"
    rows.append(("walk", walk + above_bound(path)))
    if count := int(plan.problem.unreachable.sum()):
        rows.append(("not reached", f"{count} cells that no walk from the start leads to"))
    rows.append(("search", _search_words(plan)))
    return rows


def _search_words(plan: Plan) -> str:
    budget_s = plan.search.most_s
    if plan.ended_by == "budget" and budget_s is not None and plan.wall_s > LATE * budget_s:
        return f"{plan.wall_s:.1f} s: the first line took longer than the budget of {budget_s:g} s"
    return f"{plan.wall_s:.1f} s, ended by {plan.ended_by}"


def rows_of_passes(plans: PassPlans) -> Rows:
    """Return the main figures of several passes together."""
    first, floor, drive = plans.plans[0], plans.floor, plans.drive
    rows = [("map", f"{_map_words(first)} in the first pass")]
    rows.append(("line", f"{drive.metres:,.1f} m in {len(plans.plans)} passes, {drive.time}"))
    if floor is not None:
        rows.append(("swept", _swept(floor)))
    return rows


def line_words(drive: Drive) -> str:
    """Return the effort of driving a line in words."""
    return f"{drive.metres:,.1f} m, {drive.turns:,.0f} quarter-turns, {drive.time}"


def pass_words(plan: Plan) -> str:
    """Return one of several passes in words."""
    drive = plan.drive
    return f"{plan.problem.cells} cells, {plan.steps} steps, {drive.metres:,.1f} m, {drive.time}"


def _map_words(plan: Plan) -> str:
    """Return the map's name, its sides, which show a wrong resolution, and its cells."""
    grid, cells = plan.map.grid, plan.problem.cells
    sides = ""
    if grid is not None:
        width_m, depth_m = (
            pixels * grid.geometry.resolution for pixels in (grid.geometry.cols, grid.geometry.rows)
        )
        sides = f" {width_m:,.1f} x {depth_m:,.1f} m,"
    return f"{plan.map.name},{sides} {cells} cell{'s' * (cells != 1)}"


def _metres(plan: Plan) -> str:
    deg = round(plan.ground.lattice_deg, 3)
    return f"{plan.ground.lattice.cell_m:g} m" + (f" at {deg:g} degrees" if deg else "")


def _swept(floor: FloorFigures) -> str:
    """Return in words the floor that a line sweeps and leaves."""
    if floor.swept_share is None:
        return "no floor is reachable"
    pace = "" if floor.seconds_per_m2 is None else f", {floor.seconds_per_m2:.1f} s a square metre"
    share = f"{percent(floor.swept_share)} of {floor.reachable_m2:,.1f} m2"
    return f"{share}{pace}; {patches_left(floor)}"
