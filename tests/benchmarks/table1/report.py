"""Tables of runs: one for all grids, one for each grid, and one for the claims."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from fasaco_edge.bench.benchmark import MeasuredGoal, Report, ResultTable
from fasaco_edge.bench.spread import Spread, document
from tests.benchmarks.table1.paper import (
    CLAIMS,
    Finding,
    PaperMap,
    check,
    contradiction,
    paper_map,
    verdict,
)
from tests.benchmarks.table1.runs import FALLING, RISING, VARIANTS, Run, Variant

# The bars for the colony are those of as many ants as the paper's.
GOAL_ANTS = 1000

LABELS = {
    **{f"velocity-{velocity}": f"velocity {velocity}" for velocity in RISING},
    "rising": f"{RISING[0]} -> {RISING[-1]}",
    "falling": f"{FALLING[0]} -> {FALLING[-1]}",
}
# As in the table, FaSACO and ACO stand among the others once more; the last two are ours.
OTHERS = {
    "falling": "FaSACO",
    "velocity-1": "ACO",
    "aco-8-cohorts": "ACO, 8 cohorts",
    "spiral-stc": "Spiral-STC",
    "zigzag": "ZigZag",
    "stc": "STC",
}
# Never in the faithful rows: ants that see more than the paper's, beta = 2.
BEYOND = {
    "falling-anywhere": "end anywhere",
    "falling-distance": "distance",
    "falling-open": "open",
    "falling-open-q98": "open, q0 .98",
    "aco-8-cohorts-open-q98": "open, q0, v 1",
}
HEADER = ("", "n_r_paper", "revisits /\nrecovered", "turns\n90", "CPU\n[s]")
PAPER_HEADER = ("paper's\nn_r", "paper's\nCPU [s]")
CLAIM_HEADER = ("", "change [%]", "by Table I", "verdict")

REMARKS = (
    "Changes are from the other planner to FaSACO, 8 -> 1, seed by seed; negative: FaSACO needs "
    "less. A claim holds on a grid if the median is at least the least that is claimed.",
    "Medians, in brackets the range over the seeds. n_r_paper: entries of the path less distinct "
    "cells, start to start; as no entry stands twice in these walks it equals revisits, steps + 1 "
    "less distinct cells. recovered: recovered_cells, distinct cells visited twice or more. "
    "turns_90: quarter-turns. CPU: of one thread, per run.",
    "ACO, 8 cohorts: Algorithm 1 deposits only after each cohort, so a colony of one cohort (as "
    "every constant velocity) gets its only global update when it is over, and its ants never "
    "profit from it; this row sets the effect of velocity apart from that of the number of "
    "updates. STC: spanning-tree coverage of Gabriely and Rimon, which the paper's Spiral-STC, "
    "a backtracking spiral, is not.",
    "Beyond the paper, never in its rows: FaSACO 8 -> 1 that may end anywhere (n_r_paper counts "
    "the shortest way home, revisits do not); FaSACO whose visibility, eta of equation (5), is 1 "
    "over the distance an ant is about to go (distance), or 1 over one more than the neighbour's "
    "own open neighbours (open, Warnsdorff's rule), squared; the same with q0 = 0.98; and that in "
    "8 cohorts of velocity 1 (v 1), which shows what velocity is worth to ants that see what will "
    "soon be cut off.",
)


@dataclass(frozen=True, slots=True)
class GridRuns:
    """All runs on one grid."""

    name: str
    cells: int
    runs: tuple[Run, ...]

    @property
    def known(self) -> PaperMap | None:
        """The map of Table I that this grid is."""
        return paper_map(self.name, self.cells)

    @property
    def own(self) -> tuple[str, ...]:
        """The user's own planners."""
        return tuple(dict.fromkeys(run.variant for run in self.runs if run.variant not in VARIANTS))

    def values(self, figure: str, variant: str) -> dict[int, float]:
        """Return a figure of each of a variant's runs, by seed."""
        mine = (run for run in self.runs if run.variant == variant)
        return {
            run.seed: run.cpu_s if figure == "cpu_s" else getattr(run.walk, figure) for run in mine
        }

    def spread(self, figure: str, variant: str) -> Spread | None:
        """Return a figure of a variant in short."""
        return Spread.of(list(self.values(figure, variant).values()))

    def findings(self) -> tuple[Finding, ...]:
        """Return what became of the claims here."""
        figures = {
            figure: {variant: self.values(figure, variant) for variant in VARIANTS}
            for figure in ("n_r_paper", "cpu_s")
        }
        return tuple(check(self.name, figures, self.known))


def report(ants: int, seeds: int, runs: Sequence[Run]) -> Report:
    """Sum up the runs there are."""
    cells = {run.grid: run.cells for run in runs}
    grids = [
        GridRuns(name, cells[name], tuple(run for run in runs if run.grid == name))
        for name in cells
    ]
    findings = [finding for grid in grids for finding in grid.findings()]
    rows = (*OTHERS, *(grids[0].own if grids else ()))
    labels = (OTHERS.get(variant, variant) for variant in rows)
    return Report(
        title=f"Table I, n_r_paper: {ants} ants, {seeds} seeds, start to start",
        header=("", *(label.replace(", ", "\n").replace(":", ":\n") for label in labels)),
        rows=tuple(_summary(grid, rows) for grid in grids),
        figures={
            "ants": ants,
            "seeds": seeds,
            "return_home": True,
            "grids": [_figures(grid) for grid in grids],
            "claims": [finding.document() for finding in findings],
            "verdicts": {
                claim.text: f"{verdict(claim, findings)} {contradiction(claim)}".strip()
                for claim in CLAIMS
            },
        },
        goals=tuple(goal for grid in grids for goal in _goals(grid, ants)),
        remarks=REMARKS,
        further=(*map(_table, grids), *_claims(findings)),
    )


