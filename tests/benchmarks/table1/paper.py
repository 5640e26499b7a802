"""Table I of Carr and Wang 2022, facts about its grids, and the paper's claims.

The authors' public code (github.com/jynxmagic/FCPP-Survey, Apache-2.0) reproduces two of the
paper's three maps. With a robot and a tool of 0.3 m radius, the start at the map's origin, unknown
pixels free, and cells occupied if one of their pixels is, its Spiral-STC and ZigZag give exactly
the table's 109, 487, 113 and 407. No setting tried gives the office's figures.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fasaco_edge.bench.spread import Spread, document

VARIANTS = (
    *(f"velocity-{velocity}" for velocity in range(1, 9)),
    "rising",
    "falling",
    "spiral-stc",
    "zigzag",
)


@dataclass(frozen=True, slots=True)
class PaperFigures:
    """One line of Table I on one map: its n_r, and CPU time [s], 0 for about 0."""

    n_r: int
    cpu_s: float

    def document(self) -> dict[str, Any]:
        """Return this as JSON values."""
        return {"n_r": self.n_r, "cpu_s": self.cpu_s}


@dataclass(frozen=True, slots=True)
class PaperMap:
    """One map of Table I.

    Attributes:
        name: what the paper calls it.
        n_r, cpu_s: the table's columns, in the order of ``VARIANTS``.
        grid: name of the grid that its authors' code makes of it; "" where nobody knows.
        cells: how many cells that has.
        driven: revisits that the robot of the authors' Spiral-STC and ZigZag drives,
            start to start, by variant.
        optimum: revisits of a shortest walk, start to start; proven by branch and cut.
    """

    name: str
    n_r: tuple[int, ...]
    cpu_s: tuple[float, ...]
    grid: str = ""
    cells: int = 0
    driven: tuple[tuple[str, int], ...] = ()
    optimum: int | None = None

    def figures(self, variant: str) -> PaperFigures | None:
        """Return what the table says of a variant; None where it says nothing."""
        if variant not in VARIANTS:
            return None
        place = VARIANTS.index(variant)
        return PaperFigures(self.n_r[place], self.cpu_s[place])


TABLE_I = (
    PaperMap(
        "Office",
        (34, 30, 30, 34, 36, 30, 42, 36, 30, 30, 47, 45),
        (5.0, 5.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 0.0, 0.0),
    ),
    PaperMap(
        "Simulated map",
        (80, 80, 82, 70, 72, 72, 72, 72, 72, 70, 109, 113),
        (96.0, 76.0, 65.0, 56.0, 52.0, 50.0, 48.0, 48.0, 65.0, 65.0, 0.0, 0.0),
        grid="paper_simulated",
        cells=169,
        driven=(("spiral-stc", 80), ("zigzag", 84)),
        optimum=46,
    ),
    PaperMap(
        "Basement",
        (321, 347, 333, 305, 305, 293, 295, 307, 307, 299, 487, 407),
        (140.0, 126.0, 115.0, 108.0, 106.0, 102.0, 101.0, 100.0, 113.0, 113.0, 0.2, 0.0),
        grid="paper_basement",
        cells=520,
        driven=(("spiral-stc", 249), ("zigzag", 271)),
        optimum=53,
    ),
)


def paper_map(grid: str, cells: int) -> PaperMap | None:
    """Return the paper's map that a grid is, by its name and size; None if it is none."""
    return next((known for known in TABLE_I if (known.grid, known.cells) == (grid, cells)), None)


# Of a variant by its name: a figure of each run, by seed.
Measured = Mapping[str, Mapping[int, float]]


@dataclass(frozen=True, slots=True)
class Claim:
    """FaSACO (8 -> 1) needs ``low`` to ``high`` percent less of a figure than another planner.

    Attributes:
        text: the claim in words.
        figure: "n_r_paper" or "cpu_s".
        against: name of the other variant.
        low, high: how much less [percent]; it holds from ``low`` on.
    """

    text: str
    figure: str
    against: str
    low: float
    high: float