def _summary(grid: GridRuns, rows: Sequence[str]) -> tuple[str, ...]:
    medians = (_count(grid.spread("n_r_paper", variant), in_short=True) for variant in rows)
    return grid.name, *medians


def _figures(grid: GridRuns) -> dict[str, Any]:
    known = grid.known
    return {
        "grid": grid.name,
        "cells": grid.cells,
        "paper_map": known and known.name,
        "optimum_revisits": known and known.optimum,
        "rows": [_row_figures(grid, variant) for variant in (*VARIANTS, *grid.own)],
    }


def _row_figures(grid: GridRuns, variant: str) -> dict[str, Any]:
    paper = grid.known and grid.known.figures(variant)
    known = VARIANTS.get(variant, Variant(variant, variant))
    return {
        "variant": variant,
        "planner": known.planner,
        "velocities": list(known.velocities),
        "runs": len(grid.values("cpu_s", variant)),
        **{
            figure: document(grid.spread(figure, variant))
            for figure in ("n_r_paper", "revisits", "recovered_cells", "turns_90", "cpu_s")
        },
        "paper": paper and paper.document(),
    }


def _table(grid: GridRuns) -> ResultTable:
    known = grid.known
    is_known = f", the paper's {known.name}" if known else ""
    others, beyond = (
        [_row(grid, variant, label) for variant, label in rows.items()] for rows in (OTHERS, BEYOND)
    )
    if known and known.optimum is not None:
        optimum = ("proven optimum", str(known.optimum))
        others.append(optimum + ("-",) * (len(others[0]) - len(optimum)))
    blank = ("",) * (len(others[0]) - 1)
    own = [_row(grid, variant, variant) for variant in grid.own]
    return ResultTable(
        f"{grid.name}: {grid.cells} cells{is_known}",
        (*HEADER, *PAPER_HEADER) if known else HEADER,
        (
            *(_row(grid, variant, label) for variant, label in LABELS.items()),
            ("others", *blank),
            *others,
            ("beyond", *blank),
            *beyond,
            *([("yours", *blank)] if own else []),
            *own,
        ),
    )


def _row(grid: GridRuns, variant: str, label: str) -> tuple[str, ...]:
    revisits, recovered = (
        _count(grid.spread(figure, variant), in_short=True)
        for figure in ("revisits", "recovered_cells")
    )
    row = (
        label,
        _count(grid.spread("n_r_paper", variant)),
        f"{revisits} / {recovered}",
        _count(grid.spread("turns_90", variant), in_short=True),
        _seconds(grid.spread("cpu_s", variant)),
    )
    if grid.known is None:
        return row
    paper = grid.known.figures(variant)
    if paper is None:
        return (*row, "-", "-")
    return (*row, str(paper.n_r), f"{paper.cpu_s:g}" if paper.cpu_s else "~0")


def _count(spread: Spread | None, in_short: bool = False) -> str:
    if spread is None:
        return "-"
    if in_short or spread.low == spread.high:
        return f"{spread.median:g}"
    return f"{spread.median:g} ({spread.low:g}-{spread.high:g})"


def _seconds(spread: Spread | None) -> str:
    if spread is None:
        return "-"
    return f"{spread.median:.{3 if spread.median >= 0.001 else 5}f}"


def _claims(findings: Sequence[Finding]) -> Iterator[ResultTable]:
    for number, claim in enumerate(CLAIMS, start=1):
        rows = tuple(_claim_row(finding) for finding in findings if finding.claim == claim)
        if rows:
            yield ResultTable(f"claim {number}: {claim.text}", CLAIM_HEADER, rows)


def _claim_row(finding: Finding) -> tuple[str, ...]:
    change = finding.change
    measured = f"{change.median:+.1f} ({change.low:+.1f} .. {change.high:+.1f})" if change else "-"
    paper = "-" if finding.paper is None else f"{finding.paper:+.1f}"
    return finding.grid, measured, paper, finding.words


def _goals(grid: GridRuns, ants: int) -> Iterator[MeasuredGoal]:
    known = grid.known
    if known is None:
        return
    colony = known.figures("falling")
    if ants >= GOAL_ANTS and colony is not None:
        yield _goal(grid, "n_r_paper", "falling", colony.n_r)
    for variant, revisits in known.driven:
        yield _goal(grid, "revisits", variant, revisits)


def _goal(grid: GridRuns, figure: str, variant: str, most: int) -> MeasuredGoal:
    spread = grid.spread(figure, variant)
    what = f"{grid.name}: {figure} of {OTHERS[variant]}"
    return MeasuredGoal(what, spread.median if spread else None, float(most))