CLAIMS = (
    Claim(
        "FaSACO re-covers 6.9-12.5 % fewer cells than ACO", "n_r_paper", "velocity-1", 6.9, 12.5
    ),
    Claim("FaSACO takes 19.3-32.3 % less CPU than ACO", "cpu_s", "velocity-1", 19.3, 32.3),
    Claim(
        "FaSACO re-covers 13.5-38.6 % fewer cells than Spiral-STC",
        "n_r_paper", "spiral-stc", 13.5, 38.6,
    ),
    Claim(
        "FaSACO re-covers 26.5-38.1 % fewer cells than ZigZag", "n_r_paper", "zigzag", 26.5, 38.1
    ),
    # Not the paper's words: its claims against an ACO with as many global updates.
    Claim(
        "as claim 1, but against ACO in 8 cohorts", "n_r_paper", "aco-8-cohorts", 6.9, 12.5
    ),
    Claim("as claim 2, but against ACO in 8 cohorts", "cpu_s", "aco-8-cohorts", 19.3, 32.3),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Finding:
    """What was measured of a claim on one grid.

    Attributes:
        claim: the claim.
        grid: name of the grid.
        change: FaSACO against the other, seed by seed [percent], negative where it needs
            less; None where nothing was measured, or a share of 0 would have to be taken.
        paper: the same by Table I; None on other grids.
    """

    claim: Claim
    grid: str
    change: Spread | None
    paper: float | None = None

    @property
    def holds(self) -> bool | None:
        """Whether the median is at least what is claimed, to the digit it is claimed with."""
        return None if self.change is None else round(-self.change.median, 1) >= self.claim.low

    @property
    def words(self) -> str:
        """The verdict in words."""
        if self.change is None:
            return "not measured"
        percent = round(self.change.median, 1)
        if self.holds:
            return "holds" if -percent <= self.claim.high else "holds, and more"
        if percent < 0.0:
            return "fails: not enough"
        return "fails: no difference" if percent == 0.0 else "fails: more"

    def document(self) -> dict[str, Any]:
        """Return this as JSON values."""
        return {
            "claim": self.claim.text,
            "grid": self.grid,
            "figure": self.claim.figure,
            "against": self.claim.against,
            "claimed_percent": [-self.claim.high, -self.claim.low],
            "change_percent": document(self.change),
            "paper_percent": None if self.paper is None else round(self.paper, 1),
            "holds": self.holds,
        }


def paired_change(ours: Mapping[int, float], others: Mapping[int, float]) -> Spread | None:
    """Return by how much ours differ from others [percent], seed by seed where both ran."""
    seeds = ours.keys() & others.keys()
    if any(others[seed] == 0 for seed in seeds):
        return None
    return Spread.of([100.0 * (ours[seed] / others[seed] - 1.0) for seed in sorted(seeds)])


def check(grid: str, figures: Mapping[str, Measured], known: PaperMap | None) -> Iterator[Finding]:
    """Yield what was measured of each claim on a grid.

    Args:
        grid: its name.
        figures: by the figure's name, then variant and seed.
        known: the map of Table I that the grid is.
    """
    for claim in CLAIMS:
        measured = figures[claim.figure]
        change = paired_change(measured.get("falling", {}), measured.get(claim.against, {}))
        yield Finding(claim, grid, change, paper_change(claim, known) if known else None)


def paper_change(claim: Claim, known: PaperMap) -> float | None:
    """Return the change by Table I itself [percent]; None where it has no figure."""
    ours, others = known.figures("falling"), known.figures(claim.against)
    if ours is None or others is None:
        return None
    if claim.figure == "n_r_paper":
        return 100.0 * (ours.n_r / others.n_r - 1.0)
    return 100.0 * (ours.cpu_s / others.cpu_s - 1.0)


def verdict(claim: Claim, findings: Sequence[Finding]) -> str:
    """Return in plain words on which grids a claim holds, and on which not."""
    mine = [finding for finding in findings if finding.claim == claim and finding.change]
    if not mine:
        return "Not measured."
    holds = [finding for finding in mine if finding.holds]
    fails = [finding for finding in mine if not finding.holds]
    if not fails:
        return f"Holds on all {len(mine)} grids: {_changes(holds)}."
    if not holds:
        return f"Fails on all {len(mine)} grids: {_changes(fails)}."
    return (
        f"Holds on {len(holds)} of {len(mine)} grids: {_changes(holds)}. "
        f"Fails on {len(fails)}: {_changes(fails)}."
    )


def _changes(findings: Sequence[Finding]) -> str:
    parts = []
    for finding in findings:
        assert finding.change is not None
        more = " (more)" if finding.change.median > 0.0 else ""
        parts.append(f"{finding.grid} {finding.change.median:+.1f} %{more}")
    return ", ".join(parts)


def contradiction(claim: Claim) -> str:
    """Return what Table I itself says where that is not the claim; else nothing."""
    changes = [paper_change(claim, known) for known in TABLE_I]
    less = sorted(round(-change, 1) for change in changes if change is not None)
    if not less or (less[0], less[-1]) == (claim.low, claim.high):
        return ""
    return f"By Table I itself it would be {less[0]:g}-{less[-1]:g} % less."
